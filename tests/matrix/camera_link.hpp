// SPDX-License-Identifier: MIT
// CameraLink: a camera whose exposures and losses a test makes, and the project's own driver at the other end of its link.
#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "device/camera.hpp"
#include "scenario.hpp"

namespace ols::test {

// One exposure as the camera has it.
struct Shot {
    CameraStamp stamp;
    uint32_t width = 0, height = 0;
    std::vector<uint16_t> samples;  // of its rows
};

class CameraLink {
  public:
    virtual ~CameraLink() = default;

    // The driver. While it is opened and started serve() must be called from another thread.
    virtual Result<std::unique_ptr<Camera>> open() = 0;
    virtual void serve() {}

    // Whether such a thing can happen on this link.
    virtual bool can(FaultKind kind) const = 0;

    // The camera's clock is so far.
    virtual void set_now(uint64_t now_ns) = 0;

    // Sends a frame of the size that was set up, or of another. A link that knows whether there is room waits for it until `in_haste`.
    // False: there was none; a link that does not know says true.
    virtual bool send(const Shot& shot, const std::atomic<bool>& in_haste) = 0;

    // The camera has counted the frame, and nothing of it arrives, or a part of it.
    virtual void lose(const Shot& shot, bool in_part, const std::atomic<bool>& in_haste) = 0;

    // How many frames find room with nobody reading.
    virtual int room() const = 0;
};

// `work` is a folder for files. What the scenario asks of the link is set up.
std::unique_ptr<CameraLink> make_ring_link(const Scenario& scenario, const std::string& work);
std::unique_ptr<CameraLink> make_gige_link(const Scenario& scenario);
std::unique_ptr<CameraLink> make_v4l2_link(const Scenario& scenario);

}  // namespace ols::test
