// SPDX-License-Identifier: MIT
// Calls that may hang (set-up, stream on and off) go through a LibraryThread; taking a frame does not wait in the kernel.
#include "device/v4l2_camera.hpp"

#include <fmt/format.h>
#include <poll.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <chrono>
#include <cstring>
#include <mutex>

#include "device/delivery_count.hpp"
#include "device/library_thread.hpp"
#include "device/v4l2_setup.hpp"
#include "device/v4l2_stamps.hpp"
#include "device/v4l2_stream.hpp"

namespace ols {

namespace {

// By when a frame is here, at the latest, after its exposure has ended: read out, through the link and the driver.
constexpr uint64_t delivery_max_ns = 500'000'000;
constexpr uint64_t exposure_max_ns = 1'000'000'000;  // the longest in a stage.toml or a sequence

std::string text_of(const unsigned char* text, size_t room) {
    const auto* const letters = reinterpret_cast<const char*>(text);
    return {letters, strnlen(letters, room)};
}

class V4l2Camera : public Camera {
  public:
    V4l2Camera(std::shared_ptr<V4l2Device> device, const v4l2_capability& is, std::string name, uint32_t index,
               int patience_ms)
        : device_(std::move(device)),
          stream_(std::make_shared<V4l2Stream>(device_, name)),
          name_(std::move(name)),
          model_(fmt::format("{} ({})", text_of(is.card, sizeof is.card), text_of(is.bus_info, sizeof is.bus_info))),
          driver_(text_of(is.driver, sizeof is.driver)),
          index_(index),
          patience_ms_(patience_ms),
          calls_(patience_ms) {}

    ~V4l2Camera() override { (void)end_stream(true); }

    CameraInfo info() const override {
        const std::lock_guard lock(mutex_);
        return {model_,
                fmt::format("V4L2 by {}, {}, {} buffers, stamps at the {}", driver_, made_.text, stream_->buffers(),
                            stream_->stamps_begin() ? "begin of the exposure" : "end of the frame"),
                made_.setup, 1000};
    }

    Status set_up(const CameraSetup& wanted) override {
        stop();
        if (const CameraState now = state(); now.kind == CameraState::gone) return fail(now.why);
        auto made = ask([device = device_, stream = stream_, name = name_, wanted]() -> Result<V4l2Setup> {
            stream->release();
            auto setup = set_up_v4l2(*device, name, wanted);
            if (!setup.ok()) return setup;
            const Status has_room = stream->allocate(setup->picture_bytes);
            return has_room.ok() ? setup : has_room.error();
        });
        if (!made) return fail(unanswered("its set-up"));
        if (!made->ok()) return fail(why_refused(made->error().message));
        const std::lock_guard lock(mutex_);
        made_ = std::move(**made);
        return Done{};
    }

    Result<uint64_t> start() override {
        is_stop_asked_ = false;
        {
            const std::lock_guard lock(mutex_);
            is_streaming_ = false;
            if (state_.kind == CameraState::gone) return fail(state_.why);
            state_ = {};
        }
        const auto begun = ask([stream = stream_] { return stream->end(), stream->begin(); });
        if (!begun && is_stop_asked_) return fail(name_ + " was stopped while it started");
        if (!begun) return fail(unanswered("VIDIOC_STREAMON"));
        if (!begun->ok()) return fail(why_refused(begun->error().message));
        const std::lock_guard lock(mutex_);
        if (is_stop_asked_) return fail(name_ + " was stopped while it started");
        const uint64_t started_ns = device_->now_ns() / 1000 * 1000;  // as fine as the stamps
        delivery_.start(started_ns);
        stamps_.start(stream_->buffers(), driver_ == "v4l2 loopback");
        last_sign_ns_ = started_ns;
        is_streaming_ = true;
        return started_ns;
    }

    void stop() override {
        is_stop_asked_ = true;
        ++stops_;
        {
            const std::lock_guard lock(mutex_);
            is_streaming_ = false;
            if (state_.kind == CameraState::gone) return;
        }
        if (!end_stream(false)) (void)unanswered("VIDIOC_STREAMOFF");
    }

    std::optional<Frame> read(int timeout_ms) override {
        using Clock = std::chrono::steady_clock;
        const auto until = Clock::now() + std::chrono::milliseconds(timeout_ms);
        for (bool has_erred = false;;) {
            {
                const std::lock_guard lock(mutex_);
                while (is_streaming_) {
                    auto frame = Taken{};
                    if (!take(frame)) break;
                    if (frame) return frame;
                    if (Clock::now() > until) return std::nullopt;  // be there ever so many that are of no use
                }
                if (!is_streaming_) return std::nullopt;
                if (has_erred) return lose("it can be read no more (POLLERR)"), std::nullopt;
            }
            if (!is_alive()) return std::nullopt;
            const auto left = std::chrono::ceil<std::chrono::milliseconds>(until - Clock::now());
            if (left.count() <= 0) return std::nullopt;
            const short events = device_->poll(int(left.count()));
            has_erred = (events & (POLLERR | POLLHUP | POLLNVAL)) && !(events & POLLIN);
        }
    }

