// SPDX-License-Identifier: MIT
// Stop: dark at once, decided in an interrupt handler, with the first cause kept until the main loop latches it. Whatever
// two contexts share about stopping is here.
#ifndef OLS_STOP_H
#define OLS_STOP_H

#include <stdint.h>

#include "wire.h"

struct stop {
    enum ols_fault cause;  // OLS_FAULT_NONE: nothing has stopped
    uint64_t us;           // board time when it was decided
};

// Main loop: from now on any cause stops. Before the pins are connected.
void stop_guard(void);

// Main loop: from now on causes no longer matter, for nothing can be lit. Returns what has stopped since stop_guard, and
// forgets it.
struct stop stop_unguard(void);

// Main loop: the first cause since stop_guard, or OLS_FAULT_NONE.
enum ols_fault stop_seen(void);

// From any handler, or the main loop: dark, whatever PIO does; the first cause since stop_guard is kept. Nothing unless
// guarded.
void stop_now(enum ols_fault cause);

// Main loop: gives the pins to PIO (board_connect_pins), unless something has stopped since stop_guard.
void stop_connect_pins(uint8_t inverted_triggers);

#endif
