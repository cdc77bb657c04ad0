// SPDX-License-Identifier: MIT
// What lost slots cost in a capture sequence, for reports.
#pragma once

#include <nlohmann/json.hpp>
#include <string>

#include "stage/sequence.hpp"

namespace ols {

// One line: which bursts the other slots make up for, and at how much noise.
std::string describe_lost_slots(const Sequence& sequence);

// redundancy, is_one_image_a_row, and for bursts of 1, 2 and 3 neighbouring slots of the basis: slots, windows, made_up_for,
// worst_noise_gain (null where none is made up for).
nlohmann::json lost_slots_json(const Sequence& sequence);

}  // namespace ols
