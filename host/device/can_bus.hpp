// SPDX-License-Identifier: MIT
// A CAN bus as a host sees it: frames, and the clock that its time-outs go by.
#pragma once

#include <linux/can.h>

#include <cstdint>
#include <memory>
#include <optional>
#include <string>

#include "device/can_place.hpp"
#include "device/patience.hpp"
#include "result.hpp"

namespace ols {

// Which frames of the standard format are received: those whose identifier is `id` in the bits of `mask`.
struct CanIds {
    uint16_t id = 0, mask = CAN_SFF_MASK;

    bool holds(uint32_t can_id) const { return (can_id & (mask | CAN_EFF_FLAG | CAN_RTR_FLAG | CAN_ERR_FLAG)) == id; }
};

class CanBus {
  public:
    virtual ~CanBus() = default;

    // What it is, for errors: "the CAN interface 'can0'".
    virtual std::string name() const { return "the CAN bus"; }

    virtual Status send(const can_frame& frame, const Deadline& deadline) = 0;

    // The next frame, of 8 bytes at most, or none when it is `until_us` before one comes, or when a while has passed on the
    // wall's clock, whose time the caller then looks at.
    virtual Result<std::optional<can_frame>> receive(uint64_t until_us, const Deadline& deadline) = 0;

    // Microseconds, never going back; on an emulated bus the board's, which is not the wall's.
    virtual uint64_t now_us() const = 0;
};

// A SocketCAN interface of this machine. Only `ids` are received.
Result<std::unique_ptr<CanBus>> open_socketcan(const CanPlace& place, CanIds ids);

// The emulated bus, of which everything is received (docs/architecture.md, "CAN frames over a socket").
Result<std::unique_ptr<CanBus>> open_can_socket(const std::string& path, const Deadline& deadline);

}  // namespace ols
