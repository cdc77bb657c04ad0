// SPDX-License-Identifier: MIT
// Two cameras on the loopback under a test's control: GigeDevice, and Aravis' own ArvGvFakeCamera.
#pragma once

#include <arv.h>

#include <condition_variable>
#include <mutex>

#include "../unit/camera_rig.hpp"
#include "gige_device.hpp"

namespace ols::test {

// An address of the loopback that no other rig of this process has, and one of another process hardly.
std::string rig_address();

class GigeRig : public CameraRig {
  public:
    explicit GigeRig(GigeOptions options = {});
    std::unique_ptr<Camera> open() override;
    CameraSetup fitting_setup() override;
    void expose(int count) override;
    void lose_one() override { device_->lose_frame(); }
    void end() override { device_->end_acquisition(); }
    void die() override { device_->unplug(); }

    GigeDevice& device() { return *device_; }
    const std::string& address() const { return address_; }

  private:
    std::string address_;
    std::unique_ptr<GigeDevice> device_;
};

// Exposes by its software trigger, since it has no lines; the callback that fills its frames gives them id and time. Ends by its
// register for acquisition, which its description is made to show as AcquisitionStatus.
class ArvFakeRig : public CameraRig {
  public:
    ArvFakeRig();
    ~ArvFakeRig() override;
    std::unique_ptr<Camera> open() override;
    CameraSetup fitting_setup() override;
    void expose(int count) override;
    void lose_one() override;
    void end() override;
    void die() override;

    // The share of packets that it does not send.
    void set_lost_ratio(double ratio) { g_object_set(fake_, "gvsp-lost-ratio", ratio, nullptr); }

  private:
    static void fill(ArvBuffer* buffer, void* rig, guint32 exposure_us, guint32 gain, ArvPixelFormat format);

    std::string address_, description_;
    ArvGvFakeCamera* fake_ = nullptr;
    ArvFakeCamera* registers_ = nullptr;
    std::mutex mutex_;
    std::condition_variable filled_;
    uint64_t fills_ = 0, next_id_ = 1;
};

}  // namespace ols::test
