// SPDX-License-Identifier: MIT
// GigE Vision and USB3 Vision cameras, through Aravis.
#pragma once

#include "device/camera.hpp"

namespace ols {

// `name` is "" for the only camera there is, or a camera's serial number, its address, or what `arv-tool-0.8` lists it by. Errors:
// there is none, or none of that name, or several; another program has it; it does not answer.
Result<std::unique_ptr<Camera>> open_aravis_camera(const std::string& name, uint32_t index);

}  // namespace ols
