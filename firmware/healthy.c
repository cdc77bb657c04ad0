// SPDX-License-Identifier: MIT
// Healthy: whether this turn may say so.
#include "healthy.h"

#include <stdbool.h>

#include "board.h"
#include "fault.h"
#include "player.h"
#include "stage.h"
#include "stop.h"

static bool doubted;  // since the pad, or the light watch, said so

static bool is_of_the_light(enum ols_fault cause) {
    return cause == OLS_FAULT_OVER_DUTY || cause == OLS_FAULT_LIGHT_STUCK;
}

// Nothing may be lit now: no program plays, or a handler has stopped it.
static bool must_be_dark(uint8_t state) {
    if (stop_seen() != OLS_FAULT_NONE) return true;
    return state == OLS_STATE_WAITING ? player_waiting() : state != OLS_STATE_PLAYING;
}

// A cycle that waits for its edge may begin at any tick, so it must be dark before the look at the pad and after it: within
// a look that no interrupt lengthens, no cycle begins and ends.
static bool is_lit_in_the_dark(void) {
    const uint8_t state = stage_summary().state;  // the main loop's own, by its last look
    const uint32_t held = board_hold_interrupts();
    const bool is_lit = must_be_dark(state) && board_light_is_on() && must_be_dark(state);
    board_release_interrupts(held);
    return is_lit;
}

void healthy_turn(void) {
    const bool is_lit = is_lit_in_the_dark();
    if (is_lit) stage_fail(OLS_FAULT_LIGHT_STUCK);
    const enum ols_fault latched = fault_latched().cause;
    doubted =
        is_lit || is_of_the_light(latched) || is_of_the_light(stop_seen()) || (doubted && latched != OLS_FAULT_NONE);
    if (!doubted) board_pulse_healthy();
}
