// SPDX-License-Identifier: MIT
// The fake camera's exposures, by its rate and the machine's clock or by call.
#include "device/fake_camera.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstring>

#include "steady_clock.hpp"

namespace ols {

namespace {

constexpr uint64_t clock_begin_ns = 7'000'000'000;  // the camera's clock counts from its power-up, not from ours
constexpr uint64_t call_period_ns = 1'000'000;      // of exposures by trigger()
constexpr double rate_min_hz = 0.01, rate_max_hz = 100'000;
constexpr double exposure_max = 1e15;  // whole numbers up to it are exact

uint64_t period_of(double rate_hz) {
    return rate_hz > 0 ? uint64_t(std::llround(1e9 / rate_hz)) : call_period_ns;
}

}  // namespace

FakeCamera::FakeCamera(FakeOptions options, uint32_t index)
    : options_(std::move(options)), index_(index), period_ns_(period_of(options_.rate_hz)), clock_ns_(clock_begin_ns) {}

CameraInfo FakeCamera::info() const {
    const std::lock_guard lock(mutex_);
    return {"fake camera",
            options_.rate_hz > 0 ? fmt::format("{} frames/s of a test picture", options_.rate_hz)
                                 : "a test picture for each call",
            setup_, 1};
}

Status FakeCamera::set_up(const CameraSetup& wanted) {
    const std::lock_guard lock(mutex_);
    // As a device does: it takes what it can and keeps what it has, and then says what it took.
    CameraSetup accepted = wanted;
    accepted.controls.clear();  // it has none
    accepted.width = std::clamp(wanted.width, 8, 4096);
    accepted.height = std::clamp(wanted.height, 8, 4096);
    const CameraSetup own;
    if (options_.lacks.contains("trigger_source")) accepted.trigger_source = own.trigger_source;
    if (options_.lacks.contains("trigger_activation")) accepted.trigger_activation = own.trigger_activation;
    if (options_.lacks.contains("trigger_delay_us")) accepted.trigger_delay_us = own.trigger_delay_us;
    if (options_.lacks.contains("exposure_mode")) accepted.exposure_mode = own.exposure_mode;
    setup_ = accepted;
    return check_setup("the fake camera", wanted, accepted, options_.lacks);
}

Result<uint64_t> FakeCamera::start() {
    const std::lock_guard lock(mutex_);
    if (state_.kind != CameraState::live) return fail(state_.why);
    waiting_.clear();
    begin_ns_ = steady_ns();
    running_ = true;
    delivery_.start(clock_ns_);
    return clock_ns_;
}

void FakeCamera::stop() {
    const std::lock_guard lock(mutex_);
    running_ = false;
    waiting_.clear();
    changed_.notify_all();
}

void FakeCamera::trigger(std::optional<FakeFault> fault) {
    const std::lock_guard lock(mutex_);
    expose(fault ? fault : fault_due());
}

std::optional<FakeFault> FakeCamera::fault_due() const {
    const auto fault = options_.faults.find(exposures_);
    return fault == options_.faults.end() ? std::nullopt : std::optional(fault->second);
}

void FakeCamera::expose(std::optional<FakeFault> fault) {
    if (state_.kind != CameraState::live) return;
    changed_.notify_all();
    if (fault == FakeFault::end) {
        state_ = {CameraState::ended, "the fake camera's recording is over"};
        return;
    }
    if (fault == FakeFault::die) {
        state_ = {CameraState::gone, "the fake camera is gone, as it was asked to"};
        waiting_.clear();
        return;
    }
    const CameraStamp stamp{++exposures_, clock_ns_};
    clock_ns_ += period_ns_;
    counts_.underrun += fault == FakeFault::underrun;
    if (fault || !running_) return;
    if (waiting_.size() >= options_.room) {
        ++counts_.dropped;
        return;
    }
    waiting_.push_back(picture(stamp.frame_id));
    waiting_.back().stamp = stamp;
}

void FakeCamera::catch_up(uint64_t now_ns) {
    if (!running_ || options_.rate_hz <= 0) return;
    for (; begin_ns_ + period_ns_ <= now_ns && state_.kind == CameraState::live; begin_ns_ += period_ns_)
        expose(fault_due());
}

std::optional<Frame> FakeCamera::read(int timeout_ms) {
    std::unique_lock lock(mutex_);
    for (const uint64_t until_ns = steady_ns() + uint64_t(timeout_ms) * 1'000'000;;) {
        const uint64_t now_ns = steady_ns();
        catch_up(now_ns);
        if (!waiting_.empty()) break;
        if (now_ns >= until_ns || !running_ || state_.kind != CameraState::live) return std::nullopt;
        const uint64_t due_ns = options_.rate_hz > 0 ? std::min(until_ns, begin_ns_ + period_ns_) : until_ns;
        changed_.wait_for(lock, std::chrono::nanoseconds(due_ns - now_ns));
    }
    Frame frame = std::move(waiting_.front());
    waiting_.pop_front();
    (void)delivery_.take(frame.stamp);
    return frame;
}

uint64_t FakeCamera::watermark_ns() const {
    const std::lock_guard lock(mutex_);
    return clock_ns_;
}

CameraCounts FakeCamera::counts() const {
    const std::lock_guard lock(mutex_);
    CameraCounts counts = delivery_.counts();
    counts.dropped = counts_.dropped;
    counts.underrun = counts_.underrun;
    return counts;
}

CameraState FakeCamera::state() const {
    const std::lock_guard lock(mutex_);
    return waiting_.empty() ? state_ : CameraState{};
}

// Stripes that move by a pixel a frame, so that no two frames in a row are alike.
Frame FakeCamera::picture(uint64_t id) const {
    const int channels = samples_per_pixel(setup_.cfa);
    Frame frame;
    frame.camera = index_;
    frame.width = uint32_t(setup_.width);
    frame.height = uint32_t(setup_.height);
    frame.cfa = setup_.cfa;
    frame.pitch_bytes = uint32_t(setup_.width * channels) * uint32_t(sizeof(uint16_t));
    frame.white = float((1 << setup_.bits) - 1);
    frame.samples.resize(size_t(frame.pitch_bytes) * frame.height);
    auto* sample = reinterpret_cast<uint16_t*>(frame.samples.data());
    const unsigned levels = 1u << setup_.bits;
    for (unsigned y = 0; y < frame.height; ++y)
        for (unsigned x = 0; x < frame.width * unsigned(channels); ++x)
            *sample++ = uint16_t((x / unsigned(channels) + y + id) * (levels / 64) % levels);
    return frame;
}

Result<std::unique_ptr<Camera>> open_fake_camera(const std::string& text, uint32_t index) {
    const auto wrong = [&](const std::string& part) {
        return fail("fake:" + text + ": '" + part +
                    "' is neither frames a second nor a fault: write fake:200, or fake:200,lose@17,underrun@20,die@100 "
                    "(lose, underrun, end or die at that exposure)");
    };
    const std::map<std::string, FakeFault> names = {
        {"lose", FakeFault::lose}, {"underrun", FakeFault::underrun}, {"end", FakeFault::end}, {"die", FakeFault::die}};
    FakeOptions options;
    bool is_first = true;
    for (size_t from = 0; from <= text.size(); is_first = false) {
        const size_t comma = std::min(text.find(',', from), text.size());
        const std::string part = text.substr(from, comma - from);
        from = comma + 1;
        const size_t at = part.find('@');
        const std::string number = is_first ? part : part.substr(at == std::string::npos ? part.size() : at + 1);
        char* end = nullptr;
        const double value = std::strtod(number.c_str(), &end);
        if (number.empty() || *end != 0 || !(value >= 0)) return wrong(part);
        if (is_first) {
            if (value > rate_max_hz || (value > 0 && value < rate_min_hz)) return wrong(part);
            options.rate_hz = value;
            continue;
        }
        const auto name = names.find(part.substr(0, at));
        if (name == names.end() || value != std::floor(value) || value > exposure_max) return wrong(part);
        options.faults[uint64_t(value)] = name->second;
    }
    return std::unique_ptr<Camera>(std::make_unique<FakeCamera>(std::move(options), index));
}

}  // namespace ols
