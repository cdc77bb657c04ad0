// SPDX-License-Identifier: MIT
// CAN news: frames when something has changed, or is due again.
#include "can_news.h"

#include <string.h>

#include "board.h"
#include "can_bus.h"
#include "cycle_digest.h"
#include "stage.h"

enum { STATE_EVERY_US = 50000, HEALTH_EVERY_US = 1000000 };

static struct ols_canbus_state told_state;
static struct ols_canbus_health told_health;
static uint64_t state_due_us, health_due_us;
static struct ols_cycle_digest telling;
static unsigned parts_to_tell;  // of it

void can_news_init(void) {
    parts_to_tell = 0;
    state_due_us = health_due_us = 0;
}

static bool tell(enum ols_canbus_id id, const void* content) {
    struct can_bus_frame frame = {.id = (uint16_t)(id + BOARD_CAN_IDS), .length = sizeof frame.data};
    memcpy(frame.data, content, sizeof frame.data);
    return can_bus_send(&frame);
}

void can_news_tell_state(uint64_t now_us) {
    const struct ols_canbus_state state = stage_summary();
    const bool changed = state.state != told_state.state || state.fault != told_state.fault;
    if ((!changed && now_us < state_due_us) || !tell(OLS_CANBUS_STATE, &state)) return;
    told_state = state;
    state_due_us = now_us + STATE_EVERY_US;
}

static void tell_health(const struct isotp* isotp, uint64_t now_us) {
    const struct can_bus_health bus = can_bus_health();
    struct ols_canbus_health health = {.frames_lost = bus.frames_lost,
                                       .bus_offs = bus.bus_offs,
                                       .last_error = (uint8_t)isotp->last_error,
                                       .controller_flags = bus.controller_flags};
    for (int error = 0; error < ISOTP_ERRORS; error++)
        health.messages_lost = (uint16_t)(health.messages_lost + isotp->errors[error]);
    const bool changed = memcmp(&health, &told_health, sizeof health) != 0;
    if ((!changed && now_us < health_due_us) || !tell(OLS_CANBUS_HEALTH, &health)) return;
    told_health = health;
    health_due_us = now_us + HEALTH_EVERY_US;
}

static bool tell_rise(enum ols_canbus_id id, uint64_t rise_ticks) {
    return tell(id, &(struct ols_canbus_rise){.rise_ticks_low = (uint32_t)rise_ticks,
                                              .rise_ticks_high = (uint16_t)(rise_ticks >> 32),
                                              .cycle_low = (uint16_t)telling.cycle});
}

static bool tell_digest_part(void) {
    switch (parts_to_tell) {
        case 4:
            return tell(OLS_CANBUS_CYCLE, &(struct ols_canbus_cycle){.cycle = telling.cycle,
                                                                     .trigger_count = telling.trigger_count,
                                                                     .program = telling.program,
                                                                     .flags = telling.flags});
        case 3: return tell_rise(OLS_CANBUS_FIRST_RISE, telling.first_rise_ticks);
        case 2: return tell_rise(OLS_CANBUS_LAST_RISE, telling.last_rise_ticks);
        default:
            return tell(OLS_CANBUS_CYCLE_CRC,
                        &(struct ols_canbus_cycle_crc){.cycle = telling.cycle, .entries_crc32 = telling.entries_crc32});
    }
}

// In order; those overwritten before the bus had room for them are left out, not mixed up.
static void tell_digests(void) {
    for (;;) {
        if (parts_to_tell == 0) {
            if (!cycle_digest_tell(&telling)) return;
            parts_to_tell = 4;
        }
        if (!tell_digest_part()) return;
        parts_to_tell--;
    }
}

void can_news_tell_rest(const struct isotp* isotp, uint64_t now_us) {
    tell_health(isotp, now_us);
    tell_digests();
}
