// SPDX-License-Identifier: MIT
// The records of "USB transfers over a socket" (docs/architecture.md), little-endian.
#pragma once

#include <cstdint>

namespace ols {

constexpr uint32_t socket_usb_request_magic = 0x54425355;  // "USBT"
constexpr uint32_t socket_usb_reply_magic = 0x52425355;    // "USBR"
constexpr uint8_t socket_usb_bulk = 1, socket_usb_cancel = 2;
constexpr uint8_t socket_usb_out = 0x01, socket_usb_in = 0x82;  // endpoints
constexpr int32_t socket_usb_stalled = -1, socket_usb_timed_out = -3, socket_usb_cancelled = -4;
constexpr int32_t socket_usb_busy = -6;  // to no transfer: the client is turned away

#pragma pack(push, 1)
struct SocketUsbRequest {
    uint32_t magic = socket_usb_request_magic, tag = 0;
    uint8_t type = socket_usb_bulk, endpoint = 0;
    uint16_t reserved = 0;
    uint32_t length = 0, timeout_us = 0;
    uint8_t setup[8] = {};
};
struct SocketUsbReply {
    uint32_t magic, tag;
    int32_t status;
    uint32_t length;
};
#pragma pack(pop)
static_assert(sizeof(SocketUsbRequest) == 28 && sizeof(SocketUsbReply) == 16);

}  // namespace ols
