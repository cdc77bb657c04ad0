// SPDX-License-Identifier: MIT
// Slot times: when what happens in a slot. A slot has one pattern, or as many as it has planes; each is latched, lit, and
// dark until the next pattern is in the chain.
#ifndef OLS_SLOT_TIMES_H
#define OLS_SLOT_TIMES_H

#include <stdint.h>

#include "light_limits.h"
#include "wire.h"

#ifdef __cplusplus
extern "C" {
#endif

// What of the board decides how a program is played.
struct sequence_board {
    uint16_t chain_bits;     // 1..OLS_CHAIN_BITS_MAX
    uint16_t shift_divider;  // of the shifter's clock
    struct light_limits limits;
};

enum {
    SLOT_LATCH_TICKS = 12,    // 96 ns; TLC5926 asks for 20 ns
    SLOT_CYCLE_END_TICKS = 8  // at the end of the last slot
};

// Words of a pattern, padded to whole ones.
uint16_t slot_pattern_words(uint16_t chain_bits);

// Ticks from the moment a pattern lights to the next one being whole in the chain: no period may be shorter than this
// and the gap.
uint32_t slot_shift_ticks(const struct sequence_board* board);

// Ticks of a period that cannot be exposure: latching, and the cost of the events.
uint32_t slot_gap_ticks(void);

// Patterns of a slot.
uint32_t slot_planes(const struct ols_slot* slot);

// Ticks that a plane, from 0, is lit. Binary-coded modulation: each is lit half as long as the one before it, and the
// last one for the unit of a level.
uint32_t slot_lit_ticks(const struct ols_slot* slot, uint32_t plane);

// Ticks after that in which it stays dark because the next pattern is still being sent.
uint32_t slot_sending_ticks(const struct sequence_board* board, const struct ols_slot* slot, uint32_t plane);

// Ticks from a slot's first light on to its last light off: the exposure, or more in a grey slot.
uint32_t slot_span_ticks(const struct sequence_board* board, const struct ols_slot* slot);

// Ticks from a slot's first light on until nothing is left to do but to wait.
uint32_t slot_busy_ticks(const struct sequence_board* board, const struct ols_slot* slot);

#ifdef __cplusplus
}
#endif

#endif
