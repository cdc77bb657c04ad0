// SPDX-License-Identifier: MIT
// A camera whose frames another process writes into a shared-memory ring.
#pragma once

#include "device/camera.hpp"

namespace ols {

// `path` is the ring's file. Errors: there is none, its program has gone, another program reads it.
Result<std::unique_ptr<Camera>> open_ring_camera(const std::string& path, uint32_t index);

}  // namespace ols
