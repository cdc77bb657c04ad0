// SPDX-License-Identifier: MIT
// One snapshot of accounts that are kept in several places.
#include "record/record_monitor.hpp"

namespace ols {

void RecordMonitor::add_camera(uint32_t index, std::shared_ptr<const FrameRoom> room) {
    const std::lock_guard lock(mutex_);
    progress_.cameras.emplace_back().index = index;
    rooms_.push_back(std::move(room));
}

RecordProgress RecordMonitor::progress() const {
    RecordProgress progress;
    {
        const std::lock_guard lock(mutex_);
        progress = progress_;
        for (size_t i = 0; i < rooms_.size(); ++i) progress.cameras[i].room = rooms_[i]->use();
    }
    progress.stages = stages_.progress();
    return progress;
}

}  // namespace ols
