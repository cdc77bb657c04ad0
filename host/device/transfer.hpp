// SPDX-License-Identifier: MIT
// Bulk transfers to and from a board: all that the protocol above needs of USB.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "device/unix_socket.hpp"
#include "result.hpp"

namespace ols {

// One board's pair of bulk endpoints. Each direction is a byte stream; where a transfer ends means nothing.
// Every transfer ends: timeouts are more than 0, in the board's time, which on the virtual stage is not the wall's.
class Transfer {
  public:
    virtual ~Transfer() = default;

    // Sends all bytes, or fails.
    virtual Status write(std::span<const uint8_t> bytes, uint32_t timeout_us) = 0;

    // Receives what the board sends next, 1 to `capacity` bytes.
    virtual Result<std::vector<uint8_t>> read(size_t capacity, uint32_t timeout_us) = 0;
};

// "usb:" is the one board that is plugged in, "usb:SERIAL" the one of that serial number, "socket:PATH" the emulated
// board's USB, "can:IFACE" a SocketCAN interface, "can-socket:PATH" the emulated CAN bus ("#N" behind these two: board N,
// not 0). Errors say what links there are, which boards are plugged in, or how to get permission.
Result<std::unique_ptr<Transfer>> open_transfer(const std::string& link);

// The emulated board's USB over the AF_UNIX socket at `path` (docs/architecture.md, "USB transfers over a socket"). Its time is
// the board's; a board whose time does not go on is given up after `patience_ms` of the wall's without a word.
Result<std::unique_ptr<Transfer>> open_socket_transfer(const std::string& path,
                                                       int patience_ms = UnixSocket::patience_ms);

}  // namespace ols
