// SPDX-License-Identifier: MIT
// Every way in which a target can fail ends in the journal.
#include "take/target_writer.hpp"

#include <fmt/format.h>

#include <chrono>

#include "exceptions.hpp"

namespace ols {

TargetWriter::Report TargetWriter::finish() {
    work_.close();
    if (thread_.joinable()) thread_.join();
    return report_;
}

void TargetWriter::write() {
    StageBeat& beat = monitor_.writer_beat();
    for (;;) {
        beat.beat(StageActivity::waits_for_input);
        const auto work = work_.pop();
        if (!work) break;
        beat.beat();
        const auto start = std::chrono::steady_clock::now();
        const Status status = guarded("cannot write to the archive", [&] {
            return std::visit([this](const auto& one) { return write(one); }, *work);
        });
        if (!status.ok() && report_.error.empty()) {
            report_.error = status.error().message;
            monitor_.fail_to_write(report_.error);
        }
        report_.seconds += std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    }
    beat.beat(StageActivity::ended);
}

void TargetWriter::count_missing(uint32_t targets) {
    report_.missing += int(targets);
    monitor_.miss(targets);
}

Status TargetWriter::write(const TargetOutcome& outcome) {
    if (!outcome.target) {
        count_missing(1);
        return sink_.note_missing_target(outcome.camera, outcome.index, outcome.why, outcome.detail);
    }
    const Status written = sink_.write_target(*outcome.target);
    if (written.ok()) {
        ++report_.written;
        monitor_.write();
        return written;
    }
    count_missing(1);
    // That it is noted, or will be, is for the archive; what the user must hear of first is the disk.
    (void)sink_.note_missing_target(outcome.camera, outcome.index, written.error().message, outcome.detail);
    return fail(fmt::format("target {}: {}", outcome.index, written.error().message));
}

Status TargetWriter::write(const LostTargets& run) {
    count_missing(run.last - run.first + 1);
    return sink_.note_missing_targets(run.camera, run.first, run.last, run.why);
}

}  // namespace ols
