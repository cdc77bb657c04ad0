// SPDX-License-Identifier: MIT
// What became of a take, for people and as JSON.
#include <fmt/format.h>

#include "program.hpp"
#include "stagectl/take_options.hpp"
#include "take/take_json.hpp"

namespace ols {

namespace {

// What the first suspect target and each suspect lamp are suspected of.
void print_suspicion(const SuspicionReport& suspicion, const std::string& folder) {
    if (suspicion.suspect_targets > 0) {
        const nlohmann::json& first = suspicion.targets[0];
        fmt::print(
            stderr,
            "stagectl: {} targets have a slot that does not fit the others (suspect_targets in {}/manifest.json); "
            "target {} of camera {}: {}{}\n",
            suspicion.suspect_targets, folder, first["target"].get<int>(), first["camera"].get<int>(),
            first["says"][0].get<std::string>(),
            first.contains("taken_as_missing") ? ", and was taken as missing" : "");
    }
    if (suspicion.slots_left_out > 0)
        fmt::print(stderr, "stagectl: {} slots left out of their targets ({})\n", suspicion.slots_left_out,
                   cause_words(Cause::swapped));
    for (const auto& [name, lamp] : suspicion.lamps.items())
        fmt::print(stderr,
                   "stagectl: {} gave {:.2f} +- {:.2f} of the light that {}, from target {} on: look at the lamp\n",
                   name, lamp["factor"].get<double>(), lamp["spread"].get<double>(),
                   lamp["since_first_target"].get<bool>() ? "it gave in the first target" : "its neighbours foretell",
                   lamp["first_target"].get<int>());
}

void print_output(const OutputReport& report, const std::string& folder, const TakeOptions& options) {
    if (!options.json)
        fmt::print("{}: {} targets written, {} missing\n", folder, report.targets_written, report.targets_missing);
    if (report.unsolved_share > 0)
        fmt::print(
            stderr,
            "stagectl: {:.2g} % of the pixels have too few samples left, and are 0 and masked: {}--estimate smooth or "
            "nonnegative estimate lost ones{}\n",
            report.unsolved_share * 100,
            options.estimate == "clipped" ? "" : "--estimate clipped counts saturated ones as they were read, ",
            options.estimate == "clipped" ? "" : " too");
    print_suspicion(report.suspicion, folder);
    if (report.misaligned_share > 0)
        fmt::print(stderr,
                   "stagectl: motion compensation failed in up to {:.2g} % of a target's pixels, which are masked\n",
                   report.misaligned_share * 100);
    if (!report.write_error.empty()) fmt::print(stderr, "stagectl: {}\n", report.write_error);
    if (report.targets_missing > 0) fmt::print(stderr, "stagectl: why targets are missing: rf verify {}\n", folder);
}

void print_camera(const CameraReport& camera, const std::string& name) {
    if (!camera.end.empty())
        fmt::print(stderr, "stagectl: {}{} ({})\n", name, camera.end.text, cause_words(camera.end.cause));
    if (camera.missing.total() > 0)
        fmt::print(stderr, "stagectl: {}{} slots missing: {}\n", name, camera.missing.total(),
                   camera.missing.to_words());
    if (camera.stale_buffers > 0)
        fmt::print(stderr,
                   "stagectl: {}{} frames had the samples of an earlier one, bit for bit; their slots are missing: the "
                   "camera's driver or grabber hands out old buffers\n",
                   name, camera.stale_buffers);
    if (!camera.unfit_frame.empty())
        fmt::print(stderr, "stagectl: {}frames came as {}, which is not what the stage says of its camera\n", name,
                   camera.unfit_frame);
}

void print_report(const TakeReport& report, bool is_estimate, const std::vector<PlannedArchive>& planned,
                  const TakeOptions& options) {
    const RecordReport& record = report.record;
    const uint64_t missing = record.missing().total();
    for (size_t n = 0; n < planned.size(); ++n) print_output(report.outputs[n], planned[n].archive.folder(), options);
    if (!options.json)
        fmt::print("{} of {} slots missing; {:.1f} s\n", missing, record.slots_total * record.cameras.size(),
                   report.seconds_total);
    if (!report.memory.problem.empty()) fmt::print(stderr, "stagectl: {}\n", report.memory.problem);
    if (!record.board_end.empty())
        fmt::print(stderr, "stagectl: {} ({})\n", record.board_end.text, cause_words(record.board_end.cause));
    for (const CameraReport& camera : record.cameras)
        print_camera(camera, record.cameras.size() > 1 ? fmt::format("camera {}: ", camera.index) : "");
    if (report.outputs[0].saturated_share > 0)
        fmt::print(stderr,
                   "stagectl: {:.2g} % of the pixels have saturated samples, which are left out where others make up "
                   "for them: shorten the exposure\n",
                   report.outputs[0].saturated_share * 100);
    if (is_estimate)
        fmt::print(stderr,
                   "stagectl: the basis has fewer independent rows than lamps: what was written is an estimate\n");
    if (missing > 0)
        fmt::print(stderr,
                   "stagectl: why slots are missing stands in {}/manifest.json, identification.cameras[].missing\n",
                   planned[0].archive.folder());
}

}  // namespace

Result<int> finish_take(const TakeReport& report, bool is_estimate, const std::vector<PlannedArchive>& planned,
                        const TakeOptions& options, std::optional<LineFile>& account, const nlohmann::json& origin) {
    print_report(report, is_estimate, planned, options);
    if (options.json) {
        nlohmann::json json = take_json(report, planned);
        json.update(origin);
        print_json(json);
    }
    // The take is finished first, whatever became of its account.
    if (account)
        if (const Status told = account->finish(); !told.ok()) return told.error();
    if (!report.memory.problem.empty()) return 1;
    int missing = 0;
    for (const OutputReport& output : report.outputs) {
        if (!output.write_error.empty()) return 1;
        missing += output.targets_missing + output.suspicion.slots_left_out;
    }
    return missing > 0 || report.record.missing().total() > 0 ? 2 : 0;
}

}  // namespace ols
