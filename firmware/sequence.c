// SPDX-License-Identifier: MIT
// Sequence: validates a program and makes the words that pulse.pio plays.
//
// A slot is a stretch of latch, a stretch of light and trigger, and a dark stretch:
//
//   LATCH    _|~|_______________________________
//   LIGHT,TRIG  _|~~~~ exposure ~~~~|___________    rise to rise of the next slot: period_ticks, exactly
//   chain    (this slot's pattern)  | next pattern being sent, from the rise on, and waited for at the end
#include "sequence.h"

#include <string.h>

#include "pulse.h"
#include "text.h"

enum {
    OPERAND_MAX = (1 << 19) - 1,
    SHORT_TICKS_MAX = OPERAND_MAX + TIMELINE_HOLD_TICKS,  // what every short op can play
    SHORT_TICKS_KEPT = 64,  // long holds leave at least this for the short event that follows: above every op's cost
};

uint16_t sequence_pattern_words(uint16_t chain_bits) {
    return (uint16_t)((chain_bits + 31) / 32);
}

uint32_t sequence_shift_ticks(const struct sequence_board* board) {
    // One divided tick more, for the phase of the shifter's clock.
    const uint32_t shifter_ticks = SHIFTER_START_TICKS + SHIFTER_BIT_TICKS * board->chain_bits +
                                   SHIFTER_WORD_TICKS * sequence_pattern_words(board->chain_bits) + 1;
    return TIMELINE_SHIFT_DELAY_TICKS + board->shift_divider * shifter_ticks;
}

uint32_t sequence_slot_gap_ticks(void) {
    return SEQUENCE_LATCH_TICKS + TIMELINE_SYNC_TICKS + TIMELINE_CYCLE_END_TICKS;
}

static uint32_t event_word(uint32_t pins, uint32_t op, uint32_t operand) {
    return pins | op << 8 | operand << 13;
}

static void add_event(struct sequence* sequence, uint32_t pins, uint32_t op, uint32_t operand) {
    if (sequence->event_count < SEQUENCE_EVENTS_MAX)
        sequence->events[sequence->event_count] = event_word(pins, op, operand);
    sequence->event_count++;  // goes on past the end, so that the caller sees what was needed
}

// Plays all of *ticks that no short event can, in long holds, and leaves the rest.
static void add_long_holds(struct sequence* sequence, uint32_t pins, uint32_t* ticks) {
    while (*ticks > SHORT_TICKS_MAX) {
        uint32_t operand = (*ticks - SHORT_TICKS_KEPT - TIMELINE_LONG_HOLD_TICKS) / TIMELINE_LONG_HOLD_UNIT_TICKS;
        if (operand > OPERAND_MAX) operand = OPERAND_MAX;
        add_event(sequence, pins, TIMELINE_LONG_HOLD, operand);
        *ticks -= operand * TIMELINE_LONG_HOLD_UNIT_TICKS + TIMELINE_LONG_HOLD_TICKS;
    }
}

static void add_slot(struct sequence* sequence, const struct ols_slot* slot, bool first, bool last) {
    const uint32_t sync_pin = first ? PIN_SYNC : 0;
    const uint32_t light = slot->kind == OLS_DARK ? 0 : PIN_LIGHT_EN;
    const uint32_t lit_pins = sync_pin | light | (uint32_t)slot->trigger_mask << PIN_TRIG_SHIFT;

    add_event(sequence, sync_pin | PIN_LATCH, TIMELINE_HOLD, SEQUENCE_LATCH_TICKS - TIMELINE_HOLD_TICKS);

    // A minimal shift comes first where long holds follow, so that sending starts with the light.
    uint32_t lit_ticks = slot->exposure_ticks;
    const bool long_exposure = lit_ticks > SHORT_TICKS_MAX;
    const uint32_t shift_operand = long_exposure ? 0 : lit_ticks - TIMELINE_SHIFT_TICKS;
    add_event(sequence, lit_pins, TIMELINE_SHIFT, shift_operand);
    lit_ticks -= shift_operand + TIMELINE_SHIFT_TICKS;
    if (long_exposure) {
        add_long_holds(sequence, lit_pins, &lit_ticks);
        add_event(sequence, lit_pins, TIMELINE_HOLD, lit_ticks - TIMELINE_HOLD_TICKS);
    }

    uint32_t dark_ticks = slot->period_ticks - slot->exposure_ticks - SEQUENCE_LATCH_TICKS;
    if (last) dark_ticks -= TIMELINE_CYCLE_END_TICKS;
    add_long_holds(sequence, sync_pin, &dark_ticks);
    add_event(sequence, sync_pin, TIMELINE_SYNC, dark_ticks - TIMELINE_SYNC_TICKS);

    // SYNC is low here even in a cycle of one slot, so that each cycle has its rising edge.
    if (!last) return;
    const bool endless = sequence->cycles == 0;
    add_event(sequence, 0, endless ? TIMELINE_HOLD : TIMELINE_CYCLE_END,
              endless ? TIMELINE_CYCLE_END_TICKS - TIMELINE_HOLD_TICKS : 0);
}

