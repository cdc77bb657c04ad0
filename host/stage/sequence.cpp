// SPDX-License-Identifier: MIT
// From sequence.toml to slots, from slots to program bytes.
#include "stage/sequence.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>

#include "stage/exposure.hpp"
#include "stage/pattern_slots.hpp"
#include "stage/slot_order.hpp"
#include "stage/toml_section.hpp"

namespace ols {

namespace {

constexpr const char* harmonics_name = "spherical_harmonics";
constexpr int landmarks_a_group = 2;  // tracking and matte

uint32_t period_ticks_of(const SequenceConfig& config) {
    return uint32_t(std::lround(double(tick_hz) / config.frame_rate_hz));
}

// The board logs TRIG0 only, so every slot fires it.
uint8_t trigger_mask_of(const StageConfig& stage) {
    uint8_t mask = 1;
    for (const auto& camera : stage.cameras) mask |= uint8_t(1 << camera.trigger);
    return mask;
}

// Which basis places of the cycle are dark, as flags; `places` a group.
std::vector<bool> choose_dark_places(int groups, int places, int dark_count) {
    std::vector<bool> dark(size_t(groups) * places, false);
    for (int d = 0; d < dark_count; ++d) {
        const int group = (2 * d + 1) * groups / (2 * dark_count);
        const int place = (2 * d + 1) * places / (2 * dark_count);
        dark[size_t(group) * places + place] = true;
    }
    return dark;
}

// Makes the slots of one sequence; lamps and triggers are the same for all slots of a kind but basis.
class CycleLayout {
  public:
    CycleLayout(const SequenceConfig& config, const StageConfig& stage, const Basis& basis)
        : config_(config), basis_(basis), sphere_lamps_(stage.lamps.size()), lamps_(size_t(stage.lamp_count())) {
        trigger_mask_ = trigger_mask_of(stage);
    }

    int slots() const { return groups() * config_.group_slots; }

    std::vector<Slot> lay_out() const {
        const int places = basis_places_a_group(), groups = this->groups();
        const auto dark = choose_dark_places(groups, places, groups * places - basis_.rows);
        std::vector<Slot> cycle;
        std::vector<int> basis_places;
        for (int place = 0; place < groups * places; ++place) {
            if (place % places == 0) {
                cycle.push_back(tracking());
                cycle.push_back(matte());
            }
            if (!dark[size_t(place)]) basis_places.push_back(int(cycle.size()));
            cycle.push_back(unlit(SlotKind::dark, config_.basis_exposure_us));
        }
        const auto order = spread_rows(basis_, basis_places, int(cycle.size()));
        for (size_t n = 0; n < order.size(); ++n) cycle[size_t(basis_places[n])] = basis_row(order[n]);
        return cycle;
    }

  private:
    int basis_places_a_group() const { return config_.group_slots - landmarks_a_group; }
    // As many as hold all rows and one dark slot.
    int groups() const { return basis_.rows / basis_places_a_group() + 1; }

    // A dark slot is exposed as long as a basis slot, so that it shows the black level that these have.
    Slot unlit(SlotKind kind, double exposure_us) const {
        Slot slot;
        slot.kind = kind;
        slot.lit.assign(lamps_, 0);
        slot.exposure_ticks = uint32_t(ticks_of_us(exposure_us));
        slot.period_ticks = period_ticks_of(config_);
        slot.trigger_mask = trigger_mask_;
        return slot;
    }
    Slot tracking() const {
        Slot slot = unlit(SlotKind::tracking, config_.tracking_exposure_us);
        if (config_.tracking_lamps.empty()) std::fill_n(slot.lit.begin(), sphere_lamps_, uint8_t(1));
        for (const int lamp : config_.tracking_lamps) slot.lit[size_t(lamp)] = 1;
        return slot;
    }
    Slot matte() const {
        Slot slot = unlit(SlotKind::matte, config_.matte_exposure_us);
        std::fill(slot.lit.begin() + ptrdiff_t(sphere_lamps_), slot.lit.end(), uint8_t(1));
        return slot;
    }
    Slot basis_row(int row) const {
        Slot slot = unlit(SlotKind::basis, config_.basis_exposure_us);
        slot.row = row;
        for (int lamp = 0; lamp < basis_.lamps; ++lamp) slot.lit[size_t(lamp)] = basis_.lit(row, lamp);
        if (basis_.level_max == 1) return slot;
        slot.planes = uint8_t(std::bit_width(unsigned(basis_.level_max)));
        slot.exposure_ticks = grey_exposure_ticks(config_.basis_exposure_us, slot.planes);
        slot.levels.assign(lamps_, 0);
        for (int lamp = 0; lamp < basis_.lamps; ++lamp) slot.levels[size_t(lamp)] = uint8_t(basis_.level(row, lamp));
        return slot;
    }

