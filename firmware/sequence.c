// SPDX-License-Identifier: MIT
// Sequence: validates a program and makes the words that pulse.pio plays.
//
// A cycle is a lead, and then for each slot a stretch of latch, a stretch of light, and a dark stretch:
//
//   LATCH    ______|~|_______________________________
//   LIGHT_EN ________|~~~~ exposure ~~~~|___________    light to light of the next slot: period_ticks, exactly
//   TRIGn    _____|~~~~ width ~~~~|_________________    from the light on, or wherever its offset puts it
//   chain         (this slot's pattern)  | next pattern being sent, from the light on, and waited for in the dark
#include "sequence.h"

#include <string.h>

#include "events.h"
#include "pulse.h"
#include "text.h"

enum { CYCLE_END_TICKS = EVENTS_TICKS_MIN, KINDS_ALL = (1 << (OLS_DARK + 1)) - 1 };

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
    return SEQUENCE_LATCH_TICKS + EVENTS_TICKS_MIN + CYCLE_END_TICKS;
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

static bool fires(const struct ols_trigger* trigger, unsigned n, const struct ols_slot* slot) {
    return slot->trigger_mask >> n & 1 && !(trigger->skip_kinds >> slot->kind & 1);
}

static uint32_t lit_ticks_of(const struct ols_slot* slot) {
    return slot->kind == OLS_DARK ? EVENTS_TICKS_MIN : slot->exposure_ticks;
}

// Ticks from the light on until nothing is left to do in a slot but to wait: it is lit, or the next pattern is being
// sent in the dark.
static uint32_t busy_ticks(const struct sequence_board* board, const struct ols_slot* slot) {
    const uint32_t lit_ticks = lit_ticks_of(slot), shift_ticks = sequence_shift_ticks(board);
    if (lit_ticks >= shift_ticks) return lit_ticks;
    return lit_ticks + EVENTS_TICKS_MIN > shift_ticks ? lit_ticks + EVENTS_TICKS_MIN : shift_ticks;
}

static bool check_slot(const struct sequence_board* board, const struct ols_slot* slot, const uint32_t* pattern,
                       uint16_t number, struct ols_error_reply* error) {
    const uint16_t words = sequence_pattern_words(board->chain_bits);
    const uint32_t gap_ticks = sequence_slot_gap_ticks();
    if (slot->kind > OLS_DARK) return reject(error, number, "unknown kind ", slot->kind, "");
    if (slot->trigger_mask >> OLS_TRIGGERS)
        return reject(error, number, "trigger mask ", slot->trigger_mask, ": 15 at most");
    if (slot->reserved != 0) return reject(error, number, "reserved field is ", slot->reserved, ": send 0");
    if (slot->exposure_ticks < EVENTS_TICKS_MIN)
        return reject(error, number, "exposure must be at least ", EVENTS_TICKS_MIN, " ticks");
    if (slot->period_ticks < gap_ticks || slot->period_ticks - gap_ticks < slot->exposure_ticks)
        return reject(error, number, "period must exceed the exposure by at least ", gap_ticks, " ticks");
    if (slot->period_ticks - gap_ticks < busy_ticks(board, slot))
        return reject(error, number, "period must be at least ", busy_ticks(board, slot) + gap_ticks,
                      " ticks, to send the next pattern");
    if (!pattern_is_empty_from(pattern, words, board->chain_bits))
        return reject(error, number, "the pattern has bits past the end of the chain of ", board->chain_bits, " bits");
    if (slot->kind == OLS_DARK && !pattern_is_empty_from(pattern, words, 0))
        return reject(error, number, "a dark slot must have an empty pattern of ", board->chain_bits, " zeros");
    return true;
}

