// SPDX-License-Identifier: MIT
// The warning that a sequence's light can harm photosensitive people, of every verb that shows or plays one.
#pragma once

#include <string>

#include "stage/flicker.hpp"

namespace ols {

// Empty where neither all light nor any one lamp flickers by more than photosensitive_modulation.
std::string flicker_warning(const Flicker& flicker);

// Prints it to stderr, before the light comes on.
void warn_of_flicker(const Sequence& sequence);

}  // namespace ols
