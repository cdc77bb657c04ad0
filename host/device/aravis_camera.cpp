// SPDX-License-Identifier: MIT
// Camera over AravisLink. What waits for the device runs in a LibraryThread, whose tick is the watchdog; frames are read from the
// stream's buffers, which are the queue. Gaps are counted from ids: Aravis 0.8.26 counts a gap of many as one, and none of USB3.
#include "device/aravis_camera.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <mutex>
#include <utility>

#include "device/aravis_frame.hpp"
#include "device/aravis_link.hpp"
#include "device/buffer_starvation.hpp"
#include "device/camera_clock.hpp"
#include "device/delivery_count.hpp"
#include "device/library_thread.hpp"
#include "exceptions.hpp"
#include "steady_clock.hpp"

namespace ols {

namespace {

constexpr int tick_ms = 200;
constexpr int look_ms = 20;
constexpr uint64_t life_patience_ns = uint64_t(Camera::device_patience_ms) * 1'000'000;

// From a start to its stop.
struct Acquisition {
    std::shared_ptr<AravisStream> stream;
    std::unique_ptr<AravisFrames> frames;
    BufferStarvation starvation;
    uint64_t started_ns = 0;  // of the camera's time; 0 when it cannot be asked
    bool tells_end = false;   // it says itself whether it is acquiring
};

// The acquisition that the camera, its reader and the watchdog share. Not std::atomic<std::shared_ptr>: libstdc++'s load() lets go of it
// by a relaxed store, behind which a processor may read the pointer (bits/shared_ptr_atomic.h of GCC 12).
class RunningAcquisition {
  public:
    std::shared_ptr<Acquisition> get() const {
        const std::lock_guard lock(mutex_);
        return acquisition_;
    }
    // The one before.
    std::shared_ptr<Acquisition> replace(std::shared_ptr<Acquisition> next) {
        const std::lock_guard lock(mutex_);
        return std::exchange(acquisition_, std::move(next));
    }

  private:
    mutable std::mutex mutex_;
    std::shared_ptr<Acquisition> acquisition_;
};

// What the watchdog finds, for whoever asks.
struct Watch {
    RunningAcquisition running;  // of the camera, until it or the watchdog lets go of it
    CameraClock clock;
    std::atomic<uint64_t> life_ns = 0;  // machine time at which the device last gave a sign of life
    std::atomic<bool> is_running = false, tells_end = false, has_ended = false;
};

void look_after(AravisLink& link, Watch& watch) {
    if (link.is_lost()) {
        // Once its frames are read: Aravis goes on asking a USB3 camera that has gone, without a pause.
        if (const auto last = watch.running.get(); last && !last->stream->has_waiting()) watch.running.replace(nullptr);
        return;
    }
    if (!watch.is_running) return;
    if (const auto camera_ns = link.time_ns()) watch.clock.asked(*camera_ns, steady_ns());
    if (watch.tells_end && link.is_acquiring() == false) watch.has_ended = true;
    if (link.answers()) watch.life_ns = steady_ns();
}

class AravisCamera : public Camera {
  public:
    AravisCamera(std::shared_ptr<LibraryThread> library, std::shared_ptr<AravisLink> link, uint32_t index)
        : library_(std::move(library)), link_(std::move(link)), name_(link_->name()), index_(index) {
        library_->set_tick([link = link_, watch = watch_] { look_after(*link, *watch); }, tick_ms);
    }
    ~AravisCamera() override {
        halt();
        library_->set_tick(nullptr, tick_ms);
        if (link_->is_lost()) library_->leave_behind();  // it would be told for seconds that it is let go of
        library_->post([link = std::move(link_)]() mutable { link = nullptr; });
    }