static bool check_triggers(const struct ols_load_begin* header, struct ols_error_reply* error) {
    for (uint32_t n = 0; n < OLS_TRIGGERS; n++) {
        const struct ols_trigger* const trigger = &header->triggers[n];
        if (trigger->skip_kinds > KINDS_ALL || trigger->active_low > 1 || trigger->reserved != 0)
            return reject(error, OLS_NO_SLOT, "trigger ", n, ": skip_kinds is 15 at most, active_low 1, reserved 0");
        if (trigger->width_ticks != 0 && trigger->width_ticks < EVENTS_TICKS_MIN)
            return reject(error, OLS_NO_SLOT, "trigger widths must be 0 or at least ", EVENTS_TICKS_MIN, " ticks");
    }
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

// The pulses of each trigger, in order.
struct schedule {
    const struct ols_load_begin* header;
    const uint8_t* program;
    size_t slot_bytes;
    struct {
        uint32_t next_slot;
        uint64_t light_ticks;     // of next_slot, since the cycle's begin
        uint64_t earliest_ticks;  // at which the next pulse may rise
    } triggers[OLS_TRIGGERS];
    bool good;
    struct ols_error_reply* error;
};

static struct ols_slot slot_at(const struct schedule* schedule, uint32_t n) {
    struct ols_slot slot;
    memcpy(&slot, schedule->program + n * schedule->slot_bytes, sizeof slot);
    return slot;
}

static void place_pulse(struct schedule* schedule, unsigned n, const struct ols_slot* slot, uint16_t number,
                        struct events_pulse* pulse) {
    const struct ols_trigger* const trigger = &schedule->header->triggers[n];
    const int64_t rise_ticks =
        (int64_t)schedule->triggers[n].light_ticks + slot->trigger_offset_ticks + trigger->offset_ticks;
    const uint32_t width_ticks = trigger->width_ticks ? trigger->width_ticks : slot->exposure_ticks;
    if (rise_ticks < 0)
        schedule->good = reject(schedule->error, number, "a trigger begins before the cycle: raise lead_ticks by ",
                                (uint32_t)-rise_ticks, " or more");
    else if ((uint64_t)rise_ticks < schedule->triggers[n].earliest_ticks)
        schedule->good = reject(schedule->error, number, "its pulse overlaps an earlier one of trigger ", n, "");
    if (!schedule->good) return;
    *pulse = (struct events_pulse){(uint64_t)rise_ticks, (uint64_t)rise_ticks + width_ticks, number};
    schedule->triggers[n].earliest_ticks = pulse->fall_ticks + EVENTS_TICKS_MIN;
}

static void next_pulse(void* context, unsigned n, struct events_pulse* pulse) {
    struct schedule* const schedule = context;
    *pulse = (struct events_pulse){EVENTS_NEVER, EVENTS_NEVER, 0};
    bool found = false;
    while (!found && schedule->triggers[n].next_slot < schedule->header->slot_count) {
        const uint16_t number = (uint16_t)schedule->triggers[n].next_slot++;
        const struct ols_slot slot = slot_at(schedule, number);
        found = fires(&schedule->header->triggers[n], n, &slot);
        if (found) place_pulse(schedule, n, &slot, number, pulse);
        schedule->triggers[n].light_ticks += slot.period_ticks;
    }
}

// Stretches of the light. What the last slot's dark ends with is the lead of the next cycle and the cycle's end.
static void play_slot(struct events* events, const struct sequence_board* board, const struct ols_load_begin* header,
                      const struct ols_slot* slot, uint16_t number) {
    const uint32_t sync_pin = number == 0 ? PIN_SYNC : 0;
    const uint32_t light_pin = slot->kind == OLS_DARK ? 0 : PIN_LIGHT_EN;
    const uint32_t lit_ticks = lit_ticks_of(slot);
    const uint32_t sending_ticks = busy_ticks(board, slot) - lit_ticks;
    uint32_t rest_ticks = slot->period_ticks - SEQUENCE_LATCH_TICKS - lit_ticks - sending_ticks;
    if (number + 1 == header->slot_count) rest_ticks -= header->lead_ticks + CYCLE_END_TICKS;

    events_play(events, sync_pin | PIN_LATCH, TIMELINE_HOLD, SEQUENCE_LATCH_TICKS);
    events_play(events, sync_pin | light_pin, TIMELINE_SHIFT, lit_ticks);
    if (sending_ticks > 0) events_play(events, sync_pin, TIMELINE_HOLD, sending_ticks);
    events_play(events, sync_pin, TIMELINE_SYNC, rest_ticks);
}

// The lead comes from the end of the last slot, where nothing but waiting is left.
static bool check_lead(const struct sequence_board* board, const struct ols_load_begin* header,
                       const struct ols_slot* last, struct ols_error_reply* error) {
    const uint32_t lead_ticks_max = last->period_ticks - sequence_slot_gap_ticks() - busy_ticks(board, last);
    if (header->lead_ticks != 0 && header->lead_ticks < EVENTS_TICKS_MIN)
        return reject(error, OLS_NO_SLOT, "lead_ticks must be 0 or at least ", EVENTS_TICKS_MIN, "");
    if (header->lead_ticks > lead_ticks_max)
        return reject(error, (uint16_t)(header->slot_count - 1), "its dark end leaves room for lead_ticks of ",
                      lead_ticks_max, ": end the cycle with a longer or a dark slot");
    return true;
}

static bool reject_events(const struct events* events, uint16_t number, struct ols_error_reply* error) {
    if (events->problem == EVENTS_TOO_MANY)
        return reject(error, number, "this program needs more than the board's ", SEQUENCE_EVENTS_MAX,
                      " events: send fewer slots");
    return reject(error, events->last_slot, "an edge of a trigger must coincide with any other edge or be ",
                  EVENTS_TICKS_MIN, " ticks away");
}

static bool play_cycle(const struct sequence_board* board, struct schedule* schedule, struct sequence* sequence) {
    const struct ols_load_begin* const header = schedule->header;
    struct events events;
    events_begin(&events, sequence->events, SEQUENCE_EVENTS_MAX, next_pulse, schedule);
    if (header->lead_ticks > 0) events_play(&events, 0, TIMELINE_HOLD, header->lead_ticks);
    for (uint16_t n = 0; n < header->slot_count && schedule->good; n++) {
        const struct ols_slot slot = slot_at(schedule, n);
        play_slot(&events, board, header, &slot, n);
        if (events.problem != EVENTS_FINE) return reject_events(&events, n, schedule->error);
    }
    for (unsigned n = 0; n < OLS_TRIGGERS && schedule->good; n++)
        if (events.pulses[n].fall_ticks > events.now_ticks && events.pulses[n].fall_ticks != EVENTS_NEVER)
            schedule->good = reject(schedule->error, events.pulses[n].slot, "its pulse of trigger ", n,
                                    " ends after the cycle: end the cycle with a longer slot");
    // SYNC is low here even in a cycle of one slot, so that each cycle has its rising edge.
    const bool endless = header->cycles == 0;
    events_play(&events, 0, endless ? TIMELINE_HOLD : TIMELINE_CYCLE_END, CYCLE_END_TICKS);
    sequence->event_count = events.word_count;
    return schedule->good;
}

bool sequence_compile(const struct sequence_board* board, const struct ols_load_begin* header, const uint8_t* program,
                      struct sequence* sequence, struct ols_error_reply* error) {
    sequence->slot_count = 0;
    sequence->event_count = 0;
    if (!check_header(board, header, error) || !check_triggers(header, error)) return false;
    sequence->cycles = header->cycles;
    sequence->pattern_words = sequence_pattern_words(board->chain_bits);
    const uint32_t pattern_bytes = sequence->pattern_words * 4u;
    struct schedule schedule = {.header = header,
                                .program = program,
                                .slot_bytes = sizeof(struct ols_slot) + pattern_bytes,
                                .good = true,
                                .error = error};
    for (unsigned n = 0; n < OLS_TRIGGERS; n++)
        schedule.triggers[n].light_ticks = (uint64_t)header->lead_ticks + SEQUENCE_LATCH_TICKS;
    struct ols_slot slot;
    sequence->inverted_triggers = 0;
    for (uint16_t n = 0; n < header->slot_count; n++) {
        slot = slot_at(&schedule, n);
        // The chain starts with slot 0's pattern in it; what slot n sends is its successor's.
        uint32_t* const pattern = sequence->patterns + n * sequence->pattern_words;
        memcpy(pattern, program + n * schedule.slot_bytes + sizeof slot, pattern_bytes);
        if (!check_slot(board, &slot, pattern, n, error)) return false;
        sequence->slots[n] =
            (struct sequence_slot){slot.period_ticks, slot.trigger_offset_ticks + header->triggers[0].offset_ticks, 0};
        for (unsigned t = 0; t < OLS_TRIGGERS; t++)
            if (fires(&header->triggers[t], t, &slot)) sequence->slots[n].trigger_mask |= 1u << t;
    }
    for (unsigned n = 0; n < OLS_TRIGGERS; n++) sequence->inverted_triggers |= header->triggers[n].active_low << n;
    if (!check_lead(board, header, &slot, error) || !play_cycle(board, &schedule, sequence)) return false;
    sequence->slot_count = header->slot_count;
    return true;
}
