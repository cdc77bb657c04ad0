// SPDX-License-Identifier: MIT
// Gaps between ids, filled by frames that come late.
#include "device/delivery_count.hpp"

#include <iterator>

namespace ols {

namespace {

constexpr size_t gaps_max = 256;  // that a late frame may still fill; older ones stay counted

}  // namespace

void DeliveryCount::start(uint64_t started_ns) {
    started_ns_ = started_ns;
    newest_.reset();
    gaps_.clear();
}

bool DeliveryCount::take(const CameraStamp& stamp) {
    if (!newest_ && stamp.timestamp_ns < started_ns_) {
        ++stale_;
        return false;
    }
    count_id(stamp);
    return true;
}

void DeliveryCount::count_id(const CameraStamp& stamp) {
    const uint64_t id = stamp.frame_id;
    if (!newest_ || id > newest_->frame_id) {
        if (newest_ && id > newest_->frame_id + 1) {
            gaps_[newest_->frame_id + 1] = id;
            missing_ids_ += id - newest_->frame_id - 1;
            if (gaps_.size() > gaps_max) gaps_.erase(gaps_.begin());
        }
        newest_ = stamp;
        return;
    }
    const auto after = gaps_.upper_bound(id);
    if (after == gaps_.begin() || std::prev(after)->second <= id) {
        // A duplicate, or a count that began anew: that one has a later time.
        if (stamp.timestamp_ns > newest_->timestamp_ns) newest_ = stamp, gaps_.clear();
        return;
    }
    const auto gap = std::prev(after);
    const auto [first, end] = *gap;
    gaps_.erase(gap);
    if (first < id) gaps_[first] = id;
    if (id + 1 < end) gaps_[id + 1] = end;
    --missing_ids_;
}

CameraCounts DeliveryCount::counts() const {
    CameraCounts counts;
    counts.missing_ids = missing_ids_;
    counts.stale = stale_;
    return counts;
}

}  // namespace ols
