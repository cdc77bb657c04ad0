// SPDX-License-Identifier: MIT
// A camera without hardware: frames of a test picture at a rate, or whenever it is triggered by a call, with losses where they
// are asked for. The shortest complete driver, to begin another one from; and what runs where a camera's behaviour matters and
// not its light: none of its frames shows what the lamps did.
#pragma once

#include <condition_variable>
#include <deque>
#include <map>
#include <mutex>

#include "device/camera.hpp"
#include "device/delivery_count.hpp"

namespace ols {

enum class FakeFault {
    lose,      // exposed and counted, never delivered
    underrun,  // the same, and the device says that it had no buffer
    end,       // the recording is over: no frame from this one on
    die,       // the camera fails
};

struct FakeOptions {
    double rate_hz = 0;                                // 0: only by trigger()
    std::map<uint64_t, FakeFault> faults;              // at the n-th exposure, from 0
    std::set<std::string> lacks = {"trigger_source"};  // keys of CameraSetup that it does not have
    size_t room = 64;  // frames that wait to be read; more are dropped, the newest first
};

class FakeCamera : public Camera {
  public:
    explicit FakeCamera(FakeOptions options, uint32_t index = 0);

    CameraInfo info() const override;
    Status set_up(const CameraSetup& wanted) override;
    Result<uint64_t> start() override;
    void stop() override;
    std::optional<Frame> read(int timeout_ms) override;
    uint64_t watermark_ns() const override;
    CameraCounts counts() const override;
    CameraState state() const override;

    // An exposure, whether the camera is started or not, a period of its rate or a millisecond after the last one; or a fault.
    void trigger(std::optional<FakeFault> fault = {});

  private:
    void expose(std::optional<FakeFault> fault);  // with the lock held, as all below
    std::optional<FakeFault> fault_due() const;
    void catch_up(uint64_t now_ns);  // exposes what is due by its rate
    Frame picture(uint64_t id) const;

    const FakeOptions options_;
    const uint32_t index_;
    const uint64_t period_ns_;
    mutable std::mutex mutex_;
    std::condition_variable changed_;
    CameraSetup setup_;
    bool running_ = false;
    uint64_t begin_ns_ = 0;   // of the machine's clock, when the camera was started
    uint64_t clock_ns_;       // the camera's: the next exposure is not before it
    uint64_t exposures_ = 0;  // so far; ids count from 1
    std::deque<Frame> waiting_;
    CameraState state_;
    CameraCounts counts_;
    DeliveryCount delivery_;
};

// "RATE", and after commas faults of exposures: "200,lose@17,underrun@20,die@100". Frames a second; 0 makes none.
Result<std::unique_ptr<Camera>> open_fake_camera(const std::string& text, uint32_t index);

}  // namespace ols
