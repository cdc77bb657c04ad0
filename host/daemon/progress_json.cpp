// SPDX-License-Identifier: MIT
// A monitor's progress into JSON.
#include "daemon/progress_json.hpp"

namespace ols {

using nlohmann::json;

json progress_json(const RunningTake& take) {
    const TakeProgress progress = take.monitor.progress();
    const BoardProgress& board = progress.record.board;
    json cameras = json::array(), outputs = json::array(), stages = json::object();
    for (const CameraProgress& camera : progress.record.cameras)
        cameras.push_back({{"camera", camera.index},
                           {"frames_received", camera.frames_received},
                           {"slots_decided", camera.slots_decided},
                           {"slots_missing", camera.missing.to_json()},
                           {"frames_in_memory", camera.room.frames_in_memory},
                           {"bytes_in_memory", camera.room.bytes_in_memory},
                           {"frames_max", camera.room.frames_max},
                           {"frames_spilled", camera.room.frames_on_disk},
                           {"bytes_spilled", camera.room.bytes_on_disk}});
    for (const OutputProgress& output : progress.outputs)
        outputs.push_back({{"targets_planned", output.targets_planned},
                           {"targets_waiting", output.targets_waiting},
                           {"targets_developed", output.targets_developed},
                           {"targets_written", output.targets_written},
                           {"targets_missing", output.targets_missing},
                           {"seconds_behind", output.seconds_behind()}});
    for (const StageProgress& stage : progress.record.stages) stages[stage.name] = stage.beats;
    return {{"take", take.name},
            {"archive", take.archive},
            {"activity", take.activity},
            {"seconds_planned", take.seconds_planned},
            {"triggers_planned", board.triggers_planned},
            {"triggers_fired", board.triggers_fired},
            {"dark", board.dark_confirmed_ns != 0},
            {"cameras", cameras},
            {"outputs", outputs},
            {"beats", stages}};
}

}  // namespace ols
