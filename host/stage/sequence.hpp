// SPDX-License-Identifier: MIT
// Sequences: sequence.toml compiled into the slots of a cycle, and those into the program that the board plays.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "result.hpp"
#include "stage/basis.hpp"
#include "stage/harmonics.hpp"
#include "stage/playback.hpp"
#include "stage/stage.hpp"
#include "wire.h"

namespace ols {

enum class SlotKind : uint8_t { basis = OLS_BASIS, tracking = OLS_TRACKING, matte = OLS_MATTE, dark = OLS_DARK };

const char* slot_kind_name(SlotKind kind);

// The table [harmonics], for basis = "spherical_harmonics": its functions one after the other, to be played and watched.
// What is recorded and inverted is the basis spherical_harmonics:ORDER.
struct HarmonicsConfig {
    int order = 2;  // nine functions: enough for diffuse light (Ramamoorthi and Hanrahan 2001)
    HarmonicSign sign = HarmonicSign::split;
    int planes = 8;  // bits of a level
};

struct Slot {
    SlotKind kind = SlotKind::dark;
    int row = -1;                      // of the basis, for SlotKind::basis
    std::vector<uint8_t> lit;          // a 0/1 for each lamp of the stage, sphere first
    uint8_t planes = 0;                // bits of a level; 0: on or off
    std::vector<uint8_t> levels;       // with planes, a level for each lamp
    uint32_t exposure_ticks = 0;       // of light and trigger; in a grey slot, the light of the highest level
    uint32_t period_ticks = 0;         // to the next slot's light
    int32_t trigger_offset_ticks = 0;  // from the light to the triggers
    uint8_t trigger_mask = 1;
    bool fires_all = false;  // listed without its triggers: it gets those of the stage's cameras
    std::string name;        // of a harmonic
    double scale = 1;        // of a harmonic (HarmonicPattern)

    // How long a lamp is lit.
    double light_ticks(size_t lamp) const {
        if (planes == 0) return lit[lamp] ? exposure_ticks : 0;
        return double(levels[lamp]) * exposure_ticks / ((1 << planes) - 1);
    }
};

// The ticks of an exposure; with planes, the nearest that divides into the units of the levels.
uint32_t grey_exposure_ticks(double exposure_us, uint8_t planes);

// What sequence.toml says.
struct SequenceConfig {
    std::string basis = "single";
    double frame_rate_hz = 2160;  // of the cameras; the paper's
    int cycles = 1;
    int group_slots = 18;          // tracking, matte and this many less two places for the basis (Wenger 4)
    double basis_exposure_us = 0;  // 0: as long as a white card stays below saturation (stage/exposure.hpp)
    // All lamps at once would saturate skin in the 412 us that one lamp, or the matte board, has.
    double tracking_exposure_us = 50;
    double matte_exposure_us = 412;
    std::vector<int> tracking_lamps;    // empty: all on the sphere
    int32_t kind_offset_ticks[4] = {};  // [offset_us]: from the light to the triggers, by kind
    HarmonicsConfig harmonics;
    std::vector<Slot> listed_slots;  // [[slot]], instead of a basis
    Playback playback;
};

struct Sequence {
    SequenceConfig config;  // with the basis exposure that was decided
    Basis basis;
    std::vector<Slot> slots;  // one cycle

    uint64_t cycle_ticks() const;
    // Whether its frames invert to single lamps; listed slots and harmonics do not.
    bool is_capture() const { return basis.rows > 0; }
    // The rows of the basis in the order of play.
    std::vector<int> order_of_play() const;
    uint64_t trigger_count() const { return uint64_t(config.cycles) * slots.size(); }
};

// Reads sequence.toml; absent keys have the defaults above. Unknown keys and values out of range are errors that name
// file, line and key.
Result<SequenceConfig> read_sequence(const std::string& path);

// Lays out the cycle: groups of tracking, matte and basis places, as many as hold every row of the basis and at least
// one dark slot. Rows stand where the loss of neighbours can be made up for and
// each lamp's light spreads evenly over the cycle (stage/slot_order.hpp). Dark slot d lies in the middle of the d-th equal part of the cycle's groups, at a
// place of its own: no two dark slots have the same distance to their group's tracking slot, so that each of them
// alone tells where in the cycle it is.
// Errors: more lamps than a chain drives; basis and stage differ in lamps; an exposure that does not fit its period; a cycle above the board's limit;
// an order of kinds that some rotation repeats (see has_unique_order).
// Listed slots and spherical harmonics are taken as they are, without optical code.
Result<Sequence> compile_sequence(const SequenceConfig& config, const StageConfig& stage);

// The optical code: whether no rotation of the cycle but the whole turn gives the same order of kinds, so that what a
// camera sees of it fixes the slot.
bool has_unique_order(const std::vector<SlotKind>& cycle);

// The bytes of OLS_LOAD_CHUNK (protocol/wire.h): an ols_slot for each slot, then their patterns in chain order.
std::vector<uint8_t> encode_program(const Sequence& sequence, const StageConfig& stage);

}  // namespace ols
