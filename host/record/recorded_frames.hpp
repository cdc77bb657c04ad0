// SPDX-License-Identifier: MIT
// RecordedFrames: a recording that lies in files, a .cine or numbered pictures, read frame by frame in any order.
#pragma once

#include <nlohmann/json.hpp>

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "image/frame.hpp"
#include "result.hpp"

namespace ols {

// What is known of a recording before a frame is read.
struct RecordingFacts {
    std::string name;                     // of the camera, or of the files, for the manifest
    std::string link;                     // how the frames lie: "Phantom .cine, 12 bits packed"
    uint32_t width = 0, height = 0;       // pixels
    std::optional<Cfa> cfa;               // where the files say
    std::optional<double> black, white;   // counts, where the files say
    std::optional<double> frame_rate_hz;  // what the camera was set to; a hint for messages alone
    bool has_times = false;               // the camera's own; else a frame's time is its number times a period
    std::vector<int64_t> numbers;         // of each frame, rising; a camera counts from its trigger
    std::vector<uint64_t> times_ns;       // of each frame, with has_times
    std::vector<std::string> said;        // what was converted or left out, one sentence each
    nlohmann::json detail = nlohmann::json::object();  // what else belongs into the manifest

    uint64_t frames() const { return numbers.size(); }
};

class RecordedFrames {
  public:
    virtual ~RecordedFrames() = default;

    virtual const RecordingFacts& facts() const = 0;

    // The samples, pixel format, black and white of frame `index` < frames(); its stamp is the caller's. Thread-safe. The error names
    // the file and the frame.
    virtual Result<Frame> read(uint64_t index) const = 0;
};

using Recording = std::unique_ptr<RecordedFrames>;

}  // namespace ols
