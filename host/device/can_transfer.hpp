// SPDX-License-Identifier: MIT
// Transfers to and from a board on a CAN bus: each message of protocol/frame.h is one of ISO-TP.
#pragma once

#include <memory>

#include "device/can_bus.hpp"
#include "device/transfer.hpp"
#include "isotp.h"

namespace ols {

// Why a message was given up, by the standard's name, and what to do.
const char* isotp_error_text(isotp_error error);

// To the board of that number (PROTOCOL.md, "CAN").
std::unique_ptr<Transfer> can_transfer(std::unique_ptr<CanBus> bus, unsigned board_number);

// "can:IFACE" or "can-socket:PATH", with "#N" behind it for another board than number 0.
Result<std::unique_ptr<Transfer>> open_can(const std::string& link, const Deadline& deadline);

}  // namespace ols
