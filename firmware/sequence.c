// SPDX-License-Identifier: MIT
// Sequence: validates a program and makes the words that pulse.pio plays.
//
// A cycle is a lead, and then for each slot a stretch of latch, a stretch of light, and a dark stretch:
//
//   LATCH    ______|~|_______________________________
//   LIGHT_EN ________|~~~~ exposure ~~~~|___________    light to light of the next slot: period_ticks, exactly
//   TRIGn    _____|~~~~ width ~~~~|_________________    from the light on, or wherever its offset puts it
//   chain         (this slot's pattern)  | next pattern being sent, from the light on, and waited for in the dark
//
// A grey slot is as many of these, back to back, as it has planes, each lit half as long as the one before it.
#include "sequence.h"

#include <string.h>

#include "events.h"
#include "pulse.h"
#include "text.h"

enum { KINDS_ALL = (1 << (OLS_DARK + 1)) - 1 };
enum { SLOTS_A_STEP = 16 };
_Static_assert((int)TIMELINE_ENTER_TICKS == (int)SLOT_CYCLE_END_TICKS, "a program may begin where another would go on");

const struct ols_slot* sequence_slots(const struct sequence* sequence) {
    return (const struct ols_slot*)sequence->words;
}

const uint32_t* sequence_patterns(const struct sequence* sequence) {
    return sequence->words + sequence->header.slot_count * sizeof(struct ols_slot) / 4;
}

uint32_t sequence_patterns_words(const struct sequence* sequence) {
    return (sequence->header.program_bytes - sequence->header.slot_count * sizeof(struct ols_slot)) / 4;
}

const uint32_t* sequence_enter(const struct sequence* sequence) {
    return sequence->words + sequence->header.program_bytes / 4;
}

uint32_t sequence_triggers(const struct sequence* sequence, const struct ols_slot* slot) {
    uint32_t fires = 0;
    for (unsigned n = 0; n < OLS_TRIGGERS; n++)
        if (!(sequence->header.triggers[n].skip_kinds >> slot->kind & 1)) fires |= slot->trigger_mask & 1u << n;
    return fires;
}

