// SPDX-License-Identifier: MIT
// CAN: messages as ISO-TP, one protocol frame each, and telemetry.
#include "can.h"

#include <string.h>

#include "board.h"
#include "can_bus.h"
#include "cycle_digest.h"
#include "frame.h"
#include "isotp.h"
#include "stage.h"

enum {
    // One block: the ring of received frames holds 3.5 ms of the fastest bus, five times the longest turn of the main loop,
    // and every flow control more costs the host's answering time, often a millisecond.
    BLOCK_FRAMES = 0,
    STATE_EVERY_US = 50000,
    HEALTH_EVERY_US = 1000000,
    OF_THIS_BOARD = 16 * BOARD_CAN_NUMBER
};

static struct isotp isotp;
static uint8_t message[OLS_FRAME_BYTES_MAX];
static uint16_t taken_bytes;  // of the message received
static bool there;
static bool host_heard;
static uint32_t sessions;
static uint16_t bus_offs_seen;

static struct ols_canbus_state told_state;
static struct ols_canbus_health told_health;
static uint64_t state_due_us, health_due_us;
static struct ols_cycle_digest telling;
static unsigned parts_to_tell;  // of it

void can_init(void) {
    isotp_init(&isotp, message, sizeof message, BLOCK_FRAMES);
    taken_bytes = 0;
    host_heard = false;
    parts_to_tell = 0;
    state_due_us = health_due_us = 0;
    there = can_bus_init(BOARD_CAN_NUMBER);
}

bool can_is_there(void) {
    return there;
}

bool can_is_idle(void) {
    return !there || !can_bus_is_answered() || (can_bus_is_idle() && !isotp_is_sending(&isotp));
}

static void take_frames(uint64_t now_us) {
    for (struct can_bus_frame frame; can_bus_receive(&frame);) {
        if (frame.id != OLS_CANBUS_TO_BOARD + OF_THIS_BOARD) continue;
        host_heard = true;
        isotp_take_frame(&isotp, frame.data, frame.length, now_us);
    }
}

static bool tell(enum ols_canbus_id id, const void* content) {
    struct can_bus_frame frame = {.id = (uint16_t)(id + OF_THIS_BOARD), .length = sizeof frame.data};
    memcpy(frame.data, content, sizeof frame.data);
    return can_bus_send(&frame);
}

static void tell_state(uint64_t now_us) {
    const struct ols_canbus_state state = stage_summary();
    const bool changed = state.state != told_state.state || state.fault != told_state.fault;
    if ((!changed && now_us < state_due_us) || !tell(OLS_CANBUS_STATE, &state)) return;
    told_state = state;
    state_due_us = now_us + STATE_EVERY_US;
}

static void tell_health(uint64_t now_us) {
    const struct can_bus_health bus = can_bus_health();
    struct ols_canbus_health health = {.frames_lost = bus.frames_lost,
                                       .bus_offs = bus.bus_offs,
                                       .last_error = (uint8_t)isotp.last_error,
                                       .controller_flags = bus.controller_flags};
    for (int error = 0; error < ISOTP_ERRORS; error++)
        health.messages_lost = (uint16_t)(health.messages_lost + isotp.errors[error]);
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

static void send_frames(uint64_t now_us) {
    struct can_bus_frame frame = {.id = OLS_CANBUS_TO_HOST + OF_THIS_BOARD};
    while (can_bus_has_room() && (frame.length = isotp_next_frame(&isotp, frame.data, now_us)) > 0)
        can_bus_send(&frame);
}

void can_poll(void) {
    if (!there) return;
    const uint64_t now_us = board_time_us();
    can_bus_poll(now_us);
    take_frames(now_us);
    isotp_poll(&isotp, now_us);
    tell_state(now_us);  // before long messages take all the room
    send_frames(now_us);
    tell_health(now_us);
    tell_digests();
    if (can_bus_health().bus_offs == bus_offs_seen) return;
    // What was under way when the controller left the bus is not to be continued.
    bus_offs_seen = can_bus_health().bus_offs;
    sessions++;
    host_heard = false;
}

static bool is_attached(void) {
    return there && host_heard && can_bus_is_answered();
}

static uint32_t session(void) {
    return sessions;
}

static size_t receive(uint8_t* bytes) {
    const size_t left = isotp_message_bytes(&isotp) - (size_t)taken_bytes;
    const size_t byte_count = left < TRANSPORT_PACKET_BYTES ? left : TRANSPORT_PACKET_BYTES;
    memcpy(bytes, message + taken_bytes, byte_count);
    taken_bytes = (uint16_t)(taken_bytes + byte_count);
    if (byte_count == 0 || taken_bytes < isotp_message_bytes(&isotp)) return byte_count;
    isotp_release(&isotp);
    taken_bytes = 0;
    return byte_count;
}

static bool can_send(void) {
    return there && !isotp_is_sending(&isotp);
}

static void send(const uint8_t* bytes, size_t byte_count) {
    const uint64_t now_us = board_time_us();
    isotp_send(&isotp, bytes, (uint16_t)byte_count, now_us);
    send_frames(now_us);
}

const struct transport can_transport = {is_attached, session, receive, can_send, send};
