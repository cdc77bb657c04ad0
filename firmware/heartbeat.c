// SPDX-License-Identifier: MIT
// Heartbeat: the board's timer, set anew with each sign of life.
#include "heartbeat.h"

#include "board.h"

static uint32_t within_us;  // 0: the host may be silent

void heartbeat_begin(uint32_t ticks) {
    within_us = ticks / BOARD_TICKS_PER_US;
    board_expect_message(within_us);
}

void heartbeat_renew(void) {
    board_expect_message(within_us);
}

void heartbeat_end(void) {
    heartbeat_begin(0);
}