static bool reject(struct ols_error_reply* error, uint16_t slot, const char* reason, uint32_t figure,
                   const char* remedy) {
    error->code = OLS_ERROR_BAD_PROGRAM;
    error->slot = slot;
    struct text text = text_in(error->text, sizeof error->text);
    if (slot != OLS_NO_SLOT) {
        text_append(&text, "slot ");
        text_append_number(&text, slot);
        text_append(&text, ": ");
    }
    text_append(&text, reason);
    text_append_number(&text, figure);
    text_append(&text, remedy);
    return false;
}

static bool pattern_is_empty_from(const uint32_t* words, uint16_t word_count, uint16_t first_bit) {
    for (uint32_t word = first_bit / 32; word < word_count; word++) {
        const uint32_t before = word == first_bit / 32u ? first_bit % 32 : 0;
        if (words[word] << before) return false;
    }
    return true;
}

static bool check_slot(const struct sequence_board* board, const struct ols_slot* slot, const uint32_t* pattern,
                       uint16_t number, struct ols_error_reply* error) {
    const uint16_t words = sequence_pattern_words(board->chain_bits);
    const uint32_t gap_ticks = sequence_slot_gap_ticks();
    const uint32_t shortest_ticks = sequence_shift_ticks(board) + gap_ticks;
    if (slot->kind > OLS_DARK) return reject(error, number, "unknown kind ", slot->kind, "");
    if (slot->trigger_mask > 15) return reject(error, number, "trigger mask ", slot->trigger_mask, ": 15 at most");
    if (slot->reserved != 0) return reject(error, number, "reserved field is ", slot->reserved, ": send 0");
    if (slot->trigger_offset_ticks != 0)
        return reject(error, number, "this firmware cannot offset triggers (capabilities ", 0, "): send offset 0");
    if (slot->exposure_ticks < TIMELINE_SHIFT_TICKS)
        return reject(error, number, "exposure must be at least ", TIMELINE_SHIFT_TICKS, " ticks");
    if (slot->period_ticks < gap_ticks || slot->period_ticks - gap_ticks < slot->exposure_ticks)
        return reject(error, number, "period must exceed the exposure by at least ", gap_ticks, " ticks");
    if (slot->period_ticks < shortest_ticks)
        return reject(error, number, "period must be at least ", shortest_ticks, " ticks, to send the next pattern");
    if (!pattern_is_empty_from(pattern, words, board->chain_bits))
        return reject(error, number, "the pattern has bits past the end of the chain of ", board->chain_bits, " bits");
    if (slot->kind == OLS_DARK && !pattern_is_empty_from(pattern, words, 0))
        return reject(error, number, "a dark slot must have an empty pattern of ", board->chain_bits, " zeros");
    return true;
}

static bool check_header(const struct sequence_board* board, const struct ols_load_begin* header,
                         struct ols_error_reply* error) {
    if (header->chain_bits != board->chain_bits)
        return reject(error, OLS_NO_SLOT, "this board's chain has ", board->chain_bits,
                      " bits: compile the program for that");
    if (header->slot_count < 1 || header->slot_count > OLS_SLOTS_MAX)
        return reject(error, OLS_NO_SLOT, "a program has 1 to ", OLS_SLOTS_MAX, " slots");
    const uint32_t pattern_words = sequence_pattern_words(board->chain_bits);
    if (header->slot_count * pattern_words > SEQUENCE_PATTERN_WORDS_MAX)
        return reject(error, OLS_NO_SLOT, "this chain leaves room for ", SEQUENCE_PATTERN_WORDS_MAX / pattern_words,
                      " slots: send fewer");
    const uint32_t program_bytes = header->slot_count * (sizeof(struct ols_slot) + 4 * pattern_words);
    if (header->program_bytes != program_bytes)
        return reject(error, OLS_NO_SLOT, "a program of so many slots has ", program_bytes, " bytes");
    return true;
}

bool sequence_compile(const struct sequence_board* board, const struct ols_load_begin* header, const uint8_t* program,
                      struct sequence* sequence, struct ols_error_reply* error) {
    sequence->slot_count = 0;
    sequence->event_count = 0;
    if (!check_header(board, header, error)) return false;
    sequence->cycles = header->cycles;
    sequence->pattern_words = sequence_pattern_words(board->chain_bits);
    const uint32_t pattern_bytes = sequence->pattern_words * 4u;
    for (uint16_t n = 0; n < header->slot_count; n++) {
        struct ols_slot slot;
        memcpy(&slot, program, sizeof slot);
        // The chain starts with slot 0's pattern in it; what slot n sends is its successor's.
        uint32_t* const pattern = sequence->patterns + n * sequence->pattern_words;
        memcpy(pattern, program + sizeof slot, pattern_bytes);
        program += sizeof slot + pattern_bytes;
        if (!check_slot(board, &slot, pattern, n, error)) return false;
        sequence->slots[n] = (struct sequence_slot){slot.period_ticks, slot.trigger_mask};
        add_slot(sequence, &slot, n == 0, n + 1 == header->slot_count);
        if (sequence->event_count > SEQUENCE_EVENTS_MAX)
            return reject(error, n, "exposures and periods this long need more than the board's ", SEQUENCE_EVENTS_MAX,
                          " events: send fewer slots");
    }
    sequence->slot_count = header->slot_count;
    return true;
}
