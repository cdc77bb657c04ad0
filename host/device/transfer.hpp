// SPDX-License-Identifier: MIT
// Bulk transfers to and from a board: all that the protocol above needs of USB.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "device/patience.hpp"
#include "result.hpp"

namespace ols {

// One board's pair of bulk endpoints. Each direction is a byte stream; where a transfer ends means nothing.
// Every transfer ends: at its timeout, which is more than 0 and in the board's time (on the virtual stage not the wall's), at
// the deadline of the exchange that it is part of, or when the board sends more than it was asked for.
class Transfer {
  public:
    virtual ~Transfer() = default;

    // Who is at the other end, for errors: "the board at 'PATH'".
    virtual std::string name() const { return "the board"; }

    // Sends all bytes, or fails.
    virtual Status write(std::span<const uint8_t> bytes, uint32_t timeout_us, const Deadline& deadline) = 0;

    // Receives what the board sends next, 1 to `capacity` bytes.
    virtual Result<std::vector<uint8_t>> read(size_t capacity, uint32_t timeout_us, const Deadline& deadline) = 0;
};

// "usb:" is the one board that is plugged in, "usb:SERIAL" the one of that serial number, "socket:PATH" the emulated
// board's USB, "can:IFACE" a SocketCAN interface, "can-socket:PATH" the emulated CAN bus ("#N" behind these two: board N,
// not 0). Errors say what links there are, which boards are plugged in, or how to get permission.
Result<std::unique_ptr<Transfer>> open_transfer(const std::string& link, const Deadline& deadline);

// The emulated board's USB over the AF_UNIX socket at `path` (docs/architecture.md, "USB transfers over a socket").
Result<std::unique_ptr<Transfer>> open_socket_transfer(const std::string& path, const Deadline& deadline);

}  // namespace ols
