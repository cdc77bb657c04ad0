// SPDX-License-Identifier: MIT
// So many frames a camera, and how many there must be.
#include "take/frame_rooms.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "take/target_plan.hpp"

namespace ols {

namespace {

// Cycles whose frames developing holds besides the one being developed and the one being gathered: those of the output that needs
// most, since all hold the same frames.
size_t cycles_kept(const TakeMasks& masks, const std::vector<TakeOutput>& outputs) {
    const bool has_performance =
        std::ranges::any_of(outputs, [](const TakeOutput& output) { return output.targets.every > 0; });
    if (has_performance) return 3;
    return masks.fill_from_neighbours ? 2 : 0;
}

// Frames that developers bring back from the disk at once: each those of one target.
size_t frames_brought_back(const TakeDescription& take, const std::vector<TakeOutput>& outputs) {
    if (take.memory.spill_folder.empty()) return 0;
    uint64_t sum = 0;
    for (const TakeOutput& output : outputs) {
        uint64_t most = 0;
        for (const PlannedTarget& target : plan_targets(take.sequence, take.masks, output.targets))
            most = std::max(most, target.frames.last - target.frames.first + 1);
        sum += most;
    }
    return size_t(sum);
}

}  // namespace

MemoryReport FrameRooms::report() const {
    MemoryReport report;
    report.is_locked = true;
    for (const auto& room : of_camera) {
        report.frames_spilled += room->use().frames_spilled;
        report.is_locked = report.is_locked && room->use().is_locked;
    }
    if (spill) report.problem = spill->problem();
    return report;
}

size_t frames_held(const TakeDescription& take, const std::vector<TakeOutput>& outputs) {
    return frames_in_flight(take.sequence, cycles_kept(take.masks, outputs)) + frames_brought_back(take, outputs);
}

Result<FrameRooms> make_frame_rooms(const TakeDescription& take, const std::vector<TakeOutput>& outputs) {
    const TakeMemory& memory = take.memory;
    FrameRooms rooms;
    if (!memory.spill_folder.empty()) {
        auto spill = SpillFile::create(memory.spill_folder, memory.spill_bytes);
        if (!spill.ok()) return spill.error();
        rooms.spill = *spill;
    }
    FrameRoom::Options options;
    options.spill = rooms.spill;
    options.reserve = frames_brought_back(take, outputs);
    options.period = std::chrono::nanoseconds(take.sequence.slots.front().period_ticks * 1'000'000'000ull / tick_hz);
    const size_t least = frames_held(take, outputs);
    options.frames_max = least;
    if (memory.ram_bytes > 0) {
        uint64_t bytes = 0;  // of a frame of each camera
        for (const CameraConfig& camera : take.stage.cameras) bytes += FrameRoom::bytes_a_frame(camera.frame_bytes());
        const uint64_t frames = memory.ram_bytes / bytes;
        if (frames < least)
            return fail(
                fmt::format("{} MB of memory for frames hold {} of each camera, and this take needs {} at once: "
                            "give {} or more (--memory-mb, or [daemon] memory_mb)",
                            memory.ram_bytes / 1'000'000, frames, least, least * bytes / 1'000'000 + 1));
        // More than the take has are not needed.
        options.frames_max = size_t(std::clamp<uint64_t>(frames, least, take.sequence.trigger_count() + least));
    }
    for (const CameraConfig& camera : take.stage.cameras) {
        options.frame_bytes = camera.frame_bytes();
        auto room = FrameRoom::create(options);
        if (!room.ok()) return room.error();
        rooms.of_camera.push_back(std::move(*room));
    }
    return rooms;
}

}  // namespace ols
