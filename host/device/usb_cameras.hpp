// SPDX-License-Identifier: MIT
// USB3 Vision cameras as the machine's USB knows them: what Aravis does not tell of them.
#pragma once

#include <arv.h>

#include <cstdint>
#include <optional>
#include <string>

namespace ols {

// Aravis leaves out cameras that may not be opened: why one of them may not, and what to do; nothing when there is none.
std::optional<std::string> forbidden_usb_camera();

// Registers of an opened camera's stream (USB3 Vision 1.0.1, "Streaming interface register map").
struct UsbStreamRegisters {
    uint64_t required_payload_bytes = 0;  // of a frame, as it is set up now; 0 when it cannot say
    // As the library has set them, once there is a stream.
    uint32_t payload_transfer_bytes = 0, trailer_transfer_bytes = 0;
};
std::optional<UsbStreamRegisters> usb_stream_registers(ArvDevice* device);

// Whether this is the trailer of that frame, and says that the frame is not as it was exposed (the same, "Trailer": status).
constexpr size_t usb_trailer_head_bytes = 18;
bool usb_trailer_complains(const uint8_t* trailer, uint64_t frame_id);

}  // namespace ols
