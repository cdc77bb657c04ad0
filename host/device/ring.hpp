// SPDX-License-Identifier: MIT
// Shared-memory ring of frames: one writer (a camera process, the virtual stage), one reader (the daemon).
//
// A file (on tmpfs for speed) that both ends map: RingHeader, then `slots` records of `stride` bytes, each a RingFrame
// and its samples. `head` counts frames written, `tail` frames released by the reader; both only grow, and record n
// lies at n % slots. The writer waits while head - tail == slots (--pace virtual) or drops the frame and counts it
// (--pace wall).
//
// Neither end believes the other: what says where records lie (slots, stride, content) is read once, checked and kept; each end
// keeps the count that is its own; the other's must stay within the slots from it; a file that is cut short while it is mapped
// ends the ring. A frame that is not as the header says comes without samples.
//
// Each end holds a lock on a byte of the file for as long as its process lives, so that the other knows when it has gone,
// however it went. Frames are for a reader that has started the camera: it asks for a start, the writer answers with the
// camera's time, and until then nothing goes in.
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>

#include "image/frame.hpp"
#include "result.hpp"

namespace ols {

constexpr uint64_t ring_magic = 0x33474e4952534c4f;  // "OLSRING3", little-endian

// What the frames are, as the writer's camera is set up; a frame that failed to be may come smaller.
struct RingContent {
    uint32_t width = 0, height = 0;
    PixelFormat format = PixelFormat::u16;
    Cfa cfa = Cfa::none;
    uint32_t bits = 0;  // of a sample of u16
    uint32_t reserved = 0;

    uint64_t frame_bytes() const {
        return uint64_t(width) * height * uint64_t(samples_per_pixel(cfa)) * sample_bytes(format);
    }
};

// What says where everything lies; written once, before there is a file of that name.
struct RingLayout {
    uint64_t magic = ring_magic;
    uint32_t slots = 0;   // records
    uint32_t stride = 0;  // bytes a record, RingFrame included, rounded up to 64
    RingContent content;
};

struct RingHeader {
    RingLayout layout;
    // The writer's.
    alignas(64) std::atomic<uint64_t> head;
    std::atomic<uint64_t> watermark_ns;  // camera time before which every frame was written
    std::atomic<uint64_t> dropped;       // frames the writer could not place (wall pace)
    std::atomic<uint32_t> head_futex;    // changes with everything else that the writer changes
    std::atomic<uint32_t> closed;        // 1: no more frames will come
    std::atomic<uint32_t> started;       // the start that was answered last
    std::atomic<uint64_t> started_ns;    // the camera's time at it
    std::atomic<uint64_t> started_head;  // head at it: the records before are nobody's
    // The reader's.
    alignas(64) std::atomic<uint64_t> tail;
    std::atomic<uint32_t> tail_futex;  // changes with everything else that the reader changes
    std::atomic<uint32_t> asked;       // counts the starts asked for
    std::atomic<uint32_t> running;     // 1 from a start to its stop
};

struct RingFrame {
    uint32_t camera, width, height;
    PixelFormat format;
    Cfa cfa;
    uint32_t pitch_bytes;
    uint64_t frame_id, timestamp_ns;
    float black, white;
    uint64_t bytes;           // samples that follow
    uint64_t dropped_before;  // RingHeader::dropped, before this frame
};

constexpr uint32_t ring_slots_max = 1 << 16, ring_size_max = 1 << 14;  // records; pixels a side

// What is wrong with the layout of a ring in a file of `file_bytes`; empty when nothing is.
std::string ring_defect(const RingLayout& layout, uint64_t file_bytes);

struct RingMapping;

// For one thread.
class RingWriter {
  public:
    // Makes the file (replacing an older one).
    static Result<RingWriter> create(const std::string& path, uint32_t slots, const RingContent& content);

    // A start that the reader waits for. Answer with the camera's time once every earlier exposure is behind: written, or
    // never to be.
    std::optional<uint32_t> start_asked() const;
    void confirm_start(uint32_t start, uint64_t camera_time_ns);

    // Whether frames are for somebody: a reader lives, has started the camera and not stopped it.
    bool wanted() const;

    enum class Outcome {
        written,
        full,      // there was no room and `wait` was off; counted as dropped
        unwanted,  // nobody wants it, or not any more
        cancelled
    };
    // Copies one frame in. With `wait`, waits for room as long as the frame is wanted and `cancelled` is false.
    Outcome write(const Frame& frame, bool wait, const std::atomic<bool>& cancelled);
    void set_watermark(uint64_t camera_time_ns);
    void close();

    RingWriter(RingWriter&&) noexcept;
    RingWriter& operator=(RingWriter&&) noexcept;
    ~RingWriter();

  private:
    explicit RingWriter(std::unique_ptr<RingMapping>);
    std::unique_ptr<RingMapping> mapping_;
};

// start() and read() from one thread at a time, the rest from any.
class RingReader {
  public:
    // Opens an existing ring, as its only reader; the error says to start the camera first when the file is not there or its
    // writer is not, that another program reads it, or what makes it no ring.
    static Result<RingReader> open(const std::string& path);

    const RingContent& content() const;  // as it was when the ring was opened
    uint32_t slots() const;

    // Has the camera started; what lies in the ring from before is let go of. Returns the camera's time. Fails when the
    // writer goes, when it does not answer within `patience_ms`, or when stop() is called meanwhile.
    Result<uint64_t> start(int patience_ms);
    void stop();

    // The next frame, copied out, or nothing when none came within `timeout_ms` (a pause for the caller to look at
    // its stop flag; nothing else is decided by it). One that is larger than the header's content, of another format, or whose
    // rows are not in its bytes comes without samples.
    // `copy_rows`: copies the samples of a frame of which all else is set.
    using CopyRows = std::function<void(const std::byte*, Frame&)>;
    std::optional<Frame> read(int timeout_ms, const CopyRows& copy_rows = copy_as_they_are);
    uint64_t watermark_ns() const;
    // Frames that found no room, of those before the last one that was read; once all are read, of all.
    uint64_t dropped() const;

    enum class Writer { live, closed, gone, broken };
    // `live` also while frames are to be read; `gone` when its process ended without closing the ring; `broken`: what is in the
    // ring cannot be, problem() says what. After any but `live` nothing more is read.
    Writer writer() const;
    std::string problem() const;  // "its counts jumped"

    RingReader(RingReader&&) noexcept;
    RingReader& operator=(RingReader&&) noexcept;
    ~RingReader();

  private:
    struct State;
    explicit RingReader(std::unique_ptr<State>);
    uint64_t frames_waiting() const;
    static void copy_as_they_are(const std::byte* samples, Frame& frame);
    Frame take_frame(const CopyRows& copy_rows);
    void note_drops(uint64_t before_frame);
    std::unique_ptr<State> state_;
};

}  // namespace ols
