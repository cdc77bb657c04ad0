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

// A PNG of two rows: the truth and the pictures, demosaiced, cut to `box` and enlarged; below each its difference to the truth in
// every pixel of the mosaic, grey where there is none, black and white 10 % of the truth's 99.9th percentile off.
Status write_align_sheet(const std::string& path, const Image& truth, Cfa cfa,
                         const std::vector<SheetPicture>& pictures, const Box& box, int enlarge);

}  // namespace ols
