// SPDX-License-Identifier: MIT
// Slots from [[slot]] tables and from spherical harmonics.
#include "stage/pattern_slots.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "stage/harmonics.hpp"

namespace ols {

namespace {

// Levels of the lamps named, or of all where `levels` lists one for each; without either nothing is lit.
void read_lamps(TomlSection& table, Slot& slot) {
    if (table.has("planes") && !table.has("levels")) table.reject("planes", "is for slots with levels: remove it");
    std::vector<int> lamps, levels;
    int planes = 8;
    table.read("planes", planes, 2, OLS_PLANES_MAX);
    table.read("lamps", lamps, 0, OLS_CHAIN_BITS_MAX - 1);
    table.read("levels", levels, 0, (1 << planes) - 1);
    if (!lamps.empty() && !levels.empty() && levels.size() != lamps.size())
        table.reject("levels", fmt::format("lists {} for {} lamps: list one for each", levels.size(), lamps.size()));
    const size_t last = lamps.empty() ? levels.size() : size_t(*std::max_element(lamps.begin(), lamps.end())) + 1;
    slot.lit.assign(last, 0);
    if (!levels.empty()) {
        slot.planes = uint8_t(planes);
        slot.levels.assign(last, 0);
    }
    const size_t named = lamps.empty() ? levels.size() : lamps.size();
    for (size_t n = 0; n < named; ++n) {
        const size_t lamp = lamps.empty() ? n : size_t(lamps[n]);
        const int level = n < levels.size() ? levels[n] : 1;
        slot.lit[lamp] = level > 0;
        if (!slot.levels.empty()) slot.levels[lamp] = uint8_t(level);
    }
    if (slot.kind == SlotKind::dark && last > 0)
        table.reject(lamps.empty() ? "levels" : "lamps", "must not be in a dark slot");
}

Slot read_slot(TomlSection table, double period_us) {
    Slot slot;
    table.read_choice<SlotKind>("kind", slot.kind,
                                {{"basis", SlotKind::basis},
                                 {"tracking", SlotKind::tracking},
                                 {"matte", SlotKind::matte},
                                 {"dark", SlotKind::dark}});
    double exposure_us = 0, offset_us = 0;
    if (!table.has("exposure_us")) table.reject("exposure_us", "is missing");
    table.read("exposure_us", exposure_us, 0.064, 1e6);
    table.read("period_us", period_us, 1, 1e7);
    table.read("offset_us", offset_us, -1e6, 1e6);
    if (exposure_us >= period_us)
        table.reject("exposure_us", fmt::format("does not fit the period of {} us", period_us));
    std::vector<int> triggers;
    table.read("triggers", triggers, 0, OLS_TRIGGERS - 1);
    slot.trigger_mask = 0;
    for (const int line : triggers) slot.trigger_mask |= uint8_t(1 << line);
    slot.fires_all = !table.has("triggers");
    read_lamps(table, slot);
    slot.exposure_ticks = grey_exposure_ticks(exposure_us, slot.planes);
    slot.period_ticks = uint32_t(ticks_of_us(period_us));
    slot.trigger_offset_ticks = int32_t(ticks_of_us(offset_us));
    return slot;
}

}  // namespace

std::vector<Slot> read_listed_slots(TomlSection& file, double period_us) {
    std::vector<Slot> slots;
    for (auto& table : file.sections("slot", OLS_SLOTS_MAX)) slots.push_back(read_slot(table, period_us));
    return slots;
}

Result<std::vector<Slot>> fit_listed_slots(std::vector<Slot> slots, const StageConfig& stage, uint8_t trigger_mask) {
    const size_t lamps = size_t(stage.lamp_count());
    for (size_t n = 0; n < slots.size(); ++n) {
        Slot& slot = slots[n];
        if (slot.lit.size() > lamps)
            return fail(fmt::format("slot {} names lamp {}, and the stage has {}", n, slot.lit.size() - 1, lamps));
        slot.lit.resize(lamps, 0);
        if (!slot.levels.empty()) slot.levels.resize(lamps, 0);
        if (slot.fires_all) slot.trigger_mask = trigger_mask;
    }
    return slots;
}

std::vector<Slot> harmonic_slots(const SequenceConfig& config, const StageConfig& stage, uint8_t trigger_mask) {
    const HarmonicsConfig& harmonics = config.harmonics;
    Slot dark;
    dark.exposure_ticks = grey_exposure_ticks(config.basis_exposure_us, uint8_t(harmonics.planes));
    dark.period_ticks = uint32_t(ticks_of_us(1e6 / config.frame_rate_hz));
    dark.trigger_mask = trigger_mask;
    dark.lit.assign(size_t(stage.lamp_count()), 0);
    std::vector<Slot> slots;
    for (auto& pattern : harmonic_patterns(stage.lamps, harmonics.order, harmonics.sign, (1 << harmonics.planes) - 1)) {
        Slot slot = dark;
        slot.kind = SlotKind::basis;
        slot.row = int(slots.size());
        slot.planes = uint8_t(harmonics.planes);
        slot.name = pattern.name;
        slot.scale = pattern.scale;
        slot.levels = std::move(pattern.levels);
        slot.levels.resize(slot.lit.size(), 0);
        for (size_t lamp = 0; lamp < slot.lit.size(); ++lamp) slot.lit[lamp] = slot.levels[lamp] > 0;
        slots.push_back(std::move(slot));
    }
    slots.push_back(dark);
    return slots;
}

}  // namespace ols
