// SPDX-License-Identifier: MIT
// Recorder, developer and writer put together.
#include "take/take.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <deque>
#include <map>
#include <memory>
#include <mutex>
#include <numeric>

#include "image/freed_planes.hpp"
#include "take/camera_developer.hpp"
#include "take/frame_rooms.hpp"
#include "take/provenance.hpp"
#include "take/target_writer.hpp"

namespace ols {

namespace {

// An archive that is being made of the recording: each camera's frames are developed beside the others', and one writes.
class Output {
  public:
    Output(const TakeDescription& take, const TakeOutput& output, const FrameRooms& rooms, TakeMonitor& monitor)
        : sink_(output.sink),
          targets_(output.targets),
          monitor_(monitor.add_output(take.stage.cameras.size(), take.sequence.slots.front().period_ticks)),
          writer_(*sink_, monitor_) {
        for (uint32_t camera = 0; camera < take.stage.cameras.size(); ++camera) {
            developers_.emplace_back(take, targets_, camera, writer_, monitor_, rooms.room_of(camera));
            monitor_.plan(developers_.back().target_count());
        }
    }

    Status begin() {
        for (uint32_t camera = 0; camera < developers_.size(); ++camera)
            if (const Status expected = sink_->expect_targets(camera, uint32_t(developers_[camera].target_count()));
                !expected.ok())
                return expected;
        return Done{};
    }
    void take_place() { writer_.take_place(); }
    CameraDeveloper& developer(size_t camera) { return developers_[camera]; }
    bool waits_for_disk() const { return writer_.is_awaited(); }

    // Waits until everything is developed and written.
    OutputReport wait() {
        OutputReport report;
        for (CameraDeveloper& developer : developers_) {
            const CameraDeveloper::Report developed = developer.finish();
            report.saturated_share = std::max(report.saturated_share, developed.saturated_share);
            report.estimated_share = std::max(report.estimated_share, developed.estimated_share);
            report.unsolved_share = std::max(report.unsolved_share, developed.unsolved_share);
            report.misaligned_share = std::max(report.misaligned_share, developed.misaligned_share);
            report.suspicion.add(developed.suspicion);
            report.seconds_develop += developed.seconds;
            report.seconds_motion.flow += developed.seconds_motion.flow;
            report.seconds_motion.planes += developed.seconds_motion.planes;
            report.seconds_motion.invert += developed.seconds_motion.invert;
            report.seconds_motion.matte += developed.seconds_motion.matte;
        }
        const TargetWriter::Report written = writer_.finish();
        report.targets_written = written.written;
        report.targets_missing = written.missing;
        report.seconds_write = written.seconds;
        report.write_error = written.error;
        return report;
    }

    Status finish(const TakeDescription& take, const nlohmann::json& origin, const RecordReport& record,
                  const nlohmann::json& account) {
        std::vector<nlohmann::json> missing;
        SuspicionReport suspicion;
        for (CameraDeveloper& developer : developers_) {
            missing.push_back(developer.missing_json());
            suspicion.add(developer.finish().suspicion);
        }
        sink_->add_to_manifest(describe_take(take, targets_, origin, record, missing, suspicion));
        sink_->add_to_manifest(account);
        return sink_->finish();
    }

