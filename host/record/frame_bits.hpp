// SPDX-License-Identifier: MIT
// What a frame's samples are bit for bit: a buffer that is handed out again under a new stamp is known by it, noise and all.
#pragma once

#include <cstdint>
#include <deque>
#include <memory>
#include <optional>
#include <unordered_map>

#include "image/frame.hpp"
#include "stage/stage.hpp"

struct XXH3_state_s;  // xxhash.h

namespace ols {

struct FrameBits {
    uint64_t hash = 0;
    // Whether two exposures to the same light cannot have these bits, because enough of the samples are neither 0 nor saturated and noise
    // moves them. Nothing is known of a frame that is black or saturated throughout, or of a camera without noise.
    bool tells = false;
};

// The hash of a frame, by its rows in their order: XXH3 of 64 bits over the samples, without what lies between rows.
class RowHash {
  public:
    RowHash();
    void begin();
    void add(const Frame& frame, uint32_t rows, const std::byte* samples);
    uint64_t value() const;

  private:
    struct Release {
        void operator()(XXH3_state_s* state) const;
    };
    std::unique_ptr<XXH3_state_s, Release> state_;
};

// Reads frames of one camera. Thread-safe.
class BitsReader {
  public:
    // Of the camera its saturation and its read noise, the least that moves a sample, are used.
    explicit BitsReader(const CameraConfig& camera);

    // Of a frame whose samples are complete, with their hash. Samples of floats have no noise that is known here: they never tell.
    FrameBits read(const Frame& frame, uint64_t hash) const;

  private:
    uint16_t saturated_;
    double samples_needed_;  // that noise can move, until equal bits cannot be chance
};

// The chance that two samples of one light are equal: of whole counts with Gaussian noise of `sigma_counts`, whose mean is a whole count.
double equal_chance(double sigma_counts);

// Remembers the last frames by their bits.
class BitsSeen {
  public:
    static constexpr size_t frames_max = 1 << 16;  // half a minute at 2160 a second

    struct Seen {
        uint64_t arrival;
        CameraStamp stamp;
    };
    // The first of the frames remembered that had the same bits, if these tell; otherwise the frame is remembered.
    std::optional<Seen> add(const FrameBits& bits, const Seen& frame);

  private:
    std::unordered_map<uint64_t, Seen> frames_;  // by hash
    std::deque<uint64_t> order_;
};

}  // namespace ols
