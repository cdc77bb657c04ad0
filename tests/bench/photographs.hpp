// SPDX-License-Identifier: MIT
// Pairs of photographs with true flow: the virtual stage's moving scenes as pictures of 8 bits.
#pragma once

#include <string>
#include <vector>

#include "../unit/flow_scenes.hpp"
#include "result.hpp"

namespace ols {

// What there is: "hand, 8 ms apart".
const std::vector<std::string>& photograph_names();

// Two moments of a moving scene, a tracking frame's distance apart (8 ms) or half a cycle (42 ms): under a smooth environment, without the
// camera's noise, as luminance, coded by the power 1/2.2 and rounded to 8 bits as photographs are. Scored is what shows the subject and stays
// visible. Errors: those of the scenes; `make assets` brings what they are made of.
Result<scenes::FlowScene> photographed(size_t which, int width, int height);

// Of the ball of hair, which needs no assets.
Result<scenes::FlowScene> tiny_pair(int width, int height);

}  // namespace ols