  private:
    const std::shared_ptr<TargetSink> sink_;
    const TakeTargets targets_;
    OutputMonitor& monitor_;
    TargetWriter writer_;
    std::deque<CameraDeveloper> developers_;  // of the stage's cameras
};

// What one camera's frames become, in every output.
RecordSink sink_of(size_t camera, const std::vector<std::unique_ptr<Output>>& outputs, const FrameRooms& rooms,
                   std::function<void(const Frame&)> identified,
                   std::function<void(uint64_t decided, uint64_t total)> progress) {
    return {[=, &outputs](const std::shared_ptr<const Frame>& frame) {
                identified(*frame);
                for (const auto& output : outputs) output->developer(camera).add_frame(frame);
            },
            [=, &outputs](const MissingSlot& slot) {
                for (const auto& output : outputs) output->developer(camera).add_missing(slot);
            },
            [=, &outputs](uint64_t decided, uint64_t total) {
                for (const auto& output : outputs) output->developer(camera).hand_on(decided);
                progress(decided, total);
            },
            rooms.room_of(camera),
            [&outputs] {
                return std::ranges::any_of(outputs, [](const auto& output) { return output->waits_for_disk(); });
            }};
}

// Why a take has not one frame; nothing is kept of it.
Error nothing_came(const RecordReport& record) {
    std::string why = "not one frame has its slot, and nothing is kept of the take";
    if (!record.board_end.empty()) why += ": " + record.board_end.text;
    for (const CameraReport& camera : record.cameras) {
        if (record.cameras.size() > 1) why += fmt::format("; camera {}", camera.index);
        if (!camera.end.empty()) why += ": " + camera.end.text;
        if (!camera.unfit_frame.empty())
            why +=
                fmt::format(": frames came as {}, which is not what the stage says of its camera", camera.unfit_frame);
        else if (camera.discarded.of(Cause::no_light) > 0)
            why +=
                fmt::format(": {} frames came, and none shows any light: check the lamps' supply, the lens and its cap",
                            camera.frames);
        else if (camera.frames > 0)
            why += fmt::format(": {} frames came, and none fits the board's triggers", camera.frames);
        else if (record.board_end.empty() && camera.end.empty())
            why += ": no frame came; check the camera, its trigger cable and that its source is this one";
    }
    return fail(why);
}

}  // namespace

void SuspicionReport::add(const SuspicionReport& other) {
    suspect_targets += other.suspect_targets;
    slots_left_out += other.slots_left_out;
    for (const nlohmann::json& target : other.targets)
        if (targets.size() < targets_max) targets.push_back(target);
    for (const auto& [name, lamp] : other.lamps.items())
        if (!lamps.contains(name)) lamps[name] = lamp;
}

std::optional<double> measured_black(const Calibration& calibration, size_t camera) {
    if (calibration.source == "nominal") return std::nullopt;
    const auto& black = calibration.cameras[camera].black.data;
    return std::accumulate(black.begin(), black.end(), 0.0) / double(black.size());
}

namespace {

// Before the light: of each output and camera the planes of the target that is developed and of the one that is written.
void prepare_target_planes(const TakeDescription& take, size_t outputs) {
    std::map<size_t, size_t> planes;  // how many of so many bytes
    for (const CameraConfig& camera : take.stage.cameras)
        planes[size_t(camera.width) * size_t(camera.height) * sizeof(float)] +=
            2 * outputs * size_t(take.sequence.basis.images()) * size_t(samples_per_pixel(camera.cfa));
    for (const auto& [bytes, count] : planes) prepare_planes(bytes, count);
}

// `record_into` records into the cameras' sinks, from whatever the take comes.
template <typename Record>
Result<TakeReport> develop_take(const TakeDescription& take, const nlohmann::json& origin, const TakeSinks& sinks,
                                TakeMonitor& monitor, const FrameRooms& rooms, const Record& record_into) {
    const size_t cameras = take.stage.cameras.size();
    const auto start = std::chrono::steady_clock::now();
    std::vector<std::unique_ptr<Output>> outputs;
    for (const TakeOutput& output : sinks.outputs)
        outputs.push_back(std::make_unique<Output>(take, output, rooms, monitor));
    for (const auto& output : outputs)
        if (const auto begun = output->begin(); !begun) return begun.error();

    std::mutex mutex;  // of what the cameras' threads share
    bool has_frame = false;
    std::vector<uint64_t> decided(cameras, 0);
    const auto identified = [&](const Frame& frame) {
        const std::lock_guard lock(mutex);
        if (!std::exchange(has_frame, true))
            for (const auto& output : outputs) output->take_place();
        sinks.identified(frame);
    };
    std::vector<RecordSink> camera_sinks;
    for (size_t camera = 0; camera < cameras; ++camera) {
        const auto progress = [&, camera](uint64_t done, uint64_t total) {
            const std::lock_guard lock(mutex);
            decided[camera] = done;
            sinks.progress(*std::ranges::min_element(decided), total);
        };
        camera_sinks.push_back(sink_of(camera, outputs, rooms, identified, progress));
    }
    TakeReport report;
    const Result<RecordReport> record = record_into(camera_sinks);
    auto account = sinks.account ? sinks.account() : nlohmann::json::object();
    for (const auto& output : outputs) report.outputs.push_back(output->wait());
    if (!record.ok()) return record.error();
    if (!has_frame) return nothing_came(*record);
    report.record = *record;
    report.memory = rooms.report();
    if (!report.memory.problem.empty()) account["memory"] = {{"problem", report.memory.problem}};
    for (size_t n = 0; n < outputs.size(); ++n) {
        const Status finished = outputs[n]->finish(take, origin, *record, account);
        if (!finished.ok() && report.outputs[n].write_error.empty())
            report.outputs[n].write_error = finished.error().message;
    }
    report.seconds_total = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    return report;
}

}  // namespace

Result<TakeReport> run_take(const TakeDescription& take, const TakeDevices& devices, const TakeSinks& sinks,
                            const StopRequest& stop) {
    const size_t cameras = devices.cameras.size();
    if (cameras == 0 || cameras != take.stage.cameras.size())
        return fail(
            fmt::format("the stage has {} cameras, and {} are there: a take needs them all, or a stage without "
                        "the others' [[camera]]",
                        take.stage.cameras.size(), cameras));
    TakeMonitor own_monitor;
    TakeMonitor& monitor = sinks.monitor ? *sinks.monitor : own_monitor;
    const auto rooms = make_frame_rooms(take, sinks.outputs);
    if (!rooms.ok()) return rooms.error();
    prepare_target_planes(take, sinks.outputs.size());
    return develop_take(take, origin_of(devices.board), sinks, monitor, *rooms,
                        [&](const std::vector<RecordSink>& camera_sinks) {
                            std::vector<RecordedCamera> recorded;
                            for (size_t camera = 0; camera < cameras; ++camera)
                                recorded.push_back({*devices.cameras[camera], uint32_t(camera),
                                                    measured_black(take.calibration, camera), camera_sinks[camera]});
                            return record_take(devices.board, recorded, take.sequence, take.stage, stop,
                                               &monitor.record(), devices.is_armed);
                        });
}

Result<TakeReport> ingest_take(const TakeDescription& take, const RecordedFrames& frames, const RecordingPlace& place,
                               const TakeSinks& sinks, const std::atomic<bool>& stop) {
    TakeMonitor own_monitor;
    return develop_take(take, origin_of(frames, place, take.sequence), sinks,
                        sinks.monitor ? *sinks.monitor : own_monitor, {},
                        [&](const std::vector<RecordSink>& camera_sinks) {
                            return record_files(frames, place, take.sequence, take.stage.cameras[0],
                                                measured_black(take.calibration, 0), camera_sinks[0], stop);
                        });
}

}  // namespace ols
