// SPDX-License-Identifier: MIT
// Sequence: a program made ready to play, as the words of the timeline and of the shifter. No hardware here: the words
// are for pulse.pio, the times are its costs, and the same code is tested on the host.
#ifndef OLS_SEQUENCE_H
#define OLS_SEQUENCE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "wire.h"

#ifdef __cplusplus
extern "C" {
#endif

// What of the board decides how a program is played.
struct sequence_board {
    uint16_t chain_bits;     // 1..OLS_CHAIN_BITS_MAX
    uint16_t shift_divider;  // of the shifter's clock
};

enum {
    SEQUENCE_LATCH_TICKS = 12,  // 96 ns; TLC5926 asks for 20 ns
    SEQUENCE_EVENTS_MAX = 4 * OLS_SLOTS_MAX,
    SEQUENCE_PATTERN_WORDS_MAX = 6 * OLS_SLOTS_MAX
};

// One cycle. Player feeds both tables round and round; the pattern of slot n is sent while slot n - 1 plays.
struct sequence {
    uint32_t cycles;  // 0: until stopped
    uint16_t slot_count;
    uint16_t pattern_words;     // of one slot
    uint8_t inverted_triggers;  // bit n: TRIGn is active low
    uint32_t event_count;
    uint32_t events[SEQUENCE_EVENTS_MAX];
    uint32_t patterns[SEQUENCE_PATTERN_WORDS_MAX];
    struct sequence_slot {
        uint32_t period_ticks;
        int32_t trigger_offset_ticks;
        uint32_t trigger_mask;  // that fire, by the slot's mask and kind
    } slots[OLS_SLOTS_MAX];     // what the trigger log measures against
};

// Words of a pattern, padded to whole ones.
uint16_t sequence_pattern_words(uint16_t chain_bits);

// Ticks from the moment a slot lights to its successor's whole pattern being in the chain: no slot may be shorter than
// this and the gap.
uint32_t sequence_shift_ticks(const struct sequence_board* board);

// Ticks of a period that cannot be exposure: latching, and the cost of the events.
uint32_t sequence_slot_gap_ticks(void);

// Checks the program (layout: wire.h, ols_load_begin) and makes its words. `program` holds header->program_bytes bytes.
// False with `error` filled in (OLS_ERROR_BAD_PROGRAM) when it cannot be played exactly as it says; `sequence` is then
// empty.
bool sequence_compile(const struct sequence_board* board, const struct ols_load_begin* header, const uint8_t* program,
                      struct sequence* sequence, struct ols_error_reply* error);

#ifdef __cplusplus
}
#endif

#endif
