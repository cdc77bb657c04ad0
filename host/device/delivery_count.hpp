// SPDX-License-Identifier: MIT
// DeliveryCount: what every driver has to know of its frames' stamps: which are from before the start, and which ids never came.
// Counted from the ids themselves, as libraries and devices count gaps for frames or not at all.
#pragma once

#include <atomic>
#include <map>
#include <optional>

#include "device/camera.hpp"

namespace ols {

// take() from the thread that reads; counts() from any.
class DeliveryCount {
  public:
    // The camera was started at this time of its own.
    void start(uint64_t started_ns);

    // Counts a frame; false when it was exposed before the start, so that nobody gets it. Once one of after the start
    // has come all are taken: a camera may set its clock anew.
    bool take(const CameraStamp& stamp);

    // missing_ids and stale; the rest is the driver's.
    CameraCounts counts() const;

  private:
    void count_id(const CameraStamp& stamp);

    uint64_t started_ns_ = 0;
    std::optional<CameraStamp> newest_;
    std::map<uint64_t, uint64_t> gaps_;  // ids that have not come, from the first to below the second
    std::atomic<uint64_t> missing_ids_ = 0, stale_ = 0;
};

}  // namespace ols
