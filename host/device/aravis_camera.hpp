// SPDX-License-Identifier: MIT
// GigE Vision and USB3 Vision cameras, through Aravis.
#pragma once

#include <vector>

#include "device/camera.hpp"

namespace ols {

// The socket that the driver asks for, for each GigE camera; the kernel grants less where net.core.rmem_max is.
inline constexpr int aravis_socket_bytes = 32 << 20;

// A camera as Aravis finds it.
struct AravisListing {
    std::string id, vendor, model, serial;
    std::string address;   // of a GigE camera
    std::string protocol;  // "GigEVision", "USB3Vision"
};

// Those that answer within a second or so; empty also when the library hangs.
std::vector<AravisListing> list_aravis_cameras();

// `name` is "" for the only camera there is, or a camera's serial number, its address, or what `arv-tool-0.8` lists it by. Errors:
// there is none, or none of that name, or several; another program has it; it does not answer.
Result<std::unique_ptr<Camera>> open_aravis_camera(const std::string& name, uint32_t index);

}  // namespace ols
