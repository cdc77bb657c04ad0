// SPDX-License-Identifier: MIT
// Shared-memory ring of frames: one writer (a camera process, the virtual stage), one reader (the daemon).
//
// A file (on tmpfs for speed) that both ends map: RingHeader, then `slots` records of `stride` bytes, each a RingFrame
// and its samples. `head` counts frames written, `tail` frames released by the reader; both only grow, and record n
// lies at n % slots. The writer waits while head - tail == slots (--pace virtual) or drops the frame and counts it
// (--pace wall).
#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>

#include "image/frame.hpp"
#include "result.hpp"

namespace ols {

constexpr uint64_t ring_magic = 0x31474e4952534c4f;  // "OLSRING1", little-endian

struct RingHeader {
    uint64_t magic;
    uint32_t slots;   // records
    uint32_t stride;  // bytes a record, RingFrame included, rounded up to 64
    alignas(64) std::atomic<uint64_t> head;
    std::atomic<uint64_t> watermark_ns;  // camera time before which every frame was written
    std::atomic<uint64_t> dropped;       // frames the writer could not place (wall pace)
    std::atomic<uint32_t> head_futex;    // changes with head, watermark and closed
    std::atomic<uint32_t> closed;        // 1: no more frames will come
    alignas(64) std::atomic<uint64_t> tail;
    std::atomic<uint32_t> tail_futex;
};

struct RingFrame {
    uint32_t camera, width, height;
    PixelFormat format;
    Cfa cfa;
    uint32_t pitch_bytes;
    uint64_t frame_id, timestamp_ns;
    float black, white;
    uint64_t bytes;  // samples that follow
};

class RingWriter {
  public:
    // Makes the file (replacing an older one). `frame_bytes` is the largest frame.
    static Result<RingWriter> create(const std::string& path, uint32_t slots, uint64_t frame_bytes);

    // Copies one frame in; false when the ring is full and `wait` is off (the frame is counted as dropped).
    // With `wait`, returns false only when `cancelled` becomes true.
    bool write(const Frame& frame, bool wait, const std::atomic<bool>& cancelled);
    void set_watermark(uint64_t camera_time_ns);
    void close();

    RingWriter(RingWriter&&) noexcept;
    RingWriter& operator=(RingWriter&&) noexcept;
    ~RingWriter();

  private:
    struct Mapping;
    explicit RingWriter(std::unique_ptr<Mapping>);
    std::unique_ptr<Mapping> mapping_;
};

class RingReader {
  public:
    // Opens an existing ring; the error says to start the camera first when the file is not there.
    static Result<RingReader> open(const std::string& path);

    // The next frame, copied out, or nothing when none came within `timeout_ms` (a pause for the caller to look at
    // its stop flag; nothing else is decided by it).
    std::optional<Frame> read(int timeout_ms);
    uint64_t watermark_ns() const;
    uint64_t dropped() const;
    bool closed() const;  // the writer has closed and every frame was read

    RingReader(RingReader&&) noexcept;
    RingReader& operator=(RingReader&&) noexcept;
    ~RingReader();

  private:
    struct Mapping;
    explicit RingReader(std::unique_ptr<Mapping>);
    std::unique_ptr<Mapping> mapping_;
};

}  // namespace ols
