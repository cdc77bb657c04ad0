// SPDX-License-Identifier: MIT
// Reports into JSON.
#include "take/take_json.hpp"

#include "record/record_json.hpp"

namespace ols {

namespace {

nlohmann::json to_json(const OutputReport& report, const std::string& archive) {
    return {{"archive", archive},
            {"targets_written", report.targets_written},
            {"targets_missing", report.targets_missing},
            {"write_error", report.write_error},
            {"saturated_share", report.saturated_share},
            {"estimated_share", report.estimated_share},
            {"unsolved_share", report.unsolved_share},
            {"misaligned_share", report.misaligned_share},
            {"suspect_targets", report.suspicion.suspect_targets},
            {"slots_left_out", report.suspicion.slots_left_out},
            {"suspicions", report.suspicion.targets},
            {"suspect_lamps", report.suspicion.lamps},
            {"seconds",
             {{"develop", report.seconds_develop},
              {"flow", report.seconds_motion.flow},
              {"planes", report.seconds_motion.planes},
              {"invert", report.seconds_motion.invert},
              {"matte", report.seconds_motion.matte},
              {"write", report.seconds_write}}}};
}

}  // namespace

nlohmann::json take_json(const TakeReport& report, const std::vector<PlannedArchive>& planned) {
    nlohmann::json json = to_json(report.outputs[0], planned[0].path);
    json.update(record_json(report.record));
    for (size_t n = 0; n < report.record.cameras.size(); ++n)
        if (const auto& clock = report.record.cameras[n].clock) json["cameras"][n]["clock"] = clock_record(*clock);
    json["host_clock"] = report.record.host_clock ? clock_record(*report.record.host_clock) : nlohmann::json();
    json["seconds"]["total"] = report.seconds_total;
    json["memory"] = {{"frames_spilled", report.memory.frames_spilled},
                      {"is_locked", report.memory.is_locked},
                      {"problem", report.memory.problem}};
    for (size_t n = 1; n < planned.size(); ++n) json["also"].push_back(to_json(report.outputs[n], planned[n].path));
    return json;
}

}  // namespace ols
