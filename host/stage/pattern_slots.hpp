// SPDX-License-Identifier: MIT
// Cycles that are no capture basis: spherical harmonics as grey slots, and slots that the sequence lists one by one.
#pragma once

#include "stage/sequence.hpp"
#include "stage/toml_section.hpp"

namespace ols {

// Reads the tables [[slot]]. `period_us` and `mask` are what a slot has that does not say.
std::vector<Slot> read_listed_slots(TomlSection& file, double period_us);

// Gives listed slots, read without a stage, their lamps. The error names a slot and a lamp that the stage has not.
Result<std::vector<Slot>> fit_listed_slots(std::vector<Slot> slots, const StageConfig& stage, uint8_t trigger_mask);

// One slot for each pattern of harmonic_patterns, and a dark one.
std::vector<Slot> harmonic_slots(const SequenceConfig& config, const StageConfig& stage, uint8_t trigger_mask);

}  // namespace ols
