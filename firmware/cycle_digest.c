// SPDX-License-Identifier: MIT
// Cycle digests: a ring of the last ones. The CRC is kept up entry by entry, 20 bytes of some 2.5 us.
#include "cycle_digest.h"

#include <stddef.h>

#include "frame.h"

enum { DIGESTS = 32, ENTRIES_A_TURN_MAX = 64 };

static struct ols_cycle_digest digests[DIGESTS];
static uint32_t oldest, made, read_to, lost;  // as in the trigger log
static uint32_t told;
static struct ols_cycle_digest under_way;  // without entries while its trigger_count is 0
static bool too_many;                      // entries in this turn
static bool gap;                           // entries before the next one are missing

void cycle_digest_begin(void) {
    oldest = made = read_to = lost = told = 0;
    under_way.trigger_count = 0;
    gap = false;
}

void cycle_digest_begin_turn(uint32_t entries) {
    too_many = entries > ENTRIES_A_TURN_MAX;
}

static void complete(uint8_t flags) {
    if (under_way.trigger_count == 0) return;
    under_way.flags |= flags;
    if (made - oldest == DIGESTS && oldest++ >= read_to) lost++;
    digests[made++ % DIGESTS] = under_way;
    under_way.trigger_count = 0;
}

void cycle_digest_add(const struct ols_trigger_log_entry* entry) {
    if (too_many) return cycle_digest_skip();
    if (under_way.cycle != entry->cycle || under_way.program != entry->program) complete(0);
    if (under_way.trigger_count == 0)
        under_way = (struct ols_cycle_digest){.first_rise_ticks = entry->rise_ticks,
                                              .first_counter = entry->counter,
                                              .cycle = entry->cycle,
                                              .program = entry->program};
    under_way.last_rise_ticks = entry->rise_ticks;
    under_way.entries_crc32 = ols_crc32(under_way.entries_crc32, entry, sizeof *entry);
    under_way.trigger_count++;
    if (gap) under_way.flags |= OLS_DIGEST_INCOMPLETE;
    gap = false;
}

void cycle_digest_skip(void) {
    if (under_way.trigger_count > 0) under_way.flags |= OLS_DIGEST_INCOMPLETE;
    gap = true;
}

void cycle_digest_end(bool whole_cycle) {
    complete(whole_cycle ? 0 : OLS_DIGEST_INCOMPLETE);
}

void cycle_digest_read(uint32_t first, uint16_t digests_max, struct ols_digests_reply* header,
                       struct ols_cycle_digest* out) {
    if (first < oldest) first = oldest;
    if (first > made) first = made;
    uint32_t count = made - first;
    if (count > digests_max) count = digests_max;
    for (uint32_t i = 0; i < count; i++) out[i] = digests[(first + i) % DIGESTS];
    if (first + count > read_to) read_to = first + count;
    *header = (struct ols_digests_reply){
        .first_digest = first, .next_digest = made, .digests_lost = lost, .digest_count = (uint16_t)count};
}

bool cycle_digest_tell(struct ols_cycle_digest* digest) {
    if (told < oldest) told = oldest;
    if (told == made) return false;
    *digest = digests[told++ % DIGESTS];
    return true;
}
