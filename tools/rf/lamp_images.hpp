// SPDX-License-Identifier: MIT
// The lamp images of a target as pictures, in as many readings as memory asks for.
#pragma once

#include <functional>

#include "archive/archive.hpp"

namespace ols {

// Calls `visit` with each lamp's image in order: three channels, mosaics demosaiced, grey repeated. Lamps are tiled
// together in the file, so a target beyond some 2 GB of pictures is read several times over, never held whole.
// The first error, of reading or of `visit`, ends it.
Status for_each_lamp_image(const TargetReader& target, int lamps,
                           const std::function<Status(int lamp, const Image& rgb)>& visit);

}  // namespace ols
