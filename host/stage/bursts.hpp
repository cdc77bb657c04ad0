// SPDX-License-Identifier: MIT
// Bursts: neighbouring slots of the basis that are lost together, as by a hiccup of the camera or of the recording.
#pragma once

#include <vector>

#include "stage/row_losses.hpp"

namespace ols {

// All bursts of one length: one begins at each slot of the basis, and those at the cycle's end go on with the next cycle.
// Tracking, matte and dark slots between do not count.
struct BurstLoss {
    int slots = 0;                // of the basis, that are lost together
    int windows = 0;              // bursts of this length
    int made_up_for = 0;          // those after which the other rows determine every image (RowLosses::makes_up_for)
    double worst_noise_gain = 1;  // of those
};

// Of one to RowLosses::rows_max slots; `order` is the rows in the order of play.
std::vector<BurstLoss> measure_bursts(const RowLosses& losses, const std::vector<int>& order);

}  // namespace ols