    uint64_t watermark_ns() const override {
        const std::lock_guard lock(mutex_);
        const bool is_timed = made_.setup.exposure_mode == ExposureMode::timed;
        const uint64_t behind_ns = delivery_max_ns + (is_timed ? exposure_ns() : exposure_max_ns);
        const uint64_t now_ns = device_->now_ns();
        return now_ns - std::min(now_ns, behind_ns);
    }

    CameraCounts counts() const override {
        const std::lock_guard lock(mutex_);
        CameraCounts counts = delivery_.counts();
        counts.dropped = stamps_.late() + overwritten_;
        counts.underrun = underrun_;
        return counts;
    }

    CameraState state() const override {
        const std::lock_guard lock(mutex_);
        return state_;
    }

    CameraState look() override {
        if (state().kind != CameraState::gone) (void)answers();
        return state();
    }

  private:
    using Taken = std::optional<Frame>;

    uint64_t patience_ns() const { return uint64_t(patience_ms_) * 1'000'000; }

    // What `call` returns; nothing when it has not within the patience, or when the camera was stopped meanwhile.
    template <typename Call>
    std::optional<std::invoke_result_t<Call>> ask(Call call) {
        return calls_.run(std::move(call), patience_ms_, [this, stops = stops_.load()] { return stops_ != stops; });
    }

    bool end_stream(bool for_good) {
        const auto ended = ask([stream = stream_, for_good] {
            stream->end();
            if (for_good) stream->release();
            return true;
        });
        return ended.has_value();
    }

    uint64_t exposure_ns() const { return uint64_t(made_.setup.exposure_us * 1000); }

    // One buffer of the driver's, with `mutex_` held. False when there is none; a buffer that holds no frame for us leaves `frame`
    // empty.
    bool take(Taken& frame) {
        const V4l2Stream::Filled filled = stream_->take();
        if (filled.error == EAGAIN) return false;
        if (filled.error != 0) return end_with(filled.error), false;
        const uint64_t now_ns = last_sign_ns_ = device_->now_ns();
        const v4l2_buffer& buffer = filled.buffer;
        const auto stamp = stamps_.read(buffer, now_ns);
        if (!stamp.ok()) return lose(stamp.error().message), false;
        if ((buffer.flags & V4L2_BUF_FLAG_ERROR) || filled.content.size() < made_.picture_bytes)
            ++underrun_;
        else
            frame = frame_of(filled, *stamp);
        if (const int error = stream_->give_back(buffer.index); error != 0) return end_with(error), false;
        stamps_.note_given_back(device_->now_ns());
        return true;
    }

    Taken frame_of(const V4l2Stream::Filled& filled, V4l2Stamp stamp) {
        const bool is_end = !stamp.is_begin && made_.setup.exposure_mode == ExposureMode::timed;
        const CameraStamp ours{stamp.id, stamp.time_ns - std::min(stamp.time_ns, is_end ? exposure_ns() : 0)};
        Frame frame = new_frame();
        frame.camera = index_;
        frame.stamp = ours;
        frame.width = uint32_t(made_.setup.width);
        frame.height = uint32_t(made_.setup.height);
        frame.cfa = made_.setup.cfa;
        frame.white = float((1 << made_.layout.bits) - 1);
        const size_t row_samples = frame.width * size_t(samples_per_pixel(frame.cfa));
        frame.pitch_bytes = uint32_t(row_samples * sizeof(uint16_t));
        frame.samples.make_room(size_t(frame.pitch_bytes) * frame.height);
        const std::span<uint16_t> to(reinterpret_cast<uint16_t*>(frame.samples.data()), row_samples * frame.height);
        const Status whole =
            unpack_samples(filled.content, made_.layout, row_samples, frame.height, made_.row_bytes, to);
        if (!whole.ok() || is_overwritten(filled.buffer)) {
            ++(whole.ok() ? overwritten_ : underrun_);
            return std::nullopt;
        }
        return delivery_.take(ours) ? Taken(std::move(frame)) : std::nullopt;
    }

    // v4l2loopback 0.12 goes on writing into what is being read. The next round begins with this buffer once the one before it has
    // been written: what was copied until then is whole.
    bool is_overwritten(const v4l2_buffer& buffer) {
        if (driver_ != "v4l2 loopback") return false;
        const auto count = uint32_t(stream_->buffers());
        const auto before = stream_->sequence_in((buffer.index + count - 1) % count);
        return !before || int32_t(*before - buffer.sequence) >= int32_t(count) - 1;
    }

    // A DQBUF or QBUF that was refused (vidioc-qbuf.rst).
    void end_with(int error) {
        is_streaming_ = false;
        if (error == EPIPE)
            state_ = {CameraState::ended, name_ + " has ended: its driver says that the last frame was it"};
        else if (error == ENODEV)
            lose("it was unplugged, or its driver removed; plug it in again");
        else
            lose(fmt::format("its driver gave up ({}); unplug it and plug it in again, and see dmesg",
                             std::strerror(error)));
    }
    void lose(const std::string& why) {
        is_streaming_ = false;
        if (state_.kind != CameraState::gone) state_ = {CameraState::gone, name_ + " is gone: " + why};
    }

