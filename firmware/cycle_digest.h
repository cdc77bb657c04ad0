// SPDX-License-Identifier: MIT
// Cycle digests: what the trigger log says of each cycle, in 32 bytes, for links that are too slow for every entry.
#ifndef OLS_CYCLE_DIGEST_H
#define OLS_CYCLE_DIGEST_H

#include <stdbool.h>
#include <stdint.h>

#include "wire.h"

#ifdef __cplusplus
extern "C" {
#endif

// Forgets all of them, for a new start.
void cycle_digest_begin(void);

// Once each turn of the main loop, before its `entries` are added. At 20 000 triggers a second 35 come in the longest turn;
// more than 64 are not digested, so that the log does not fall behind: their cycles are incomplete.
void cycle_digest_begin_turn(uint32_t entries);

// Adds the next entry of the trigger log. The first of another cycle completes the digest before it.
void cycle_digest_add(const struct ols_trigger_log_entry* entry);

// Triggers were lost: the digest under way, and the one of the next entry, are incomplete.
void cycle_digest_skip(void);

// Play is over. The last cycle's digest is complete when all its triggers have fired.
void cycle_digest_end(bool whole_cycle);

// Copies up to `digests_max` digests from number `first` on (or the oldest still kept) and fills in the header.
void cycle_digest_read(uint32_t first, uint16_t digests_max, struct ols_digests_reply* header,
                       struct ols_cycle_digest* digests);

// For whoever tells them unasked: each once and in order, but for those that were overwritten meanwhile. False when all
// are told. It does not count as read.
bool cycle_digest_tell(struct ols_cycle_digest* digest);

#ifdef __cplusplus
}
#endif

#endif
