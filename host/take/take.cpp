// SPDX-License-Identifier: MIT
// Recorder, developer and writer put together.
#include "take/take.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <memory>
#include <numeric>

#include "take/camera_developer.hpp"
#include "take/provenance.hpp"
#include "take/target_writer.hpp"

namespace ols {

namespace {

// Cycles whose frames developing holds besides the one being developed and the one being gathered (RecordSink): those of the
// output that needs most, since all hold the same frames.
size_t cycles_kept(const TakeMasks& masks, const std::vector<TakeOutput>& outputs) {
    const bool has_performance =
        std::ranges::any_of(outputs, [](const TakeOutput& output) { return output.targets.every > 0; });
    if (has_performance) return 3;
    return masks.fill_from_neighbours ? 2 : 0;
}

// An archive that is being made of the recording.
class Output {
  public:
    Output(const TakeDescription& take, const TakeOutput& output)
        : archive_(output.archive),
          targets_(output.targets),
          writer_(output.archive),
          developer_(take, targets_, 0, writer_) {}

    Status begin() { return archive_.expect_targets(0, uint32_t(developer_.target_count())); }
    void take_place() { writer_.take_place(); }
    CameraDeveloper& developer() { return developer_; }

    // Waits until everything is developed and written.
    OutputReport wait() {
        const CameraDeveloper::Report developed = developer_.finish();
        const TargetWriter::Report written = writer_.finish();
        return {written.written,           written.missing,
                developed.saturated_share, developed.estimated_share,
                developed.unsolved_share,  developed.misaligned_share,
                developed.seconds,         written.seconds,
                developed.seconds_motion,  written.error,
                developed.suspicion};
    }

    Status finish(const TakeDescription& take, const Board& board, const RecordReport& record) {
        archive_.add_to_manifest(
            describe_take(take, targets_, board, record, developer_.missing_json(), developer_.finish().suspicion));
        return archive_.finish();
    }

  private:
    ArchiveWriter& archive_;
    const TakeTargets targets_;
    TargetWriter writer_;
    CameraDeveloper developer_;
};

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
    std::vector<std::unique_ptr<Output>> outputs;
    for (const TakeOutput& output : sinks.outputs) outputs.push_back(std::make_unique<Output>(take, output));
    for (const auto& output : outputs)
        if (const auto begun = output->begin(); !begun) return begun.error();
    bool has_frame = false;
    const RecordSink sink{[&](const std::shared_ptr<const Frame>& frame) {
                              if (!std::exchange(has_frame, true))
                                  for (const auto& output : outputs) output->take_place();
                              sinks.identified(*frame);
                              for (const auto& output : outputs) output->developer().add_frame(frame);
                          },
                          [&](const MissingSlot& slot) {
                              for (const auto& output : outputs) output->developer().add_missing(slot);
                          },
                          [&](uint64_t decided, uint64_t total) {
                              for (const auto& output : outputs) output->developer().hand_on(decided);
                              sinks.progress(decided, total);
                          },
                          cycles_kept(take.masks, sinks.outputs)};
    TakeReport report;
    const auto record = record_take(devices.board, *devices.cameras[0], take.sequence, take.stage,
                                    measured_black(take.calibration), sink, stop);
    for (const auto& output : outputs) report.outputs.push_back(output->wait());
    if (!record.ok()) return record.error();
    if (!has_frame) return nothing_came(*record);
    report.record = *record;
    for (size_t n = 0; n < outputs.size(); ++n) {
        const Status finished = outputs[n]->finish(take, devices.board, *record);
        if (!finished.ok() && report.outputs[n].write_error.empty())
            report.outputs[n].write_error = finished.error().message;
    }
    report.seconds_total = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    return report;
}

}  // namespace ols