    CameraInfo info() const override {
        const std::lock_guard lock(mutex_);
        return {name_, link_text(), setup_.in_force, std::max<uint64_t>(1, 1'000'000'000 / link_->ticks_hz())};
    }

    Status set_up(const CameraSetup& wanted) override {
        const auto set_up = ask<AravisSetup>(stops_, [link = link_, wanted, name = name_] {
            AravisFeatures features(link->device());
            return set_up_camera(features, name, wanted);
        });
        if (!set_up.ok()) return why_gone().value_or(set_up.error());
        const std::lock_guard lock(mutex_);
        setup_ = *set_up;
        return Done{};
    }

    Result<uint64_t> start() override {
        const uint64_t stops = stops_;
        halt();
        if (const auto gone = why_gone()) return *gone;
        const AravisSetup setup = [this] {
            const std::lock_guard lock(mutex_);
            return setup_;
        }();
        auto begun = ask<std::pair<std::shared_ptr<Acquisition>, std::string>>(
            stops, [link = link_, watch = watch_, library = std::weak_ptr(library_), setup, index = index_] {
                return begin(*link, *watch, library, setup, index);
            });
        if (begun.ok() && stops_ != stops) begun = fail(stopped_text());
        if (!begun.ok()) {
            halt();
            return why_gone().value_or(begun.error());
        }
        const uint64_t started_ns = begun->first->started_ns;
        delivery_.start(started_ns);
        watch_->running.replace(std::move(begun->first));
        const std::lock_guard lock(mutex_);
        chosen_ = std::move(begun->second);
        return started_ns;
    }

    void stop() override {
        ++stops_;
        halt();
    }

    std::optional<Frame> read(int timeout_ms) override {
        const std::shared_ptr<Acquisition> acquisition = running();
        if (!acquisition) return std::nullopt;
        const uint64_t until_ns = steady_ns() + uint64_t(timeout_ms) * 1'000'000;
        // Frames that are not handed on do not prolong the wait, be there ever so many.
        for (;;) {
            const int64_t left_ns = int64_t(until_ns - steady_ns());
            const int wait_ms = int(std::clamp<int64_t>((left_ns + 999'999) / 1'000'000, 0, look_ms));
            ArvBuffer* buffer = acquisition->stream->take(wait_ms);
            if (buffer) {
                auto frame = read_buffer(*acquisition, buffer);
                acquisition->stream->give_back(buffer);
                if (frame) return frame;
            }
            if (steady_ns() >= until_ns || running() != acquisition) return std::nullopt;
            if (!buffer && state().kind != CameraState::live) return std::nullopt;
        }
    }

    uint64_t watermark_ns() const override { return watch_->clock.watermark_ns(steady_ns()); }

    CameraCounts counts() const override {
        CameraCounts counts = delivery_.counts();
        counts.dropped = dropped_;
        counts.underrun = underrun_ + incomplete_;
        return counts;
    }

    CameraState state() const override {
        if (const auto acquisition = running(); acquisition && acquisition->stream->has_waiting()) return {};
        if (link_->is_lost()) return gone("it was unplugged or switched off, or another program has taken it");
        if (watch_->is_running && steady_ns() - watch_->life_ns > life_patience_ns)
            return gone(fmt::format("it gave no sign of life for {} s", device_patience_ms / 1000));
        if (watch_->is_running && watch_->has_ended)
            return {CameraState::ended, name_ + " has ended its acquisition by itself"};
        return {};
    }

  private:
    void halt() {
        watch_->is_running = false;
        // The device is told to stop before its stream goes.
        const std::shared_ptr<Acquisition> ended = watch_->running.replace(nullptr);
        // Also of a start that nobody waits for any more.
        library_->post([link = link_, watch = watch_] {
            watch->is_running = false;
            link->end_acquisition();
        });
    }

    // What `call` returns, or what became of it; it is not waited for when there are more stops than `stops`.
    template <typename Value, typename Call>
    Result<Value> ask(uint64_t stops, Call call) {
        auto answer = library_->run([call = std::move(call)]() mutable { return Result<Value>(call()); },
                                    device_patience_ms, [&] { return stops_ != stops; });
        if (answer) return std::move(*answer);
        if (stops_ != stops) return fail(stopped_text());
        return fail(gone("it gave no answer in " + std::to_string(device_patience_ms / 1000) + " s").why);
    }

    static Result<std::pair<std::shared_ptr<Acquisition>, std::string>> begin(
        AravisLink& link, Watch& watch, const std::weak_ptr<LibraryThread>& library, const AravisSetup& setup,
        uint32_t index) {
        std::string chosen;
        auto stream = link.make_stream(chosen);
        if (!stream.ok()) return stream.error();
        auto acquisition = std::make_shared<Acquisition>();
        // Its end waits for the device, whoever lets go of it last.
        acquisition->stream = {stream->release(), [library](AravisStream* last) {
                                   if (const auto thread = library.lock()) thread->post([last] { delete last; });
                               }};
        acquisition->frames = std::make_unique<AravisFrames>(link, setup, index);
        acquisition->starvation.start(acquisition->stream->free_buffers(), acquisition->stream->unplaced());
        const auto camera_ns = link.time_ns();
        acquisition->started_ns = camera_ns.value_or(0);
        watch.clock.start(camera_ns, steady_ns());
        if (const Status begun = link.begin_acquisition(); !begun.ok()) return begun.error();
        // Believed only where it says that it waits for its first trigger.
        watch.tells_end = link.is_acquiring() == true;
        watch.has_ended = false;
        watch.life_ns = steady_ns();
        watch.is_running = true;
        return std::pair{std::move(acquisition), std::move(chosen)};
    }

    std::shared_ptr<Acquisition> running() const { return watch_->running.get(); }

    std::optional<Frame> read_buffer(Acquisition& acquisition, ArvBuffer* buffer) {
        Frame frame = new_frame();
        acquisition.starvation.take(acquisition.stream->unplaced());
        auto kind = acquisition.frames->read(buffer, frame);
        if (kind == AravisFrames::Kind::whole && acquisition.stream->is_disowned(buffer))
            kind = AravisFrames::Kind::incomplete;
        incomplete_ += kind == AravisFrames::Kind::incomplete;
        if (kind != AravisFrames::Kind::whole) return std::nullopt;
        const uint64_t missing = delivery_.counts().missing_ids;
        if (!delivery_.take(frame.stamp)) return std::nullopt;
        count_dropped(acquisition.starvation, int64_t(delivery_.counts().missing_ids - missing));
        watch_->life_ns = steady_ns();
        if (!acquisition.stream->has_waiting()) watch_->clock.frame_came(frame.stamp.timestamp_ns, steady_ns());
        return frame;
    }

    // Ids that were passed over while packets found no buffer, be it for some of their packets only; other frames that came incomplete
    // are the link's.
    void count_dropped(BufferStarvation& starvation, int64_t gap) {
        const bool is_starved = starvation.explains_gap();
        const uint64_t incomplete = incomplete_.exchange(0);
        if (is_starved && gap > 0)
            dropped_ += uint64_t(gap);
        else
            underrun_ += incomplete;
    }

    std::optional<Error> why_gone() const {
        const CameraState now = state();
        return now.kind == CameraState::gone ? std::optional(fail(now.why)) : std::nullopt;
    }

    std::string stopped_text() const { return name_ + " was stopped while it was started"; }

    CameraState gone(const std::string& how) const {
        return {CameraState::gone, "the camera " + name_ + " is gone: " + how +
                                       "; check its power and cable, and start again (docs/cameras.md)"};
    }

    // With the lock held.
    std::string link_text() const {
        std::string kind = link_->is_gige() ? "GigE Vision" : "USB3 Vision";
        if (setup_.pixel_format.empty()) return kind;
        return fmt::format("{}, {} at {}, {}{}{}{}", kind, setup_.pixel_format, setup_.offset_x, setup_.offset_y,
                           setup_.has_chunk_time ? ", times by chunk data" : "", chosen_.empty() ? "" : ", ", chosen_);
    }

    const std::shared_ptr<LibraryThread> library_;
    std::shared_ptr<AravisLink> link_;
    const std::shared_ptr<Watch> watch_ = std::make_shared<Watch>();
    const std::string name_;
    const uint32_t index_;
    mutable std::mutex mutex_;
    AravisSetup setup_;
    std::string chosen_;
    std::atomic<uint64_t> stops_ = 0, dropped_ = 0, underrun_ = 0;
    std::atomic<uint64_t> incomplete_ = 0;  // since the last whole frame: whose they are shows with the next
    DeliveryCount delivery_;
};

}  // namespace

Result<std::unique_ptr<Camera>> open_aravis_camera(const std::string& name, uint32_t index) {
    auto library = std::make_shared<LibraryThread>();
    auto link = library->run([name] { return AravisLink::open(name); }, Camera::device_patience_ms);
    if (!link) return fail("the camera aravis:" + name + " gives no answer: check its power and cable");
    if (!link->ok()) return link->error();
    return std::unique_ptr<Camera>(std::make_unique<AravisCamera>(std::move(library), std::move(**link), index));
}

}  // namespace ols
