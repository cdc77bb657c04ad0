// SPDX-License-Identifier: MIT
// Sizes of files that are not there yet.
#include "daemon/disk_forecast.hpp"

#include <algorithm>

#include "image/disk_room.hpp"
#include "take/target_plan.hpp"

namespace ols {

namespace {

// Header, tile offsets and what the journal and the manifest say of a target: some kilobytes for each part.
constexpr uint64_t overhead_bytes = 256 * 1024;

}  // namespace

uint64_t target_bytes_max(const Sequence& sequence, const StageConfig& stage, size_t camera, const TakeTargets& targets,
                          bool single_float) {
    const CameraConfig& config = stage.cameras[camera];
    const uint64_t pixels = uint64_t(config.width) * uint64_t(config.height);
    const uint64_t colours = uint64_t(samples_per_pixel(config.cfa));
    const uint64_t lamps = image_lights(sequence.basis, stage.lamps).size();
    uint64_t bytes_a_pixel = lamps * colours * (single_float ? 4 : 2);
    bytes_a_pixel += 4 + 4 + 4;        // mask, variance, noise gain
    bytes_a_pixel += 2 * colours * 4;  // matte and its variance
    if (targets.every > 0) {
        const auto instants = uint64_t(
            std::ranges::count(sequence.slots, SlotKind::tracking, [](const Slot& slot) { return slot.kind; }));
        bytes_a_pixel += 4 + (instants + 2) * 2 * 2;  // confidence; motion of two halves an instant
    }
    return pixels * bytes_a_pixel + overhead_bytes;
}

Result<DiskForecast> forecast_disk(const std::string& folder, const Sequence& sequence, const StageConfig& stage,
                                   const TakeTargets& targets, bool single_float, uint64_t bytes_reserve) {
    const auto disk = room_of(folder);
    if (!disk) return disk.error();
    DiskForecast forecast{0, disk->free_bytes, bytes_reserve, 0, 0};
    const uint64_t count = plan_targets(sequence, {}, targets).size();
    for (size_t camera = 0; camera < stage.cameras.size(); ++camera)
        forecast.bytes_needed += count * target_bytes_max(sequence, stage, camera, targets, single_float);
    forecast.seconds = double(sequence.config.cycles) * double(sequence.cycle_ticks()) / double(tick_hz);
    const double room = double(disk->free_bytes - std::min(disk->free_bytes, bytes_reserve));
    if (forecast.bytes_needed > 0) forecast.seconds_that_fit = forecast.seconds * room / double(forecast.bytes_needed);
    return forecast;
}

}  // namespace ols
