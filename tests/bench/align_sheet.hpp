// SPDX-License-Identifier: MIT
// A sheet of pictures of one target, to look at what aligning left.
#pragma once

#include <string>
#include <vector>

#include "archive/archive.hpp"
#include "result.hpp"

namespace ols {

struct SheetPicture {
    std::string name;
    Image relit;  // a mosaic, in the truth's unit
};

// One basis: its truth, and what became of it.
struct SheetBand {
    std::string name;
    Image truth;
    std::vector<SheetPicture> pictures;
};

// A PNG with two rows for each band: the truth and the pictures, demosaiced, cut to `box` and enlarged; below each its difference to
// the truth in every pixel of the mosaic, grey where there is none, black and white 10 % of the truth's 99.9th percentile off. All
// bands have as many pictures.
Status write_align_sheet(const std::string& path, Cfa cfa, const std::vector<SheetBand>& bands, const Box& box,
                         int enlarge);

}  // namespace ols
