// SPDX-License-Identifier: MIT
// Events: merges the edges of the triggers into the stretches of a cycle, in order of time. Every trigger's pulses come
// in order already, so five streams are merged and nothing is sorted.
#include "events.h"

#include "pulse.h"

enum {
    OPERAND_MAX = (1 << 19) - 1,
    SHORT_TICKS_MAX = OPERAND_MAX + TIMELINE_HOLD_TICKS,  // what every short op can play
    SHORT_TICKS_KEPT = 64,  // long holds leave at least this for the short event that follows: above every op's cost
};
_Static_assert((int)TIMELINE_SYNC_TICKS == (int)EVENTS_TICKS_MIN, "the dearest op fits the shortest event");

void events_begin(struct events* events, uint32_t* words, uint32_t words_max,
                  void (*next_pulse)(void*, unsigned, struct events_pulse*), void* context) {
    *events = (struct events){.words = words, .words_max = words_max, .next_pulse = next_pulse, .context = context};
    for (unsigned n = 0; n < OLS_TRIGGERS; n++) next_pulse(context, n, &events->pulses[n]);
}

static uint32_t ticks_of(uint32_t op) {
    switch (op) {
        case TIMELINE_SHIFT: return TIMELINE_SHIFT_TICKS;
        case TIMELINE_SYNC: return TIMELINE_SYNC_TICKS;
        case TIMELINE_CYCLE_END: return TIMELINE_CYCLE_END_TICKS;
        default: return TIMELINE_HOLD_TICKS;
    }
}

static void add_word(struct events* events, uint32_t pins, uint32_t op, uint32_t operand) {
    if (events->word_count == events->words_max) {
        events->problem = EVENTS_TOO_MANY;
        return;
    }
    events->words[events->word_count++] = pins | op << 8 | operand << 13;
}

// One event, or as many as so long a time takes: the op at its shortest first, then long holds, then what is left.
static void add_event(struct events* events, uint32_t pins, uint32_t op, uint64_t ticks) {
    if (ticks > SHORT_TICKS_MAX) {
        add_word(events, pins, op, 0);
        ticks -= ticks_of(op);
        op = TIMELINE_HOLD;
    }
    while (ticks > SHORT_TICKS_MAX) {
        uint64_t operand = (ticks - SHORT_TICKS_KEPT - TIMELINE_LONG_HOLD_TICKS) / TIMELINE_LONG_HOLD_UNIT_TICKS;
        if (operand > OPERAND_MAX) operand = OPERAND_MAX;
        add_word(events, pins, TIMELINE_LONG_HOLD, (uint32_t)operand);
        ticks -= operand * TIMELINE_LONG_HOLD_UNIT_TICKS + TIMELINE_LONG_HOLD_TICKS;
    }
    add_word(events, pins, op, (uint32_t)ticks - ticks_of(op));
}

// Switches the triggers whose edge is now.
static void take_edges(struct events* events) {
    for (uint16_t n = 0; n < OLS_TRIGGERS; n++) {
        struct events_pulse* const pulse = &events->pulses[n];
        const bool rises = pulse->rise_ticks == events->now_ticks, falls = pulse->fall_ticks == events->now_ticks;
        if (!rises && !falls) continue;
        events->last_slot = pulse->slot;
        events->last_trigger = n;
        events->trigger_pins ^= 1u << (PIN_TRIG_SHIFT + n);
        if (falls) events->next_pulse(events->context, n, pulse);
    }
}

// The next edge before `end_ticks`, or that; notes whose it is.
static uint64_t next_edge(struct events* events, uint64_t end_ticks) {
    for (uint16_t n = 0; n < OLS_TRIGGERS; n++) {
        const struct events_pulse* const pulse = &events->pulses[n];
        const uint64_t edge = pulse->rise_ticks > events->now_ticks ? pulse->rise_ticks : pulse->fall_ticks;
        if (edge >= end_ticks) continue;
        end_ticks = edge;
        events->last_slot = pulse->slot;
        events->last_trigger = n;
    }
    return end_ticks;
}

void events_play(struct events* events, uint32_t pins, uint32_t op, uint64_t ticks) {
    const uint64_t end_ticks = events->now_ticks + ticks;
    while (events->now_ticks < end_ticks && events->problem == EVENTS_FINE) {
        take_edges(events);
        const uint64_t until_ticks = next_edge(events, end_ticks);
        const uint64_t piece_ticks = until_ticks - events->now_ticks;
        if (piece_ticks < EVENTS_TICKS_MIN) {
            events->problem = EVENTS_TOO_CLOSE;
            return;
        }
        add_event(events, pins | events->trigger_pins, op, piece_ticks);
        op = TIMELINE_HOLD;
        events->now_ticks = until_ticks;
    }
}
