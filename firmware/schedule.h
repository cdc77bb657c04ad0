// SPDX-License-Identifier: MIT
// Schedule: when the watched trigger, TRIG0, must rise next. Follows the program one trigger ahead of the witness, so that
// a trigger is judged the moment it is stamped.
#ifndef OLS_SCHEDULE_H
#define OLS_SCHEDULE_H

#include <stdbool.h>
#include <stdint.h>

#include "board_pins.h"
#include "sequence.h"

#ifdef __cplusplus
extern "C" {
#endif

// Stamps are floors to two ticks, so two of them may disagree by two; one more for the pin's input synchroniser. A pad whose
// first step on the cable stays near the input's threshold crosses it only when the far end's echo is back, or does not wait
// for it: docs/hardware.md, "Levels and cables".
enum { SCHEDULE_TOLERANCE_TICKS = 2 + 1 + BOARD_CABLE_TRIGGER_ECHO_TICKS };

// A new start of `sequence`, before its first trigger. It must stay as it is while it plays. `cycles_wait`: each cycle begins
// whenever an edge comes, so only the triggers within a cycle have a schedule; no swap then.
void schedule_begin(const struct sequence* sequence, bool cycles_wait);

// After `after_cycles` of the sequence so far the next one plays. A few instructions, to be run before the last but one of
// those cycles begins: by then no trigger after them has been looked for.
void schedule_swap(const struct sequence* next, uint32_t after_cycles);

// When that swap is over, and before another: looks for the next one's first trigger, if that has not come by then.
void schedule_settle(void);

// Stamps taken since schedule_begin.
uint32_t schedule_taken(void);

// Takes the witness's next stamp. False when the program has no trigger there, to the tolerance, counted from the first
// trigger, or from the first of its cycle where cycles wait.
bool schedule_take(uint32_t stamp);

// After each stamp taken: searches the slots up to the next trigger. That takes some 40 instructions a slot, and so less
// time than the slots do.
void schedule_seek(void);

// Ticks from the last trigger taken to the next; 0 when none follows, or none within half a minute, or it waits for an edge.
uint32_t schedule_ticks_to_next(void);

#ifdef __cplusplus
}
#endif

#endif
