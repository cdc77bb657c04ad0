// SPDX-License-Identifier: MIT
// Slots laid out in time as the board plays them.
#include "run/slot_frames.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cstdlib>

#include "run/board_messages.hpp"
#include "run/virtual_camera.hpp"

namespace ols {

namespace {

bool triggers(const Slot& slot, const CameraConfig& camera) {
    return (slot.trigger_mask >> camera.trigger & 1) != 0;
}

// Of a slot's light in the first cycle.
int64_t light_tick(const Sequence& sequence, size_t slot) {
    int64_t tick = 0;
    for (size_t s = 0; s < slot; ++s) tick += sequence.slots[s].period_ticks;
    return tick;
}

int64_t rise_tick(const Sequence& sequence, uint32_t cycle, size_t slot) {
    return int64_t(cycle) * int64_t(sequence.cycle_ticks()) + light_tick(sequence, slot) +
           sequence.slots[slot].trigger_offset_ticks;
}

// The first of the slots that trigger the camera; the number of slots when none does.
size_t first_triggered(const Sequence& sequence, const CameraConfig& camera) {
    size_t slot = 0;
    while (slot < sequence.slots.size() && !triggers(sequence.slots[slot], camera)) ++slot;
    return slot;
}

// How many slots of a cycle trigger the camera before slot `end`.
uint64_t triggers_before(const Sequence& sequence, const CameraConfig& camera, size_t end) {
    return uint64_t(std::count_if(sequence.slots.begin(), sequence.slots.begin() + std::ptrdiff_t(end),
                                  [&](const Slot& slot) { return triggers(slot, camera); }));
}

// Light and trigger last equally long, one offset against the other: only where they overlap counts.
std::vector<double> lit_microseconds(const Slot& slot) {
    const int64_t lit_ticks =
        std::max<int64_t>(0, int64_t(slot.exposure_ticks) - std::abs(int64_t(slot.trigger_offset_ticks)));
    std::vector<double> lit_us;
    for (const uint8_t lit : slot.lit) lit_us.push_back(lit ? double(lit_ticks) * microseconds_per_tick : 0);
    return lit_us;
}

}  // namespace

double slot_time_us(const Sequence& sequence, const CameraConfig& camera, uint32_t cycle, size_t slot) {
    const int64_t epoch = rise_tick(sequence, 0, first_triggered(sequence, camera));
    const double middle = double(rise_tick(sequence, cycle, slot) - epoch) + sequence.slots[slot].exposure_ticks / 2.0;
    return middle * microseconds_per_tick;
}

Result<std::shared_ptr<const Frame>> render_slot(Renderer& renderer, const Setup& setup, const Sequence& sequence,
                                                 uint32_t cycle, size_t number, std::optional<double> frozen_us) {
    const Slot& slot = sequence.slots[number];
    if (!triggers(slot, setup.camera)) return std::shared_ptr<const Frame>();
    if (slot.planes > 0)
        return fail(
            fmt::format("slot {} has grey levels, which only the board lays out in time: use stagesim run", number));
    const uint64_t trigger = cycle * triggers_before(sequence, setup.camera, sequence.slots.size()) +
                             triggers_before(sequence, setup.camera, number);
    const double time_us = frozen_us ? *frozen_us : slot_time_us(sequence, setup.camera, cycle, number);
    const Exposure exposure = renderer.expose(lit_microseconds(slot), time_us, trigger, 0);
    auto frame = std::make_shared<Frame>(make_frame(exposure, setup.camera, renderer.effects()));
    frame->identified = true;
    frame->cycle = cycle, frame->slot = uint32_t(number);
    frame->tick =
        uint64_t(rise_tick(sequence, cycle, number) - rise_tick(sequence, 0, first_triggered(sequence, setup.camera)));
    frame->exposure_ticks = slot.exposure_ticks;
    frame->stamp = {trigger + 1, camera_time_ns(setup.scene.clock, frame->tick)};
    return std::shared_ptr<const Frame>(std::move(frame));
}

Result<std::vector<std::shared_ptr<const Frame>>> render_slots(Renderer& renderer, const Setup& setup,
                                                               const Sequence& sequence, uint32_t cycle) {
    std::vector<std::shared_ptr<const Frame>> frames;
    for (size_t slot = 0; slot < sequence.slots.size(); ++slot) {
        auto frame = render_slot(renderer, setup, sequence, cycle, slot);
        if (!frame) return frame.error();
        frames.push_back(std::move(*frame));
    }
    return frames;
}

std::vector<Image> render_lamps(const Setup& setup, double exposure_us, double time_us) {
    Renderer renderer(setup, {"noise", "quantisation"});
    std::vector<Image> lamps;
    for (size_t lamp = 0; lamp < renderer.lamp_count(); ++lamp) {
        std::vector<double> lit_us(renderer.lamp_count(), 0);
        lit_us[lamp] = exposure_us;
        lamps.push_back(renderer.expose(lit_us, time_us, 0, 0).counts);
    }
    return lamps;
}

}  // namespace ols
