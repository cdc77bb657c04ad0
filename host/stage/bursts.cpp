// SPDX-License-Identifier: MIT
// Every window of the order of play, tried.
#include "stage/bursts.hpp"

#include <algorithm>

namespace ols {

std::vector<BurstLoss> measure_bursts(const RowLosses& losses, const std::vector<int>& order) {
    std::vector<BurstLoss> bursts;
    for (size_t length = 1; length <= std::min(RowLosses::rows_max, order.size()); ++length) {
        BurstLoss burst{int(length), int(order.size())};
        for (size_t first = 0; first < order.size(); ++first) {
            std::vector<int> rows;
            for (size_t k = 0; k < length; ++k) rows.push_back(order[(first + k) % order.size()]);
            const double gain = losses.noise_gain(rows);
            if (gain > bearable_noise_gain) continue;
            ++burst.made_up_for;
            burst.worst_noise_gain = std::max(burst.worst_noise_gain, gain);
        }
        bursts.push_back(burst);
    }
    return bursts;
}

}  // namespace ols
