// SPDX-License-Identifier: MIT
// Trigger log: which slot each measured trigger belongs to, and whether it came when it should.
#ifndef OLS_TRIGGER_LOG_H
#define OLS_TRIGGER_LOG_H

#include <stdbool.h>
#include <stdint.h>

#include "sequence.h"

#ifdef __cplusplus
extern "C" {
#endif

// Empties the log for a new start of `sequence`, which must stay as it is while triggers are added. `cycles_wait`: each
// cycle begins whenever an edge comes, so only the triggers within a cycle have a schedule.
void trigger_log_begin(const struct sequence* sequence, bool cycles_wait);

// From the moment on that `after_cycles` of the sequence so far are over, the next one plays. Call it before the first
// trigger of that cycle is added.
void trigger_log_swap(const struct sequence* next, uint32_t after_cycles);

// Adds the next trigger. `stamp` is the witness's; `now_ticks` (since start, good to half a minute) tells how often the
// stamp has wrapped. False when the trigger is not at its scheduled distance from the first one, or from the first of
// its cycle where cycles wait.
bool trigger_log_add(uint32_t stamp, uint64_t now_ticks);

// Notes that `count` triggers fired whose stamps were overwritten before they were read.
void trigger_log_skip(uint32_t count);

// Copies up to `entries_max` entries from counter `first` on (or the oldest still kept) and fills in the header.
void trigger_log_read(uint32_t first, uint16_t entries_max, struct ols_trigger_log_reply* header,
                      struct ols_trigger_log_entry* entries);

// So far.
uint32_t trigger_log_fired(void);
uint32_t trigger_log_lost(void);
// Of the last trigger; slot OLS_NO_SLOT before the first.
uint16_t trigger_log_slot(void);
uint32_t trigger_log_cycle(void);

#ifdef __cplusplus
}
#endif

#endif
