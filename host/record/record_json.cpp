// SPDX-License-Identifier: MIT
// Recording, cameras and counts as JSON.
#include "record/record_json.hpp"

namespace ols {

namespace {

nlohmann::json end_json(const Reason& end) {
    if (end.empty()) return nullptr;
    return {{"cause", cause_name(end.cause)}, {"why", end.text}};
}

nlohmann::json camera_json(const CameraReport& report) {
    return {{"name", report.camera.name},
            {"link", report.camera.link},
            {"frames", report.frames},
            {"frames_discarded", report.frames_discarded},
            {"missing_ids", report.counts.missing_ids},
            {"dropped", report.counts.dropped},
            {"underrun", report.counts.underrun},
            {"stale", report.counts.stale},
            {"duplicates", report.duplicates},
            {"restarts", report.restarts},
            {"stale_buffers", report.stale_buffers},
            {"frames_without_noise", report.frames_without_noise},
            {"unfit_frame", report.unfit_frame},
            {"slots_missing", report.missing.total()},
            {"causes", report.missing.to_json()},
            {"end", end_json(report.end)}};
}

}  // namespace

nlohmann::json record_json(const RecordReport& report) {
    const CauseCounts missing = report.missing();
    auto cameras = nlohmann::json::array();
    for (const CameraReport& camera : report.cameras) cameras.push_back(camera_json(camera));
    return {{"slots_total", report.slots_total},
            {"slots_missing", missing.total()},
            {"causes", missing.to_json()},
            {"board_end", end_json(report.board_end)},
            {"cameras", std::move(cameras)}};
}

}  // namespace ols
