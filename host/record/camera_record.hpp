// SPDX-License-Identifier: MIT
// What a take's manifest and report say of its camera.
#pragma once

#include <nlohmann/json.hpp>

#include "device/camera.hpp"

namespace ols {

// {"name", "link", "missing_ids", "dropped", "underrun", "stale"}: counts of this take.
nlohmann::json camera_record(const CameraInfo& info, const CameraCounts& counts);

}  // namespace ols
