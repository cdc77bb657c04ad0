// SPDX-License-Identifier: MIT
// An opened GenICam camera and its stream of buffers. All of it waits for the device; LibraryThread is where that belongs.
#pragma once

#include <atomic>

#include "device/aravis_features.hpp"
#include "device/aravis_setup.hpp"

namespace ols {

uint64_t ticks_to_ns(uint64_t ticks, uint64_t ticks_hz);

// Buffers that are filled, and frames that were lost for lack of one.
class AravisStream {
  public:
    // USB3 Vision: each frame's trailer lies in its buffer behind so many bytes; 0 where it does not.
    explicit AravisStream(ObjectPointer<ArvStream> stream, size_t trailer_at = 0)
        : stream_(std::move(stream)), trailer_at_(trailer_at) {}

    // The next buffer that is done with, or nullptr within `timeout_ms`; give it back. From any thread, as all below.
    ArvBuffer* take(int timeout_ms);
    void give_back(ArvBuffer* buffer);
    // Whether the buffer holds a frame: Aravis gives out again, as it was, one that it could not begin to fill.
    static bool is_filled(ArvBuffer* buffer);
    // Whether the device says of the frame that it is not as it was exposed.
    bool is_disowned(ArvBuffer* buffer) const;

    bool has_waiting() const;
    size_t free_buffers() const;  // that wait to be filled
    // So many packets, of USB3 frames, found no buffer to go to, since the stream began.
    uint64_t unplaced() const;
    uint64_t resent_packets() const;

  private:
    ObjectPointer<ArvStream> stream_;
    size_t trailer_at_;
};

// Made, used and let go in one thread, but for what says otherwise.
class AravisLink {
  public:
    // Errors as open_aravis_camera's.
    static Result<std::shared_ptr<AravisLink>> open(const std::string& name);
    ~AravisLink();
    AravisLink(const AravisLink&) = delete;

    const std::string& name() const { return name_; }  // maker, model, serial number
    ArvDevice* device() { return device_.get(); }
    bool is_gige() const { return ARV_IS_GV_DEVICE(device_.get()); }

    // A stream of buffers for frames as they are set up now, packets as large as go through. `chosen` says what was chosen.
    Result<std::unique_ptr<AravisStream>> make_stream(std::string& chosen);
    Status begin_acquisition();
    void end_acquisition();

    // The camera's time; nothing when it cannot be asked.
    std::optional<uint64_t> time_ns();
    uint64_t ticks_hz() const { return ticks_hz_; }  // of the transport's time stamps
    // Whether the device answers.
    bool answers();
    // Whether frames may come, by its own word; nothing when it has none.
    std::optional<bool> is_acquiring();

    // From any thread: the device was unplugged, or gives no answer, or another program has it.
    bool is_lost() const { return is_lost_; }

  private:
    explicit AravisLink(ObjectPointer<ArvDevice> device);
    Result<std::unique_ptr<AravisStream>> make_usb_stream(std::string& chosen);
    std::optional<uint64_t> latched_ns();

    ObjectPointer<ArvDevice> device_;
    std::string name_;
    uint64_t ticks_hz_ = 1'000'000'000;
    unsigned long lost_signal_ = 0;
    std::atomic<bool> is_lost_ = false;
};

}  // namespace ols
