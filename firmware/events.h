// SPDX-License-Identifier: MIT
// Events: stretches of light and dark, and the pulses of four triggers that may begin and end anywhere in them, become
// the timeline's words (pulse.pio).
#ifndef OLS_EVENTS_H
#define OLS_EVENTS_H

#include <stdbool.h>
#include <stdint.h>

#include "wire.h"

#ifdef __cplusplus
extern "C" {
#endif

// A timeline event's pins, bit 0 at the first of the timeline's eight.
enum events_pins {
    PIN_LATCH = 1 << 0,
    PIN_LIGHT_EN = 1 << 1,
    PIN_TRIG_SHIFT = 2,  // TRIGn is bit n above this
    PIN_SYNC = 1 << 6,
    PIN_READY = 1 << 7  // waits for an edge
};

// The shortest that any event may last: two edges coincide or are this far apart.
enum { EVENTS_TICKS_MIN = 8 };

// The next pulse of one trigger, in ticks since the cycle's begin.
struct events_pulse {
    uint64_t rise_ticks, fall_ticks;  // EVENTS_NEVER: there are no more
    uint16_t slot;
};
#define EVENTS_NEVER UINT64_MAX

enum events_problem {
    EVENTS_FINE = 0,
    EVENTS_TOO_CLOSE,  // an edge of a trigger is within EVENTS_TICKS_MIN of another edge
    EVENTS_TOO_MANY    // the words do not fit
};

struct events {
    uint32_t* words;
    uint32_t word_count, words_max;
    uint64_t now_ticks;  // since the cycle's begin: the end of what has been written
    struct events_pulse pulses[OLS_TRIGGERS];
    // Replaces *pulse, which has ended, by the next of trigger n.
    void (*next_pulse)(void* context, unsigned n, struct events_pulse* pulse);
    void* context;
    uint32_t trigger_pins;  // that are high now
    enum events_problem problem;
    uint16_t last_slot, last_trigger;  // whose edge came last: with EVENTS_TOO_CLOSE, the one that is
};

// Begins a cycle. Every pulse, the first ones too, begins at or after the cycle, EVENTS_TICKS_MIN or more after the one
// before it on the same trigger, and is that long at least.
void events_begin(struct events* events, uint32_t* words, uint32_t words_max,
                  void (*next_pulse)(void*, unsigned, struct events_pulse*), void* context);

// Plays a stretch of EVENTS_TICKS_MIN ticks or more with `pins` (but triggers) as they are, beginning with `op`, an
// address in the timeline's program. Sets `problem` when it cannot be done.
void events_play(struct events* events, uint32_t pins, uint32_t op, uint64_t ticks);

#ifdef __cplusplus
}
#endif

#endif
