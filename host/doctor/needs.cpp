// SPDX-License-Identifier: MIT
// From the stage's cameras and the sequence's triggers.
#include "doctor/needs.hpp"

#include <algorithm>
#include <numeric>

namespace ols {

namespace {

uint64_t triggers_a_cycle(const Sequence& sequence, int line) {
    return uint64_t(
        std::ranges::count_if(sequence.slots, [line](const Slot& slot) { return slot.trigger_mask >> line & 1; }));
}

CameraNeeds needs_of(const CameraConfig& camera, const Sequence& sequence) {
    const double cycle_s = double(sequence.cycle_ticks()) / double(tick_hz);
    CameraNeeds needs;
    needs.frames_per_s = double(triggers_a_cycle(sequence, camera.trigger)) / cycle_s;
    needs.frame_bytes = camera.frame_bytes();
    needs.link_frame_bytes = camera.frame_bytes() / sizeof(uint16_t) * size_t((camera.bits + 7) / 8);
    return needs;
}

}  // namespace

double StageNeeds::raw_bytes_per_s() const {
    return std::accumulate(cameras.begin(), cameras.end(), 0.0,
                           [](double sum, const CameraNeeds& camera) { return sum + camera.raw_bytes_per_s(); });
}

double StageNeeds::archive_bytes_per_s() const {
    return std::accumulate(cameras.begin(), cameras.end(), 0.0, [this](double sum, const CameraNeeds& camera) {
        return sum + targets_per_s * double(camera.target_bytes);
    });
}

double StageNeeds::held_bytes() const {
    return std::accumulate(cameras.begin(), cameras.end(), 0.0, [this](double sum, const CameraNeeds& camera) {
        return sum + double(frames_held) * double(camera.frame_bytes);
    });
}

StageNeeds needs_of(const StageConfig& stage, const Sequence& sequence, double take_s, double target_rate_hz,
                    const std::vector<uint64_t>& target_bytes) {
    StageNeeds needs;
    needs.targets_per_s = target_rate_hz > 0 ? target_rate_hz : double(tick_hz) / double(sequence.cycle_ticks());
    needs.take_s = take_s;
    for (size_t camera = 0; camera < stage.cameras.size(); ++camera) {
        needs.cameras.push_back(needs_of(stage.cameras[camera], sequence));
        if (sequence.is_capture()) needs.cameras.back().target_bytes = target_bytes[camera];
    }
    return needs;
}

}  // namespace ols
