// SPDX-License-Identifier: MIT
// How far each archive's targets are, and how far behind the recording.
#include "take/take_monitor.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "stage/playback.hpp"

namespace ols {

double OutputProgress::seconds_behind() const {
    return double(ticks_behind) / double(tick_hz);
}

OutputMonitor::OutputMonitor(StageBeats& stages, size_t output, size_t cameras, uint64_t period_ticks)
    : period_ticks_(period_ticks),
      developers_(cameras),
      writer_beat_(stages.add(fmt::format("output {} writer", output))) {
    for (size_t camera = 0; camera < cameras; ++camera)
        developers_[camera].beat = &stages.add(fmt::format("output {} camera {} developer", output, camera));
}

void OutputMonitor::hand_on(size_t camera, uint64_t until_trigger) {
    change([&](OutputProgress& p) {
        ++p.targets_waiting;
        developers_[camera].handed_on_until = until_trigger;
    });
}

void OutputMonitor::develop(size_t camera, uint64_t until_trigger, bool has_target) {
    change([&](OutputProgress& p) {
        --p.targets_waiting;
        p.targets_developed += has_target;
        developers_[camera].developed_until = until_trigger;
    });
}

OutputProgress OutputMonitor::progress() const {
    const std::lock_guard lock(mutex_);
    OutputProgress progress = progress_;
    for (const Developer& one : developers_)
        progress.ticks_behind =
            std::max(progress.ticks_behind, (one.handed_on_until - one.developed_until) * period_ticks_);
    return progress;
}

OutputMonitor& TakeMonitor::add_output(size_t cameras, uint64_t period_ticks) {
    const std::lock_guard lock(mutex_);
    return outputs_.emplace_back(record_.stages(), outputs_.size(), cameras, period_ticks);
}

TakeProgress TakeMonitor::progress() const {
    TakeProgress progress{record_.progress(), {}};
    const std::lock_guard lock(mutex_);
    for (const OutputMonitor& output : outputs_) progress.outputs.push_back(output.progress());
    return progress;
}

}  // namespace ols
