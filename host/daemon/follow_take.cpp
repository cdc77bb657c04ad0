// SPDX-License-Identifier: MIT
// The conductor's look at what runs: progress, the dark, the disk, and whether every stage of the pipeline advances.
#include <fmt/format.h>

#include "daemon/conductor.hpp"
#include "daemon/progress_json.hpp"
#include "image/bytes_text.hpp"
#include "image/disk_room.hpp"

namespace ols {

namespace {

constexpr std::chrono::milliseconds progress_pause(500), missing_pause(2000);

}  // namespace

std::string Conductor::follow(std::chrono::seconds stuck_after) {
    const auto take = snapshot().take;
    if (take != followed_.take) followed_ = {take, 0, {}, {}, {}};
    if (!take) return "";
    const auto now = Clock::now();
    const TakeProgress progress = take->monitor.progress();
    tell_dark(*take);
    tell_progress(progress, now);
    watch_disk(progress);
    return followed_.stages.look(progress.record.stages, now, stuck_after);
}

// The state changes with the board's word, so that nobody steps to the stage by a guess.
// Once; also by the take's own thread when it has ended, as a short take is over between two looks.
void Conductor::tell_dark(const RunningTake& take) {
    const BoardProgress board = take.monitor.progress().record.board;
    if (board.dark_confirmed_ns == 0 || take.dark_is_told.exchange(true)) return;
    const double after_ms = board.stop_told_ns ? double(board.dark_confirmed_ns - board.stop_told_ns) * 1e-6 : 0;
    events_.add(EventKind::dark,
                board.stop_told_ns
                    ? fmt::format("the board says that it is dark, {:.1f} ms after it was told", after_ms)
                    : "the board says that it is dark: it has played to the end",
                board.stop_told_ns ? nlohmann::json{{"after_ms", after_ms}} : nlohmann::json::object());
    change_state(DaemonState::processing, "", DaemonState::recording);
}

void Conductor::tell_progress(const TakeProgress& progress, Clock::time_point now) {
    if (now < followed_.next_progress) return;
    followed_.next_progress = now + progress_pause;
    events_.add(EventKind::take_progress, followed_.take->name, progress_json(*followed_.take));
    CauseCounts missing;
    for (const CameraProgress& camera : progress.record.cameras) missing.add(camera.missing);
    if (missing.total() == followed_.missing || now < followed_.next_missing) return;
    followed_.missing = missing.total();
    followed_.next_missing = now + missing_pause;
    events_.add(EventKind::slots_missing,
                fmt::format("{} slots missing so far: {}", missing.total(), missing.to_words()),
                {{"missing", missing.to_json()}});
}

// What is recorded and not written yet needs its room, too. There is no light for targets that cannot be written.
void Conductor::watch_disk(const TakeProgress& progress) {
    if (followed_.take->dark_is_told || followed_.take->target_bytes == 0) return;
    const auto end_by_failure = [this](const std::string& why) {
        end_take(EventKind::disk_failed, "the take ends here, as its disk fails: " + why);
    };
    const StageConfig stage = this->stage();
    uint64_t waiting = 0;  // targets, of all cameras and outputs
    for (const OutputProgress& output : progress.outputs) {
        if (!output.write_error.empty()) return end_by_failure(output.write_error);
        waiting += output.targets_waiting + 2 * stage.cameras.size();
    }
    const auto disk = room_of(stage.daemon.takes);
    if (!disk) return end_by_failure(disk.error().message);
    const uint64_t reserve = uint64_t(stage.daemon.reserve_mb) * 1'000'000;
    if (disk->free_bytes > reserve + waiting * followed_.take->target_bytes) return;
    end_take(
        EventKind::disk_full,
        fmt::format("the disk of '{}' has {} left and {} are kept: the take ends here, and what it has is finished",
                    stage.daemon.takes, bytes_text(double(disk->free_bytes)), bytes_text(double(reserve))));
}

}  // namespace ols
