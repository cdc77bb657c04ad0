// SPDX-License-Identifier: MIT
// Camera order from delivery order.
#include "record/reorder.hpp"

#include <algorithm>

namespace ols {

bool ReorderWindow::is_late(const CameraStamp& stamp) const {
    const double id_back = double(newest_.frame_id - stamp.frame_id);
    const double time_back_ns = double(int64_t(newest_.timestamp_ns - stamp.timestamp_ns));
    // Triggers that the camera missed make the time between two ids longer, never shorter.
    return id_back <= double(frames_) && time_back_ns > (id_back - 0.5) * period_ns_ &&
           time_back_ns < (id_back + double(frames_) + 0.5) * period_ns_;
}

ReorderWindow::Arrival ReorderWindow::add(FrameWitness frame) {
    if (any_ && frame.stamp.frame_id <= newest_.frame_id && !is_late(frame.stamp)) {
        ++epoch_;
        newest_ = frame.stamp;
    }
    const Key key{epoch_, frame.stamp.frame_id};
    const auto seen = std::find_if(recent_.begin(), recent_.end(), [&](const auto& r) { return r.first == key; });
    if (seen != recent_.end()) {
        if (seen->second == frame.stamp.timestamp_ns) return Arrival::duplicate;
        ++epoch_;  // the same id at another time: a camera that started again early in its count
        newest_ = frame.stamp;
    } else if (last_taken_ && key <= *last_taken_) {
        return Arrival::too_late;
    }
    if (!any_ || frame.stamp.frame_id > newest_.frame_id) newest_ = frame.stamp;
    any_ = true;
    frame.epoch = epoch_;
    recent_.emplace_back(Key{epoch_, frame.stamp.frame_id}, frame.stamp.timestamp_ns);
    if (recent_.size() > 4 * frames_ + 1) recent_.pop_front();
    waiting_.emplace(Key{epoch_, frame.stamp.frame_id}, std::move(frame));
    return Arrival::in_time;
}

std::optional<FrameWitness> ReorderWindow::take(bool flush) {
    if (waiting_.empty() || (!flush && waiting_.size() <= frames_)) return std::nullopt;
    const auto first = waiting_.begin();
    FrameWitness frame = std::move(first->second);
    last_taken_ = first->first;
    waiting_.erase(first);
    return frame;
}

}  // namespace ols