    const SequenceConfig& config_;
    const Basis& basis_;
    size_t sphere_lamps_, lamps_;
    uint8_t trigger_mask_;
};

Status check_exposures(const SequenceConfig& config) {
    const uint32_t period_ticks = period_ticks_of(config);
    const std::pair<const char*, double> exposures[] = {{"basis", config.basis_exposure_us},
                                                        {"tracking", config.tracking_exposure_us},
                                                        {"matte", config.matte_exposure_us}};
    for (const auto& [name, exposure_us] : exposures)
        if (ticks_of_us(exposure_us) >= int64_t(period_ticks))
            return fail(
                fmt::format("the {} exposure of {} us does not fit the {:.1f} us between frames at {} frames "
                            "a second: shorten it or lower frame_rate_hz",
                            name, exposure_us, double(period_ticks) / double(ticks_per_us), config.frame_rate_hz));
    return Done{};
}

// What is played instead of a capture basis, and where its triggers lie.
void read_patterns(TomlSection& file, SequenceConfig& config) {
    TomlSection offset = file.section("offset_us");
    for (const SlotKind kind : {SlotKind::basis, SlotKind::tracking, SlotKind::matte, SlotKind::dark}) {
        double offset_us = 0;
        offset.read(slot_kind_name(kind), offset_us, -1e6, 1e6);
        config.kind_offset_ticks[size_t(kind)] = int32_t(ticks_of_us(offset_us));
    }
    if (file.has("harmonics") && config.basis != harmonics_name)
        file.reject("harmonics", fmt::format("is for basis = \"{}\": remove it", harmonics_name));
    TomlSection harmonics = file.section("harmonics");
    harmonics.read("order", config.harmonics.order, 0, harmonics_order_max);
    harmonics.read("planes", config.harmonics.planes, 2, OLS_PLANES_MAX);
    harmonics.read_choice<HarmonicSign>("sign", config.harmonics.sign,
                                        {{"split", HarmonicSign::split}, {"offset", HarmonicSign::offset}});
    if (file.has("slot") && file.has("basis")) file.reject("slot", "and basis exclude each other: keep one of them");
    config.listed_slots = read_listed_slots(file, 1e6 / config.frame_rate_hz);
}

// The cycle of a sequence that is no capture basis.
Result<Sequence> compile_patterns(const SequenceConfig& config, const StageConfig& stage) {
    Sequence sequence{config, {}, {}};
    if (config.basis_exposure_us == 0) sequence.config.basis_exposure_us = longest_exposure_us(config.frame_rate_hz);
    sequence.basis.lamps = int(stage.lamps.size());
    sequence.basis.name = config.listed_slots.empty() ? harmonics_name : "listed";
    if (config.listed_slots.empty()) {
        sequence.slots = harmonic_slots(sequence.config, stage, trigger_mask_of(stage));
    } else {
        auto slots = fit_listed_slots(config.listed_slots, stage, trigger_mask_of(stage));
        if (!slots.ok()) return slots.error();
        sequence.slots = std::move(*slots);
    }
    if (sequence.slots.size() > OLS_SLOTS_MAX)
        return fail(fmt::format("the cycle has {} slots and the board plays {}", sequence.slots.size(), OLS_SLOTS_MAX));
    return sequence;
}

}  // namespace

const char* slot_kind_name(SlotKind kind) {
    switch (kind) {
        case SlotKind::basis: return "basis";
        case SlotKind::tracking: return "tracking";
        case SlotKind::matte: return "matte";
        case SlotKind::dark: return "dark";
    }
    return "";
}

uint64_t Sequence::cycle_ticks() const {
    uint64_t ticks = 0;
    for (const Slot& slot : slots) ticks += slot.period_ticks;
    return ticks;
}

std::vector<int> Sequence::order_of_play() const {
    std::vector<int> rows;
    for (const Slot& slot : slots)
        if (slot.kind == SlotKind::basis && slot.row >= 0) rows.push_back(slot.row);
    return rows;
}

uint32_t grey_exposure_ticks(double exposure_us, uint8_t planes) {
    const int64_t units = planes ? (1 << planes) - 1 : 1;
    return uint32_t(units * std::llround(exposure_us * double(ticks_per_us) / double(units)));
}

Result<SequenceConfig> read_sequence(const std::string& path) {
    auto file = TomlSection::open(path);
    if (!file.ok()) return file.error();
    SequenceConfig config;
    file->read("basis", config.basis);
    file->read("frame_rate_hz", config.frame_rate_hz, 1, 100'000);
    file->read("cycles", config.cycles, 1, 1'000'000);
    file->read("group_slots", config.group_slots, 3, OLS_SLOTS_MAX);
    TomlSection exposure = file->section("exposure_us");
    exposure.read("basis", config.basis_exposure_us, 1, 1e6);
    exposure.read("tracking", config.tracking_exposure_us, 1, 1e6);
    exposure.read("matte", config.matte_exposure_us, 1, 1e6);
    file->read("tracking_lamps", config.tracking_lamps, 0, OLS_CHAIN_BITS_MAX - 1);
    read_patterns(*file, config);
    config.playback = read_playback(*file);
    if (const Status status = file->finish(); !status.ok()) return status.error();
    if (!config.listed_slots.empty()) return config;
    if (config.basis != harmonics_name)
        if (const Status status = check_basis_name(config.basis); !status.ok())
            return fail(path + ": " + status.error().message + ", " + harmonics_name);
    if (config.basis.ends_with(".csv")) config.basis = file->resolve_path(config.basis);
    if (const Status status = check_exposures(config); !status.ok()) return fail(path + ": " + status.error().message);
    return config;
}

static Result<Sequence> compile_capture(const SequenceConfig& config, const StageConfig& stage) {
    auto basis = find_basis(config.basis, stage.lamps);
    if (!basis.ok()) return basis.error();
    for (const int lamp : config.tracking_lamps)
        if (lamp >= stage.lamp_count())
            return fail(fmt::format("tracking_lamps names lamp {}, and the stage has {}", lamp, stage.lamp_count()));
    if (const Status status = check_exposures(config); !status.ok()) return status.error();

    Sequence sequence{config, std::move(*basis), {}};
    if (config.basis_exposure_us == 0)
        sequence.config.basis_exposure_us = derived_exposure_us(sequence.basis, stage, config.frame_rate_hz);
    const CycleLayout layout(sequence.config, stage, sequence.basis);
    if (layout.slots() > OLS_SLOTS_MAX)
        return fail(
            fmt::format("the cycle has {} slots and the board plays {}: choose longer groups or a basis of "
                        "fewer rows",
                        layout.slots(), OLS_SLOTS_MAX));
    sequence.slots = layout.lay_out();
    std::vector<SlotKind> kinds;
    for (const Slot& slot : sequence.slots) kinds.push_back(slot.kind);
    if (!has_unique_order(kinds))
        return fail(
            "the order of tracking, matte and dark slots repeats within the cycle, so that a frame's slot "
            "could not be proved: choose another group_slots");
    return sequence;
}

Result<Sequence> compile_sequence(const SequenceConfig& config, const StageConfig& stage) {
    const bool is_capture = config.listed_slots.empty() && config.basis != harmonics_name;
    if (const Status playable = check_chain(stage); !playable.ok()) return playable.error();
    auto sequence = is_capture ? compile_capture(config, stage) : compile_patterns(config, stage);
    if (!sequence.ok()) return sequence;
    for (Slot& slot : sequence->slots) slot.trigger_offset_ticks += config.kind_offset_ticks[size_t(slot.kind)];
    return sequence;
}

bool has_unique_order(const std::vector<SlotKind>& cycle) {
    std::vector<SlotKind> turned = cycle;
    for (size_t turn = 1; turn < cycle.size(); ++turn) {
        std::rotate(turned.begin(), turned.begin() + 1, turned.end());
        if (turned == cycle) return false;
    }
    return !cycle.empty();
}

// The slot's patterns in chain order: one, or one for each plane, the most significant first.
static void append_patterns(const Slot& slot, const StageConfig& stage, std::vector<uint32_t>& patterns) {
    const size_t words = (size_t(stage.chain_bits) + 31) / 32;
    const int planes = slot.planes ? slot.planes : 1;
    for (int plane = planes - 1; plane >= 0; --plane) {
        std::vector<uint32_t> pattern(words, 0);
        for (size_t lamp = 0; lamp < slot.lit.size(); ++lamp) {
            const int bit = stage.chain_bit_of_lamp[lamp];
            const uint8_t level = slot.planes ? slot.levels[lamp] : slot.lit[lamp];
            if (level >> plane & 1) pattern[size_t(bit) / 32] |= 1u << (31 - bit % 32);
        }
        patterns.insert(patterns.end(), pattern.begin(), pattern.end());
    }
}

std::vector<uint8_t> encode_program(const Sequence& sequence, const StageConfig& stage) {
    std::vector<ols_slot> heads;
    std::vector<uint32_t> patterns;
    for (const Slot& slot : sequence.slots) {
        ols_slot head{};
        head.kind = uint8_t(slot.kind);
        head.trigger_mask = slot.trigger_mask;
        head.planes = slot.planes;
        head.exposure_ticks = slot.exposure_ticks;
        head.period_ticks = slot.period_ticks;
        head.trigger_offset_ticks = slot.trigger_offset_ticks;
        heads.push_back(head);
        append_patterns(slot, stage, patterns);
    }
    const size_t head_bytes = heads.size() * sizeof(ols_slot), pattern_bytes = patterns.size() * sizeof(uint32_t);
    std::vector<uint8_t> bytes(head_bytes + pattern_bytes);
    if (bytes.empty()) return bytes;
    std::memcpy(bytes.data(), heads.data(), head_bytes);
    std::memcpy(bytes.data() + head_bytes, patterns.data(), pattern_bytes);
    return bytes;
}

}  // namespace ols
