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
    while (const auto work = work_.pop()) {
        const auto start = std::chrono::steady_clock::now();
        const Status status = guarded("cannot write to the archive", [&] {
            return std::visit([this](const auto& one) { return write(one); }, *work);
        });
        if (!status.ok() && report_.error.empty()) report_.error = status.error().message;
        report_.seconds += std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    }
}

Status TargetWriter::write(const TargetOutcome& outcome) {
    if (!outcome.target) {
        ++report_.missing;
        return archive_.note_missing_target(outcome.camera, outcome.index, outcome.why, outcome.detail);
    }
    const Status written = archive_.write_target(*outcome.target);
    ++(written.ok() ? report_.written : report_.missing);
    if (written.ok()) return written;
    // That it is noted, or will be, is for the archive; what the user must hear of first is the disk.
    (void)archive_.note_missing_target(outcome.camera, outcome.index, written.error().message, outcome.detail);
    return fail(fmt::format("target {}: {}", outcome.index, written.error().message));
}

Status TargetWriter::write(const LostTargets& run) {
    report_.missing += int(run.last - run.first + 1);
    return archive_.note_missing_targets(run.camera, run.first, run.last, run.why);
}

}  // namespace ols
