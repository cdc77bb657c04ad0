// SPDX-License-Identifier: MIT
// Who calls for a mosaic.
#include "render/effects/mosaic.hpp"

namespace ols {

std::string Mosaic::caller(const Setup& setup) const {
    if (!setup.camera_model || setup.camera.cfa == Cfa::rgb) return "";
    return setup.camera.cfa == Cfa::none ? "camera: monochrome" : "camera: colour filter array";
}

}  // namespace ols
