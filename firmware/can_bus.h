// SPDX-License-Identifier: MIT
// CAN bus: frames to and from it, without waiting. mcp2515.c does it on the board, board_host_can.c on Linux.
#ifndef OLS_CAN_BUS_H
#define OLS_CAN_BUS_H

#include <stdbool.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

// A data frame of CAN 2.0 with a standard identifier.
struct can_bus_frame {
    uint16_t id;
    uint8_t length;
    uint8_t data[8];
};

// Received frames that find room before can_bus_receive takes them.
enum { CAN_BUS_RECEIVED_MAX = 32 };

struct can_bus_health {
    uint16_t frames_lost;      // received without room, or given up unsent
    uint16_t bus_offs;         // the controller left the bus because of its errors, and came back
    uint8_t controller_flags;  // EFLG (MCP2515 datasheet, register 6-3), as last seen
};

// Looks for a controller and joins the bus with identifiers as PROTOCOL.md has them for board `board_number`. False when
// none answers: then there is no CAN, and the functions below do nothing.
bool can_bus_init(unsigned board_number);

// Takes the oldest frame received; false when there is none.
bool can_bus_receive(struct can_bus_frame* frame);

// Queues a frame; they leave in order. False when the queue is full.
bool can_bus_send(const struct can_bus_frame* frame);
bool can_bus_has_room(void);

// True when all frames queued are on the bus, or given up.
bool can_bus_is_idle(void);

// Gives up frames that the bus has not taken for a second, which are counted. Once each turn of the main loop.
void can_bus_poll(uint64_t now_us);

// True while somebody acknowledges what this board sends, or nothing was sent yet.
bool can_bus_is_answered(void);

struct can_bus_health can_bus_health(void);

#ifdef __cplusplus
}
#endif

#endif
