// SPDX-License-Identifier: MIT
// What is true of a set of pictures only together: what must agree, and what a user should hear once, not once a picture.
#pragma once

#include <string>
#include <vector>

#include "photographs/picture.hpp"
#include "result.hpp"

namespace ols {

// What was converted, assumed or left out, a line a kind with the number of pictures and the first of them, and warnings: exposures that
// differ, 16-bit samples that use fewer bits. Errors name two pictures: orientations that differ though pictures are turned (a camera that
// looks down guesses), mosaics of different filters.
Result<std::vector<std::string>> check_set(const std::vector<std::string>& paths,
                                           const std::vector<PictureFacts>& facts, const PictureOptions& options);

}  // namespace ols
