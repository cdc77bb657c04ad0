// SPDX-License-Identifier: MIT
// Sequence: a program made ready to play, as the words of the timeline and of the shifter. No hardware here: the words
// are for pulse.pio, the times are its costs, and the same code is tested on the host.
#ifndef OLS_SEQUENCE_H
#define OLS_SEQUENCE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "events.h"
#include "slot_times.h"
#include "wire.h"

#ifdef __cplusplus
extern "C" {
#endif

enum {
    SEQUENCE_WORDS_MAX = 24064,  // 94 KB, twice: 1024 slots with four triggers of their own, or 300 grey ones
};

// One program. Player feeds patterns and cycle words round and round; the pattern of a slot, or of a plane of a grey
// one, is sent while the one before it plays.
struct sequence {
    struct ols_load_begin header;
    uint16_t pattern_words;  // of one pattern
    uint32_t cycle_words;    // of the timeline, in one cycle; 0 until they are made
    uint32_t longest_light_ticks;
    uint32_t words_crc32;  // of all words, once they are made (programs.c)
    // First header.program_bytes as they were loaded, slots and patterns; then the word that enters this program, in
    // place of the last one of the program before; then those of a cycle; then the word that waits for an edge.
    uint32_t words[SEQUENCE_WORDS_MAX];
};

const struct ols_slot* sequence_slots(const struct sequence* sequence);
const uint32_t* sequence_patterns(const struct sequence* sequence);
uint32_t sequence_patterns_words(const struct sequence* sequence);  // of all slots
const uint32_t* sequence_enter(const struct sequence* sequence);    // the cycle's words follow

// The triggers that fire in a slot, by its mask and its kind. Bit n: TRIGn.
uint32_t sequence_triggers(const struct sequence* sequence, const struct ols_slot* slot);

// Ticks from a slot's light to the rise of trigger n.
int64_t sequence_trigger_offset_ticks(const struct sequence* sequence, const struct ols_slot* slot, unsigned n);

// The making of a sequence from the program in it, some slots at a time: a long one takes several milliseconds.
struct sequence_compiler {
    const struct sequence_board* board;
    struct sequence* sequence;
    struct ols_error_reply* error;  // of the step that is under way
    uint32_t slots_checked, slots_played;
    uint32_t next_pattern;  // of the next slot to be checked
    struct events events;
    struct light_use use;
    struct sequence_trigger_place {
        uint32_t next_slot;
        uint64_t light_ticks;     // of next_slot, since the cycle's begin
        uint64_t earliest_ticks;  // at which the next pulse may rise
    } triggers[OLS_TRIGGERS];
    bool refused;
};

enum sequence_progress { SEQUENCE_UNFINISHED, SEQUENCE_MADE, SEQUENCE_REFUSED };

// Begins with the program that `sequence` holds (header, and words as loaded).
void sequence_begin(struct sequence_compiler* compiler, const struct sequence_board* board, struct sequence* sequence);

// SEQUENCE_REFUSED, with `error` filled in: the program cannot be played exactly as it says (OLS_ERROR_BAD_PROGRAM), or
// lights more than lamps or supply stand (OLS_ERROR_OVER_LIMIT).
enum sequence_progress sequence_step(struct sequence_compiler* compiler, struct ols_error_reply* error);

#ifdef __cplusplus
}
#endif

#endif