int64_t sequence_trigger_offset_ticks(const struct sequence* sequence, const struct ols_slot* slot, unsigned n) {
    return (int64_t)slot->trigger_offset_ticks + sequence->header.triggers[n].offset_ticks;
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

static bool check_patterns(const struct sequence_board* board, const struct ols_slot* slot, const uint32_t* patterns,
                           uint16_t number, struct ols_error_reply* error) {
    const uint16_t words = slot_pattern_words(board->chain_bits);
    for (uint32_t plane = 0; plane < slot_planes(slot); plane++)
        if (!pattern_is_empty_from(patterns + plane * words, words, board->chain_bits))
            return reject(error, number, "a pattern has bits past the end of the chain of ", board->chain_bits,
                          " bits");
    if (slot->kind == OLS_DARK && !pattern_is_empty_from(patterns, words, 0))
        return reject(error, number, "a dark slot must have an empty pattern of ", board->chain_bits, " zeros");
    return true;
}

static bool check_slot(const struct sequence_board* board, const struct ols_slot* slot, uint16_t number,
                       struct ols_error_reply* error) {
    const uint32_t gap_ticks = slot_gap_ticks();
    if (slot->kind > OLS_DARK) return reject(error, number, "unknown kind ", slot->kind, "");
    if (slot->trigger_mask >> OLS_TRIGGERS)
        return reject(error, number, "trigger mask ", slot->trigger_mask, ": 15 at most");
    if (slot->reserved != 0) return reject(error, number, "reserved field is ", slot->reserved, ": send 0");
    if (slot->planes > OLS_PLANES_MAX || (slot->kind == OLS_DARK && slot->planes > 1))
        return reject(error, number, "its planes are ", slot->planes, ": 8 at most, and none in a dark slot");
    const uint32_t units = (1u << slot_planes(slot)) - 1;
    if (slot->exposure_ticks / units < EVENTS_TICKS_MIN)
        return reject(error, number, "exposure must be at least ", EVENTS_TICKS_MIN * units, " ticks");
    if (slot->exposure_ticks % units != 0)
        return reject(error, number, "the exposure of a grey slot must be a multiple of ", units, " ticks");
    if (slot->period_ticks < gap_ticks || slot->period_ticks - gap_ticks < slot->exposure_ticks)
        return reject(error, number, "period must exceed the exposure by at least ", gap_ticks, " ticks");
    if (slot->period_ticks - gap_ticks < slot_busy_ticks(board, slot))
        return reject(error, number, "period must be at least ", slot_busy_ticks(board, slot) + gap_ticks,
                      " ticks, to send the next pattern");
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
    if (header->cycles > OLS_CYCLES_MAX)
        return reject(error, OLS_NO_SLOT, "a program counts ", OLS_CYCLES_MAX, " cycles at most: send 0 for endless");
    return check_triggers(header, error);
}

static bool check_length(const struct sequence* sequence, struct ols_error_reply* error) {
    const struct ols_load_begin* const header = &sequence->header;
    const uint32_t slots_bytes = header->slot_count * sizeof(struct ols_slot);
    uint32_t patterns = 0;
    for (uint32_t n = 0; n < header->slot_count && slots_bytes <= header->program_bytes; n++)
        patterns += slot_planes(&sequence_slots(sequence)[n]);
    const uint32_t program_bytes = slots_bytes + patterns * sequence->pattern_words * 4;
    if (header->program_bytes != program_bytes)
        return reject(error, OLS_NO_SLOT, "a program of such slots has ", program_bytes, " bytes");
    if (program_bytes / 4 >= SEQUENCE_WORDS_MAX - 1)
        return reject(error, OLS_NO_SLOT, "the program is longer than the board's ", 4 * SEQUENCE_WORDS_MAX,
                      " bytes: send fewer slots");
    return true;
}

// The lead comes from the end of the last slot, where nothing but waiting is left.
static bool check_lead(const struct sequence_board* board, const struct ols_load_begin* header,
                       const struct ols_slot* last, struct ols_error_reply* error) {
    const uint32_t lead_ticks_max = last->period_ticks - slot_gap_ticks() - slot_busy_ticks(board, last);
    if (header->lead_ticks != 0 && header->lead_ticks < EVENTS_TICKS_MIN)
        return reject(error, OLS_NO_SLOT, "lead_ticks must be 0 or at least ", EVENTS_TICKS_MIN, "");
    if (header->lead_ticks > lead_ticks_max)
        return reject(error, (uint16_t)(header->slot_count - 1), "its dark end leaves room for lead_ticks of ",
                      lead_ticks_max, ": end the cycle with a longer or a dark slot");
    return true;
}

static void place_pulse(struct sequence_compiler* compiler, unsigned n, uint16_t number, struct events_pulse* pulse) {
    const struct sequence* const sequence = compiler->sequence;
    const struct ols_slot* const slot = &sequence_slots(sequence)[number];
    struct sequence_trigger_place* const place = &compiler->triggers[n];
    const int64_t rise_ticks = (int64_t)place->light_ticks + sequence_trigger_offset_ticks(sequence, slot, n);
    const uint32_t width_ticks = sequence->header.triggers[n].width_ticks;
    if (rise_ticks < 0) {
        compiler->refused = !reject(compiler->error, number, "a trigger begins before the cycle: raise lead_ticks by ",
                                    (uint32_t)-rise_ticks, " or more");
    } else if ((uint64_t)rise_ticks < place->earliest_ticks) {
        compiler->refused = !reject(compiler->error, number, "its pulse overlaps an earlier one of trigger ", n, "");
    } else {
        const uint64_t rise = (uint64_t)rise_ticks;
        *pulse = (struct events_pulse){
            rise, rise + (width_ticks ? width_ticks : slot_span_ticks(compiler->board, slot)), number};
        place->earliest_ticks = pulse->fall_ticks + EVENTS_TICKS_MIN;
    }
}

static void next_pulse(void* context, unsigned n, struct events_pulse* pulse) {
    struct sequence_compiler* const compiler = context;
    const struct sequence* const sequence = compiler->sequence;
    struct sequence_trigger_place* const place = &compiler->triggers[n];
    *pulse = (struct events_pulse){EVENTS_NEVER, EVENTS_NEVER, 0};
    for (bool found = false; !found && place->next_slot < sequence->header.slot_count; place->next_slot++) {
        const struct ols_slot* const slot = &sequence_slots(sequence)[place->next_slot];
        found = sequence_triggers(sequence, slot) >> n & 1;
        if (found) place_pulse(compiler, n, (uint16_t)place->next_slot, pulse);
        place->light_ticks += slot->period_ticks;
    }
}

// Stretches of the light, plane by plane. What the last slot's dark ends with is the lead of the next cycle and the
// cycle's end.
static void play_slot(struct sequence_compiler* compiler, const struct ols_slot* slot, uint32_t number) {
    struct events* const events = &compiler->events;
    const struct ols_load_begin* const header = &compiler->sequence->header;
    const uint32_t sync_pin = number == 0 ? PIN_SYNC : 0;
    const uint32_t light_pin = slot->kind == OLS_DARK ? 0 : PIN_LIGHT_EN;
    const uint32_t planes = slot_planes(slot);
    uint32_t rest_ticks = slot->period_ticks - SLOT_LATCH_TICKS - slot_busy_ticks(compiler->board, slot);
    if (number + 1 == header->slot_count) rest_ticks -= header->lead_ticks + SLOT_CYCLE_END_TICKS;
    for (uint32_t plane = 0; plane < planes; plane++) {
        const uint32_t lit_ticks = slot_lit_ticks(slot, plane);
        const uint32_t sending_ticks = slot_sending_ticks(compiler->board, slot, plane);
        events_play(events, sync_pin | PIN_LATCH, TIMELINE_HOLD, SLOT_LATCH_TICKS);
        events_play(events, sync_pin | light_pin, TIMELINE_SHIFT, lit_ticks);
        if (sending_ticks > 0) events_play(events, sync_pin, TIMELINE_HOLD, sending_ticks);
        events_play(events, sync_pin, TIMELINE_SYNC, plane + 1 < planes ? EVENTS_TICKS_MIN : rest_ticks);
    }
}

static bool reject_limit(struct ols_error_reply* error, uint16_t slot, const char* reason, uint32_t figure,
                         const char* remedy) {
    reject(error, slot, reason, figure, remedy);
    error->code = OLS_ERROR_OVER_LIMIT;
    return false;
}

static bool add_light(struct sequence_compiler* compiler, const struct ols_slot* slot, const uint32_t* patterns,
                      uint16_t number) {
    const uint32_t lamps_max = compiler->board->limits.lamps_lit_max;
    const uint32_t words = compiler->sequence->pattern_words;
    for (uint32_t plane = 0; plane < slot_planes(slot); plane++)
        if (light_add(&compiler->use, patterns + plane * words, words, slot_lit_ticks(slot, plane)) > lamps_max)
            return reject_limit(compiler->error, number, "this board's supply lights ", lamps_max, " lamps at once");
    const uint32_t first_ticks = slot->kind == OLS_DARK ? 0 : slot_lit_ticks(slot, 0);
    if (first_ticks > compiler->sequence->longest_light_ticks) compiler->sequence->longest_light_ticks = first_ticks;
    return true;
}

static bool check_duty(const struct sequence_compiler* compiler) {
    const uint32_t permille_max = compiler->board->limits.lamp_duty_max_permille;
    uint32_t lamp;
    const uint64_t lit_ticks = light_longest_ticks(&compiler->use, &lamp);
    if (lit_ticks * 1000 > compiler->events.now_ticks * permille_max)
        return reject_limit(compiler->error, OLS_NO_SLOT,
                            "a lamp is lit for more of the cycle than its limit; chain bit ", lamp,
                            ": make the exposures shorter");
    return true;
}

static bool events_are_fine(struct sequence_compiler* compiler, uint16_t number) {
    const struct events* const events = &compiler->events;
    switch (events->problem) {
        case EVENTS_TOO_MANY:
            return reject(compiler->error, number, "program and events need more than the board's ",
                          4 * SEQUENCE_WORDS_MAX, " bytes: send fewer slots");
        case EVENTS_TOO_CLOSE:
            return reject(compiler->error, events->last_slot,
                          "an edge of a trigger must coincide with any other edge or be ", EVENTS_TICKS_MIN,
                          " ticks away");
        default: return true;
    }
}

void sequence_begin(struct sequence_compiler* compiler, const struct sequence_board* board, struct sequence* sequence) {
    *compiler = (struct sequence_compiler){.board = board, .sequence = sequence};
    sequence->pattern_words = slot_pattern_words(board->chain_bits);
    sequence->cycle_words = 0;
    sequence->longest_light_ticks = 0;
}

// All slots are known to be good: places the triggers, and plays the lead.
static bool begin_cycle(struct sequence_compiler* compiler) {
    struct sequence* const sequence = compiler->sequence;
    const struct ols_load_begin* const header = &sequence->header;
    const struct ols_slot* const last = &sequence_slots(sequence)[header->slot_count - 1];
    if (!check_lead(compiler->board, header, last, compiler->error)) return false;

    uint32_t* const enter = sequence->words + header->program_bytes / 4;
    *enter = TIMELINE_ENTER << 8 | (header->cycles - 1) << 13;
    for (unsigned n = 0; n < OLS_TRIGGERS; n++)
        compiler->triggers[n].light_ticks = (uint64_t)header->lead_ticks + SLOT_LATCH_TICKS;
    const uint32_t words_max = SEQUENCE_WORDS_MAX - header->program_bytes / 4 - 2;  // before and after the cycle
    events_begin(&compiler->events, enter + 1, words_max, next_pulse, compiler);
    if (header->lead_ticks > 0) events_play(&compiler->events, 0, TIMELINE_HOLD, header->lead_ticks);
    return !compiler->refused;
}

static bool end_cycle(struct sequence_compiler* compiler) {
    struct events* const events = &compiler->events;
    const struct ols_load_begin* const header = &compiler->sequence->header;
    for (unsigned n = 0; n < OLS_TRIGGERS; n++)
        if (events->pulses[n].fall_ticks > events->now_ticks && events->pulses[n].fall_ticks != EVENTS_NEVER)
            return reject(compiler->error, events->pulses[n].slot, "its pulse of trigger ", n,
                          " ends after the cycle: end the cycle with a longer slot");
    // SYNC is low here even in a cycle of one slot, so that each cycle has its rising edge.
    events_play(events, 0, header->cycles == 0 ? TIMELINE_HOLD : TIMELINE_CYCLE_END, SLOT_CYCLE_END_TICKS);
    if (!events_are_fine(compiler, (uint16_t)(header->slot_count - 1))) return false;
    compiler->sequence->cycle_words = events->word_count;
    events->words[events->word_count] = PIN_READY | TIMELINE_GENLOCK << 8;
    return check_duty(compiler);
}

static bool check_next_slot(struct sequence_compiler* compiler) {
    const struct sequence* const sequence = compiler->sequence;
    const uint16_t number = (uint16_t)compiler->slots_checked++;
    const struct ols_slot* const slot = &sequence_slots(sequence)[number];
    const uint32_t* const patterns = sequence_patterns(sequence) + compiler->next_pattern * sequence->pattern_words;
    if (!check_slot(compiler->board, slot, number, compiler->error)) return false;
    compiler->next_pattern += slot_planes(slot);
    return check_patterns(compiler->board, slot, patterns, number, compiler->error) &&
           add_light(compiler, slot, patterns, number);
}

static bool play_next_slot(struct sequence_compiler* compiler) {
    const uint16_t number = (uint16_t)compiler->slots_played++;
    play_slot(compiler, &sequence_slots(compiler->sequence)[number], number);
    return !compiler->refused && events_are_fine(compiler, number);
}

// First all slots are checked, for the triggers of one may reach into others; then they are played.
static enum sequence_progress check_some(struct sequence_compiler* compiler, uint32_t slot_count) {
    if (compiler->slots_checked == 0 && !(check_header(compiler->board, &compiler->sequence->header, compiler->error) &&
                                          check_length(compiler->sequence, compiler->error)))
        return SEQUENCE_REFUSED;
    for (int n = 0; n < SLOTS_A_STEP && compiler->slots_checked < slot_count; n++)
        if (!check_next_slot(compiler)) return SEQUENCE_REFUSED;
    return SEQUENCE_UNFINISHED;
}

static enum sequence_progress play_some(struct sequence_compiler* compiler, uint32_t slot_count) {
    if (compiler->slots_played == 0 && !begin_cycle(compiler)) return SEQUENCE_REFUSED;
    for (int n = 0; n < SLOTS_A_STEP && compiler->slots_played < slot_count; n++)
        if (!play_next_slot(compiler)) return SEQUENCE_REFUSED;
    if (compiler->slots_played < slot_count) return SEQUENCE_UNFINISHED;
    return end_cycle(compiler) ? SEQUENCE_MADE : SEQUENCE_REFUSED;
}

enum sequence_progress sequence_step(struct sequence_compiler* compiler, struct ols_error_reply* error) {
    compiler->error = error;
    const uint32_t slot_count = compiler->sequence->header.slot_count;
    const bool checking = compiler->slots_checked < slot_count || slot_count == 0;
    return checking ? check_some(compiler, slot_count) : play_some(compiler, slot_count);
}
