// SPDX-License-Identifier: MIT
// Fault: dark, latch, report. What a reset would wipe is kept in the board's three surviving words: a magic number with
// the cause and the slot, then the tick. The magic number is there while a program plays, so a hang needs no last
// words.
#include "fault.h"

#include "board.h"
#include "player.h"

enum { RECORD_MAGIC = 0x5d, RECORD_NONE = 0 };

static struct fault latched;

static void remember(enum ols_fault cause, uint16_t slot, uint64_t ticks) {
    board_remember((const uint32_t[3]){(uint32_t)RECORD_MAGIC << 24 | (uint32_t)cause << 16 | slot, (uint32_t)ticks,
                                       (uint32_t)(ticks >> 32)});
}

void fault_init(void) {
    uint32_t record[3];
    board_recall(record);
    latched = (struct fault){OLS_FAULT_NONE, OLS_NO_SLOT, 0};
    if (board_was_reset_by_watchdog()) {
        const bool known = record[0] >> 24 == RECORD_MAGIC;
        latched.cause = known ? (enum ols_fault)(record[0] >> 16 & 0xff) : OLS_FAULT_WATCHDOG;
        if (known) {
            latched.slot = (uint16_t)record[0];
            latched.ticks = (uint64_t)record[2] << 32 | record[1];
        }
    }
    fault_note_idle();
}

void fault_latch(enum ols_fault cause, uint16_t slot, uint64_t ticks) {
    player_stop();
    if (latched.cause == OLS_FAULT_NONE) latched = (struct fault){cause, slot, ticks};
    fault_note_idle();
}

struct fault fault_latched(void) {
    return latched;
}

bool fault_clear(void) {
    const bool is_dark = !board_light_is_on();
    latched = (struct fault){is_dark ? OLS_FAULT_NONE : OLS_FAULT_LIGHT_STUCK, OLS_NO_SLOT, 0};
    return is_dark;
}

void fault_note_progress(uint16_t slot, uint64_t ticks) {
    remember(OLS_FAULT_WATCHDOG, slot, ticks);
}

void fault_note_idle(void) {
    board_remember((const uint32_t[3]){RECORD_NONE, 0, 0});
}

void fault_in_exception(void) {
    board_dark();
    uint32_t record[3];
    board_recall(record);
    const bool playing = record[0] >> 24 == RECORD_MAGIC;
    remember(OLS_FAULT_PROCESSOR, playing ? (uint16_t)record[0] : OLS_NO_SLOT,
             playing ? (uint64_t)record[2] << 32 | record[1] : 0);
    board_reset();
}
