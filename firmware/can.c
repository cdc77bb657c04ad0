// SPDX-License-Identifier: MIT
// CAN: messages as ISO-TP, one protocol frame each.
#include "can.h"

#include <string.h>

#include "board.h"
#include "can_bus.h"
#include "can_news.h"
#include "frame.h"
#include "isotp.h"

enum {
    // One block: the ring of received frames holds 3.5 ms of the fastest bus, five times the longest turn of the main loop,
    // and every flow control more costs the host's answering time, often a millisecond.
    BLOCK_FRAMES = 0
};

static struct isotp isotp;
static uint8_t message[OLS_FRAME_BYTES_MAX];
static uint16_t taken_bytes;  // of the message received
static bool there;
static bool host_heard;
static uint32_t sessions;
static uint16_t bus_offs_seen;

void can_init(void) {
    isotp_init(&isotp, message, sizeof message, BLOCK_FRAMES);
    taken_bytes = 0;
    host_heard = false;
    can_news_init();
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
        if (frame.id != OLS_CANBUS_TO_BOARD + BOARD_CAN_IDS) continue;
        host_heard = true;
        isotp_take_frame(&isotp, frame.data, frame.length, now_us);
    }
}

static void send_frames(uint64_t now_us) {
    struct can_bus_frame frame = {.id = OLS_CANBUS_TO_HOST + BOARD_CAN_IDS};
    while (can_bus_has_room() && (frame.length = isotp_next_frame(&isotp, frame.data, now_us)) > 0)
        can_bus_send(&frame);
}

void can_poll(void) {
    if (!there) return;
    const uint64_t now_us = board_time_us();
    can_bus_poll(now_us);
    take_frames(now_us);
    isotp_poll(&isotp, now_us);
    can_news_tell_state(now_us);  // before long messages take all the room
    send_frames(now_us);
    can_news_tell_rest(&isotp, now_us);
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
