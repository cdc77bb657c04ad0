// SPDX-License-Identifier: MIT
// Slot times: every stretch of a slot, from what the PIO programs cost.
#include "slot_times.h"

#include "events.h"
#include "pulse.h"

_Static_assert((int)SLOT_CYCLE_END_TICKS == (int)EVENTS_TICKS_MIN, "the cycle's end is the shortest event");

uint16_t slot_pattern_words(uint16_t chain_bits) {
    return (uint16_t)((chain_bits + 31) / 32);
}

uint32_t slot_shift_ticks(const struct sequence_board* board) {
    // One divided tick more, for the phase of the shifter's clock.
    const uint32_t shifter_ticks = SHIFTER_START_TICKS + (SHIFTER_LOW_TICKS + SHIFTER_HIGH_TICKS) * board->chain_bits +
                                   SHIFTER_WORD_TICKS * slot_pattern_words(board->chain_bits) + 1;
    return TIMELINE_SHIFT_DELAY_TICKS + board->shift_divider * shifter_ticks;
}

uint32_t slot_gap_ticks(void) {
    return SLOT_LATCH_TICKS + EVENTS_TICKS_MIN + SLOT_CYCLE_END_TICKS;
}

uint32_t slot_planes(const struct ols_slot* slot) {
    return slot->planes < 2 ? 1 : slot->planes;
}

uint32_t slot_lit_ticks(const struct ols_slot* slot, uint32_t plane) {
    if (slot->kind == OLS_DARK) return EVENTS_TICKS_MIN;
    const uint32_t planes = slot_planes(slot);
    return slot->exposure_ticks / ((1u << planes) - 1) << (planes - 1 - plane);
}

// Ticks from a plane's light on until nothing is left to do but to wait: it is lit, or the next pattern is being sent in
// the dark.
static uint32_t plane_busy_ticks(uint32_t shift_ticks, uint32_t lit_ticks) {
    if (lit_ticks >= shift_ticks) return lit_ticks;
    return lit_ticks + EVENTS_TICKS_MIN > shift_ticks ? lit_ticks + EVENTS_TICKS_MIN : shift_ticks;
}

// From the first light on to the last plane's. A plane is followed by the shortest wait and the latch of the next.
static uint32_t last_light_ticks(uint32_t shift_ticks, const struct ols_slot* slot) {
    uint32_t ticks = 0;
    for (uint32_t plane = 0; plane + 1 < slot_planes(slot); plane++)
        ticks += plane_busy_ticks(shift_ticks, slot_lit_ticks(slot, plane)) + EVENTS_TICKS_MIN + SLOT_LATCH_TICKS;
    return ticks;
}

uint32_t slot_busy_ticks(const struct sequence_board* board, const struct ols_slot* slot) {
    const uint32_t shift_ticks = slot_shift_ticks(board);
    return last_light_ticks(shift_ticks, slot) +
           plane_busy_ticks(shift_ticks, slot_lit_ticks(slot, slot_planes(slot) - 1));
}

uint32_t slot_span_ticks(const struct sequence_board* board, const struct ols_slot* slot) {
    if (slot->kind == OLS_DARK) return slot->exposure_ticks;
    return last_light_ticks(slot_shift_ticks(board), slot) + slot_lit_ticks(slot, slot_planes(slot) - 1);
}

uint32_t slot_sending_ticks(const struct sequence_board* board, const struct ols_slot* slot, uint32_t plane) {
    const uint32_t lit_ticks = slot_lit_ticks(slot, plane);
    return plane_busy_ticks(slot_shift_ticks(board), lit_ticks) - lit_ticks;
}
