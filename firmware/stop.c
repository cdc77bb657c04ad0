// SPDX-License-Identifier: MIT
// Stop: who may write what. `guarding` is the main loop's. `first` belongs to the handlers while it guards, under held
// interrupts, for a handler of one priority may interrupt one of another; to the main loop otherwise. The pins are
// connected under held interrupts, so that no stop can fall between the look at `first` and the connection.
#include "stop.h"

#include <stdbool.h>

#include "board.h"

static volatile bool guarding;
static volatile struct stop first;

void stop_guard(void) {
    first.cause = OLS_FAULT_NONE;
    guarding = true;
    board_watch_stop_inputs();
}

struct stop stop_unguard(void) {
    guarding = false;
    const struct stop stop = {first.cause, first.us};
    first.cause = OLS_FAULT_NONE;
    return stop;
}

enum ols_fault stop_seen(void) {
    return first.cause;
}

void stop_now(enum ols_fault cause) {
    if (!guarding) return;
    board_dark();
    const uint32_t held = board_hold_interrupts();
    if (first.cause == OLS_FAULT_NONE) {
        first.us = board_time_us();
        first.cause = cause;
    }
    board_release_interrupts(held);
}

void stop_connect_pins(uint8_t inverted_triggers) {
    const uint32_t held = board_hold_interrupts();
    if (first.cause == OLS_FAULT_NONE) board_connect_pins(inverted_triggers);
    board_release_interrupts(held);
}
