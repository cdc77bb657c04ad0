// SPDX-License-Identifier: MIT
// Target inversion: from a basis's rows to a target, with its masks, variance and noise gain.
#pragma once

#include <functional>
#include <vector>

#include "demultiplex/row_filler.hpp"
#include "develop/aligned_rows.hpp"
#include "develop/parity_samples.hpp"
#include "develop/row_band.hpp"
#include "stage/calibration.hpp"

namespace ols {

struct InversionJob {
    const Basis& basis;
    const CameraCalibration& calibration;
    const NoiseModel& noise;
    std::function<FillCache&()> fills;  // for masked samples; null where they are left as they are
    Estimate estimate = Estimate::none;
    int threads = 0;                  // 0: as many as there are processors. Any number gives the same bits.
    ParitySamples* parity = nullptr;  // takes of the rows what lies on its grid; may be null
};

// Rows: RecordedRows or AlignedRows. `like`: any of the frames. One row at least has a frame.
template <typename Rows>
Target invert_rows(const Rows& rows, const Frame& like, const InversionJob& job);

// Rows without a frame.
template <typename Sources>
std::vector<int> empty_rows(const std::vector<Sources>& rows) {
    std::vector<int> empty;
    for (size_t row = 0; row < rows.size(); ++row)
        if (rows[row].empty()) empty.push_back(int(row));
    return empty;
}

}  // namespace ols
