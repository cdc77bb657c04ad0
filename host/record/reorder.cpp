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

// However late: a camera that begins anew counts ids that have come before, or at another time.
bool ReorderWindow::fills_gap(const CameraStamp& stamp) const {
    return std::ranges::any_of(gaps_, [&](const Gap& gap) {
        return gap.epoch == epoch_ && stamp.frame_id > gap.before.frame_id && stamp.frame_id < gap.after.frame_id &&
               stamp.timestamp_ns > gap.before.timestamp_ns && stamp.timestamp_ns < gap.after.timestamp_ns;
    });
}

void ReorderWindow::note_gap(const CameraStamp& stamp) {
    if (any_ && stamp.frame_id <= newest_.frame_id + 1) return;
    // Before the first frame of all lies what its id leaves room for.
    const double room_ns = double(stamp.frame_id + frames_) * period_ns_;
    const CameraStamp first{0, stamp.timestamp_ns - std::min(stamp.timestamp_ns, uint64_t(room_ns))};
    gaps_.push_back({epoch_, any_ ? newest_ : first, stamp});
    if (gaps_.size() > gaps_max) gaps_.pop_front();
}

ReorderWindow::Arrival ReorderWindow::add(FrameWitness frame) {
    if (any_ && frame.stamp.frame_id <= newest_.frame_id && !is_late(frame.stamp)) {
        if (fills_gap(frame.stamp)) return Arrival::too_late;
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
    note_gap(frame.stamp);
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
