// SPDX-License-Identifier: MIT
// Where on SocketCAN a board is: an interface of this machine and the board's number, which gives its identifiers.
#pragma once

#include <linux/can.h>

#include <cstdint>
#include <string>

#include "result.hpp"
#include "wire.h"

namespace ols {

struct CanPlace {
    std::string interface;  // as in `ip link`: "can0"
    unsigned board_number = 0;

    uint16_t to_board() const { return uint16_t(OLS_CANBUS_TO_BOARD + 16 * board_number); }
    uint16_t to_host() const { return uint16_t(OLS_CANBUS_TO_HOST + 16 * board_number); }
    std::string name() const;
};

// A socket for the place's interface, SOCK_RAW and CAN_RAW or SOCK_DGRAM and CAN_ISOTP, and the address to bind it to.
struct CanSocketAddress {
    int fd = -1;
    sockaddr_can address{};
};
Result<CanSocketAddress> open_can_address(const CanPlace& place, int type, int protocol);

// A call on such a socket has failed with `error`: the interface is down, or gone.
Error can_down(const CanPlace& place, int error);

}  // namespace ols
