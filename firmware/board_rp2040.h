// SPDX-License-Identifier: MIT
// What the RP2040's handlers need of the board beyond board.h.
#ifndef OLS_BOARD_RP2040_H
#define OLS_BOARD_RP2040_H

#include <stdbool.h>
#include <stdint.h>

// Alarms of the timer, and so who uses each.
enum { BOARD_ALARM_TICK = 0, BOARD_ALARM_HEARTBEAT = 1, BOARD_ALARM_TRIGGER = 2 };

// From a handler: the main loop has something to look at. board_sleep returns at once.
extern volatile bool board_is_woken;
static inline void board_wake(void) {
    board_is_woken = true;
}

// The time spent in board_sleep, in all, modulo 2^32.
uint32_t board_slept_us(void);

// mcp2515.c: from now on IRQ_CAN comes when it is raised; and once by the next fall of the controller's interrupt pin.
void board_enable_can_interrupt(void);
void board_watch_can_interrupt(void);
void board_raise_can_interrupt(void);
void mcp2515_interrupt(void);

#endif
