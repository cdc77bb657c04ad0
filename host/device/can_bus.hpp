// SPDX-License-Identifier: MIT
// A CAN bus as a host sees it: frames, and the clock that its time-outs go by.
#pragma once

#include <linux/can.h>

#include <cstdint>
#include <memory>
#include <optional>
#include <string>

#include "device/unix_socket.hpp"
#include "result.hpp"

namespace ols {

class CanBus {
  public:
    virtual ~CanBus() = default;

    virtual Status send(const can_frame& frame) = 0;

    // The next frame, or none when it is `until_us` before one comes.
    virtual Result<std::optional<can_frame>> receive(uint64_t until_us) = 0;

    // Microseconds; on an emulated bus the board's, which is not the wall's.
    virtual uint64_t now_us() const = 0;
};

// A SocketCAN interface, as in `ip link`: "can0". Only frames with `id` are received.
Result<std::unique_ptr<CanBus>> open_socketcan(const std::string& interface, uint16_t id);

// The emulated bus (docs/architecture.md, "CAN frames over a socket"), given up after so long without a word.
Result<std::unique_ptr<CanBus>> open_can_socket(const std::string& path, int patience_ms = UnixSocket::patience_ms);

}  // namespace ols
