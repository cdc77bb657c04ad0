// SPDX-License-Identifier: MIT
// Player: plays a compiled sequence with PIO and DMA. Once started, nothing depends on the processor; player and
// witness (witness.h) only say what happened.
#ifndef OLS_PLAYER_H
#define OLS_PLAYER_H

#include <stdbool.h>
#include <stdint.h>

#include "sequence.h"

// PIO flags, as in pulse.pio.
enum player_event { PLAYER_TIMELINE_STARVED = 1 << 0, PLAYER_DONE = 1 << 1, PLAYER_SHIFTER_STARVED = 1 << 2 };

// Loads the PIO programs. Once, after board_init.
void player_init(void);

// Fills the FIFOs, connects the pins and sends the first pattern. `sequence` must stay as it is until player_stop.
// False, with the pins dark, when the chain could not be filled. After stop_guard: what has stopped is not connected. By an
// edge: play begins not with player_start but with the first rise of GENLOCK after it; each cycle by an edge: and every
// cycle with a rise of PHOTO of its own (receptor.h).
bool player_arm(const struct sequence* sequence, enum ols_start_source start);

// Starts the timeline: the first event plays within a few ticks.
void player_start(void);

// Cycles that an edge has begun since player_arm, where each cycle waits for one: exact, some ticks after the edge.
uint32_t player_cycles_begun(void);

// True while the timeline waits for an edge.
bool player_waiting(void);

// Goes on with `following` at the end of a cycle: the first that can be changed in time, which is the cycle after the
// next one or, as some are in FIFOs already, one or two later. *after_cycles says how many of the playing sequence are
// played by then; the schedule knows it, too. Both must have the same lead and polarities, and both stay as they are until player_swapping ends or
// player_stop. False, and nothing changes, when the playing sequence ends before that.
bool player_swap(const struct sequence* following, uint32_t* after_cycles);

// True until the sequence before the swap is no longer needed: all of its lights and triggers are over, not only on their
// way to the FIFO.
bool player_swapping(void);

// Once each turn of the main loop and now and then in it, for at least every 2.4 ms while playing: 240 of the shortest cycles.
void player_poll(void);

// What has happened since player_arm, enum player_event bits.
uint32_t player_events(void);

// Dark, machines and DMA stopped. In any state.
void player_stop(void);

#endif
