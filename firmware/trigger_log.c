// SPDX-License-Identifier: MIT
// Trigger log: a ring of the last triggers. Slot and scheduled time follow from walking the sequence along with them.
#include "trigger_log.h"

#include <string.h>

#include "cycle_digest.h"
#include "pulse.h"
#include "schedule.h"

enum {
    LOG_ENTRIES = 1024,
    WATCHED_TRIGGER = 1 << 0  // TRIG0
};

// An entry as it is kept: its counter follows from its place.
struct kept {
    uint64_t rise_ticks;
    uint32_t cycle;
    uint16_t slot;
    uint8_t trigger_mask, program;
};

static struct kept entries[LOG_ENTRIES];
static const struct sequence* played;
static const struct sequence* next_played;  // from cycle swap_cycle of `played` on; null when no swap is due
static uint32_t swap_cycle;
static uint8_t program;
static uint32_t oldest;   // counter of the first entry kept
static uint32_t fired;    // counter that the next trigger gets
static uint32_t read_to;  // counter after the last entry the host has read
static uint32_t lost;
static uint32_t next_slot;        // where the search for the next trigger's slot begins
static uint32_t cycle;            // of next_slot
static uint64_t scheduled_ticks;  // light of next_slot since the light of slot 0 of cycle 0
static struct kept last;
static int64_t first_error_ticks;  // measured minus scheduled of the first trigger: where start is on the schedule
static bool cycles_wait;           // so that every cycle has its own first trigger

void trigger_log_begin(const struct sequence* sequence, bool wait) {
    played = sequence;
    cycles_wait = wait;
    next_played = NULL;
    oldest = fired = read_to = lost = next_slot = cycle = program = 0;
    scheduled_ticks = 0;
    last = (struct kept){.slot = OLS_NO_SLOT};
    cycle_digest_begin();
}

void trigger_log_swap(const struct sequence* next, uint32_t after_cycles) {
    next_played = next;
    swap_cycle = after_cycles;
}

static void step_slot(void) {
    scheduled_ticks += sequence_slots(played)[next_slot].period_ticks;
    if (++next_slot < played->header.slot_count) return;
    next_slot = 0;
    if (++cycle != swap_cycle || next_played == NULL) return;
    played = next_played;
    next_played = NULL;
    cycle = 0;
    program++;
}

static uint32_t triggers_of_next_slot(void) {
    return sequence_triggers(played, &sequence_slots(played)[next_slot]);
}

// Makes next_slot the next slot that fires the watched trigger; false when none of the cycle does, nor any of the
// programs' that follow it.
static bool find_slot(void) {
    const struct sequence* tried = played;
    for (uint32_t left = played->header.slot_count; left > 0 || next_played != NULL; left -= left > 0) {
        if (triggers_of_next_slot() & WATCHED_TRIGGER) return true;
        step_slot();
        if (tried == played) continue;
        tried = played;
        left = played->header.slot_count + 1;
    }
    return false;
}

// The stamp counts down once every WITNESS_COUNT_TICKS and wraps within about a minute; the upper bits are those that
// bring it next to now_ticks.
static uint64_t rise_from_stamp(uint32_t stamp, uint64_t now_ticks) {
    const uint64_t now_counts = now_ticks / WITNESS_COUNT_TICKS;
    const int32_t since = (int32_t)((uint32_t)now_counts - ~stamp);
    const int64_t counts = (int64_t)now_counts - since;
    return counts < 0 ? 0 : (uint64_t)counts * WITNESS_COUNT_TICKS;
}

static struct ols_trigger_log_entry entry_of(uint32_t counter) {
    const struct kept* const kept = &entries[counter % LOG_ENTRIES];
    return (struct ols_trigger_log_entry){.rise_ticks = kept->rise_ticks,
                                          .counter = counter,
                                          .cycle = kept->cycle,
                                          .slot = kept->slot,
                                          .trigger_mask = kept->trigger_mask,
                                          .program = kept->program};
}

bool trigger_log_add(uint32_t stamp, uint64_t now_ticks) {
    if (!find_slot()) return false;
    if (fired - oldest == LOG_ENTRIES && oldest++ >= read_to) lost++;
    const bool is_first = fired == 0 || (cycles_wait && cycle != last.cycle);
    last = (struct kept){.rise_ticks = rise_from_stamp(stamp, now_ticks),
                         .cycle = cycle,
                         .slot = (uint16_t)next_slot,
                         .trigger_mask = (uint8_t)triggers_of_next_slot(),
                         .program = program};
    entries[fired % LOG_ENTRIES] = last;
    const struct ols_trigger_log_entry entry = entry_of(fired);
    cycle_digest_add(&entry);
    const int64_t offset_ticks = sequence_trigger_offset_ticks(played, &sequence_slots(played)[next_slot], 0);
    const int64_t error_ticks = (int64_t)last.rise_ticks - (int64_t)scheduled_ticks - offset_ticks;
    if (is_first) first_error_ticks = error_ticks;
    fired++;
    step_slot();
    if (cycles_wait && find_slot() && cycle != last.cycle) cycle_digest_end(true);  // nobody knows when the next begins
    const int64_t slip_ticks = error_ticks - first_error_ticks;
    return slip_ticks <= SCHEDULE_TOLERANCE_TICKS && slip_ticks >= -SCHEDULE_TOLERANCE_TICKS;
}

void trigger_log_skip(uint32_t count) {
    const uint32_t unread_from = read_to > oldest ? read_to : oldest;
    lost += fired - unread_from + count;
    cycle_digest_skip();
    for (; count > 0 && find_slot(); count--) {
        step_slot();
        fired++;
    }
    oldest = fired;  // the entries kept are without gaps
}

void trigger_log_read(uint32_t first, uint16_t entries_max, struct ols_trigger_log_reply* header,
                      struct ols_trigger_log_entry* out) {
    if (first < oldest) first = oldest;
    if (first > fired) first = fired;
    uint32_t count = fired - first;
    if (count > entries_max) count = entries_max;
    for (uint32_t i = 0; i < count; i++) out[i] = entry_of(first + i);
    if (first + count > read_to) read_to = first + count;
    *header = (struct ols_trigger_log_reply){
        .first_counter = first, .next_counter = fired, .entries_lost = lost, .entry_count = (uint16_t)count};
}

uint32_t trigger_log_fired(void) {
    return fired;
}

uint32_t trigger_log_lost(void) {
    return lost;
}

uint16_t trigger_log_slot(void) {
    return last.slot;
}

uint32_t trigger_log_cycle(void) {
    return last.cycle;
}
