// SPDX-License-Identifier: MIT
// A camera's device under a test's control: what the conformance suite exposes and breaks.
#pragma once

#include <memory>

#include "device/camera.hpp"

namespace ols::test {

// Waits that are over as soon as the camera does what it must; long ones are for a machine that is busy.
constexpr int soon_ms = 1, surely_ms = 30'000;

// A device, real or modelled, that the test exposes and breaks. One camera is opened on it at a time.
class CameraRig {
  public:
    virtual ~CameraRig() = default;
    virtual std::unique_ptr<Camera> open() = 0;
    virtual CameraSetup fitting_setup() = 0;  // that the device takes

    // Each returns once the device has done it: so many exposures, whose frames go out where somebody wants them; one whose
    // frame never comes; the end of the recording; the device's failure.
    virtual void expose(int count) = 0;
    virtual void lose_one() = 0;
    virtual void end() = 0;
    virtual void die() = 0;
};

}  // namespace ols::test
