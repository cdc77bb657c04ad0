// SPDX-License-Identifier: MIT
// Recorder, developer and writer put together.
#include "take/take.hpp"

#include <fmt/format.h>

#include <chrono>
#include <numeric>

#include "take/camera_developer.hpp"
#include "take/provenance.hpp"
#include "take/target_writer.hpp"

namespace ols {

namespace {

// Cycles whose frames developing holds besides the one being developed and the one being gathered (RecordSink).
size_t cycles_kept(const TakeDescription& take) {
    if (take.targets.every > 0) return 3;
    return take.masks.fill_from_neighbours ? 2 : 0;
}

TakeReport merged(const RecordReport& record, const CameraDeveloper::Report& developed,
                  const TargetWriter::Report& written) {
    TakeReport report;
    report.record = record;
    report.targets_written = written.written;
    report.targets_missing = written.missing;
    report.write_error = written.error;
    report.seconds_write = written.seconds;
    report.saturated_share = developed.saturated_share;
    report.estimated_share = developed.estimated_share;
    report.unsolved_share = developed.unsolved_share;
    report.misaligned_share = developed.misaligned_share;
    report.seconds_develop = developed.seconds;
    report.seconds_motion = developed.seconds_motion;
    return report;
}

// Why a take has not one frame; nothing is kept of it.
Error nothing_came(const RecordReport& record) {
    std::string why = "not one frame has its slot, and nothing is kept of the take";
    for (const std::string& end : {record.camera_end, record.board_end})
        if (!end.empty()) why += ": " + end;
    if (!record.unfit_frame.empty())
        why += fmt::format(": frames came as {}, which is not what the stage says of its camera", record.unfit_frame);
    else if (record.frames > 0)
        why += fmt::format(": {} frames came, and none fits the board's triggers", record.frames);
    else if (record.board_end.empty() && record.camera_end.empty())
        why += ": no frame came; check the camera, its trigger cable and that its source is this one";
    return fail(why);
}

}  // namespace

std::optional<double> measured_black(const Calibration& calibration) {
    if (calibration.source == "nominal") return std::nullopt;
    const auto& black = calibration.cameras[0].black.data;
    return std::accumulate(black.begin(), black.end(), 0.0) / double(black.size());
}

Result<TakeReport> run_take(const TakeDescription& take, const TakeDevices& devices, const TakeSinks& sinks,
                            const std::atomic<bool>& stop) {
    if (devices.cameras.size() != 1 || take.stage.cameras.size() != 1)
        return fail(
            fmt::format("a take is recorded from one camera, and there are {}: keep one [[camera]] in the stage",
                        take.stage.cameras.size()));
    const auto start = std::chrono::steady_clock::now();
    TargetWriter writer(sinks.archive);
    CameraDeveloper developer(take, 0, writer);
    if (const auto told = sinks.archive.expect_targets(0, uint32_t(developer.target_count())); !told)
        return told.error();
    bool has_frame = false;
    const RecordSink sink{[&](std::shared_ptr<const Frame> frame) {
                              if (!std::exchange(has_frame, true)) writer.take_place();
                              sinks.identified(*frame);
                              developer.add_frame(std::move(frame));
                          },
                          [&](const MissingSlot& slot) { developer.add_missing(slot); },
                          [&](uint64_t decided, uint64_t total) {
                              developer.hand_on(decided);
                              sinks.progress(decided, total);
                          },
                          cycles_kept(take)};
    const auto record = record_take(devices.board, *devices.cameras[0], take.sequence, take.stage,
                                    measured_black(take.calibration), sink, stop);
    const auto developed = developer.finish();
    TakeReport report = merged(record.ok() ? *record : RecordReport{}, developed, writer.finish());
    if (!record.ok()) return record.error();
    if (!has_frame) return nothing_came(*record);
    sinks.archive.add_to_manifest(describe_take(take, devices.board, *record, developer.missing_json()));
    const Status finished = sinks.archive.finish();
    if (!finished.ok() && report.write_error.empty()) report.write_error = finished.error().message;
    report.seconds_total = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    return report;
}

}  // namespace ols