    std::string unanswered(const std::string& call) {
        const std::lock_guard lock(mutex_);
        lose(fmt::format("it gave no answer to {} within {} s; unplug it and plug it in again", call,
                         double(patience_ns()) * 1e-9));
        return state_.why;
    }
    // Of a refusal by a device that may have gone meanwhile.
    std::string why_refused(const std::string& message) {
        if (answers() || state().kind != CameraState::gone) return message;
        return state().why;
    }
    bool answers() {
        const uint64_t stops = stops_;
        const auto error = ask([device = device_] {
            v4l2_capability is{};
            return device->ioctl(VIDIOC_QUERYCAP, &is);
        });
        if (!error && stops_ != stops) return true;
        if (!error) return unanswered("VIDIOC_QUERYCAP"), false;
        if (*error == 0) return true;
        const std::lock_guard lock(mutex_);
        return end_with(*error), false;
    }

    // A camera that waits for triggers says nothing by itself: it is asked when it has been silent for long.
    bool is_alive() {
        {
            const std::lock_guard lock(mutex_);
            if (device_->now_ns() - last_sign_ns_ < patience_ns()) return true;
            last_sign_ns_ = device_->now_ns();
        }
        return answers();
    }

    const std::shared_ptr<V4l2Device> device_;
    const std::shared_ptr<V4l2Stream> stream_;
    const std::string name_, model_, driver_;
    const uint32_t index_;
    const int patience_ms_;
    std::atomic<bool> is_stop_asked_ = false;

    mutable std::mutex mutex_;
    V4l2Setup made_;
    CameraState state_;
    DeliveryCount delivery_;
    V4l2Stamps stamps_;
    uint64_t underrun_ = 0, overwritten_ = 0, last_sign_ns_ = 0;
    bool is_streaming_ = false;

    std::atomic<uint64_t> stops_ = 0;
    LibraryThread calls_;  // ends before what it uses
};

std::string does_not_open(const std::string& name) {
    return name + " does not open: unplug it and plug it in again";
}

Error no_camera(const std::string& name, uint32_t can) {
    if (can & (V4L2_CAP_VIDEO_CAPTURE_MPLANE | V4L2_CAP_VIDEO_M2M_MPLANE))
        return fail(name +
                    " gives pictures in several planes (V4L2_CAP_VIDEO_CAPTURE_MPLANE), which are not read here");
    if (can & V4L2_CAP_META_CAPTURE)
        return fail(
            name + " gives what is known about pictures, and none: `v4l2-ctl --list-devices` says which is the camera");
    if (can & V4L2_CAP_VIDEO_CAPTURE)
        return fail(name + " cannot stream (V4L2_CAP_STREAMING), and pictures that are read one by one have no stamps");
    return fail(name +
                " captures no pictures: `v4l2-ctl --list-devices` says which does; where another program feeds it "
                "(v4l2loopback), start that one first");
}

}  // namespace

Result<std::unique_ptr<Camera>> make_v4l2_camera(std::shared_ptr<V4l2Device> device, const std::string& path,
                                                 uint32_t index, int patience_ms) {
    const std::string name = "the camera v4l2:" + path;
    LibraryThread calls(patience_ms);
    const auto ask_what_it_is = [device] {
        v4l2_capability is{};
        const int error = device->ioctl(VIDIOC_QUERYCAP, &is);
        return std::pair(error, is);
    };
    const auto told = calls.run(ask_what_it_is, patience_ms);
    if (!told) return fail(does_not_open(name));
    const auto& [error, is] = *told;
    if (error != 0)
        return fail(fmt::format("{} is no V4L2 device ({}): `v4l2-ctl --list-devices` says which there are", name,
                                std::strerror(error)));
    const uint32_t can = is.capabilities & V4L2_CAP_DEVICE_CAPS ? is.device_caps : is.capabilities;
    if (!(can & V4L2_CAP_VIDEO_CAPTURE) || !(can & V4L2_CAP_STREAMING)) return no_camera(name, can);
    return std::unique_ptr<Camera>(std::make_unique<V4l2Camera>(std::move(device), is, name, index, patience_ms));
}

Result<std::unique_ptr<Camera>> open_v4l2_camera(const std::string& text, uint32_t index) {
    const bool is_number = !text.empty() && text.size() < 4 &&
                           std::all_of(text.begin(), text.end(), [](char c) { return c >= '0' && c <= '9'; });
    if (!is_number && !text.starts_with('/'))
        return fail("'v4l2:" + text +
                    "' names no device: write v4l2:/dev/video0 or v4l2:0 (`v4l2-ctl --list-devices`)");
    const std::string path = is_number ? "/dev/video" + text : text;
    LibraryThread calls;
    auto device = calls.run([path] { return open_v4l2_device(path); }, Camera::device_patience_ms);
    if (!device) return fail(does_not_open("the camera v4l2:" + path));
    if (!device->ok()) return device->error();
    return make_v4l2_camera(std::move(**device), path, index);
}

}  // namespace ols
