// SPDX-License-Identifier: MIT
// CAN bus on Linux: can_bus.h between the firmware and a test that is the rest of the bus.
#include <string.h>

#include "board_host.h"
#include "can_bus.h"

enum { SENT_MAX = 1024 };

static struct {
    bool fitted, answered;
    struct can_bus_frame received[CAN_BUS_RECEIVED_MAX];
    unsigned received_count;
    struct can_bus_frame sent[SENT_MAX];
    unsigned sent_count;
    uint16_t bus_offs;
} bus;

void board_host_fit_can(bool fitted) {
    memset(&bus, 0, sizeof bus);
    bus.fitted = bus.answered = fitted;
}

bool board_host_can_put(uint16_t id, const uint8_t* data, uint8_t length) {
    if (bus.received_count == CAN_BUS_RECEIVED_MAX) return false;
    struct can_bus_frame* const frame = &bus.received[bus.received_count++];
    frame->id = id;
    frame->length = length;
    memcpy(frame->data, data, length);
    return true;
}

bool board_host_can_take(uint16_t* id, uint8_t data[8], uint8_t* length) {
    if (bus.sent_count == 0) return false;
    *id = bus.sent[0].id;
    *length = bus.sent[0].length;
    memcpy(data, bus.sent[0].data, *length);
    memmove(bus.sent, bus.sent + 1, --bus.sent_count * sizeof *bus.sent);
    return true;
}

void board_host_can_answer(bool answered) {
    bus.answered = answered;
}

void board_host_can_bus_off(void) {
    bus.bus_offs++;
}

// can_bus.h

bool can_bus_init(unsigned board_number) {
    (void)board_number;  // the test puts only what is for this board
    return bus.fitted;
}

bool can_bus_receive(struct can_bus_frame* frame) {
    if (bus.received_count == 0) return false;
    *frame = bus.received[0];
    memmove(bus.received, bus.received + 1, --bus.received_count * sizeof *bus.received);
    return true;
}

bool can_bus_has_room(void) {
    return bus.fitted && bus.sent_count < SENT_MAX;
}

bool can_bus_send(const struct can_bus_frame* frame) {
    if (!can_bus_has_room()) return false;
    bus.sent[bus.sent_count++] = *frame;
    return true;
}

bool can_bus_is_idle(void) {
    return true;  // every frame leaves at once
}

void can_bus_poll(uint64_t now_us) {
    (void)now_us;
}

bool can_bus_is_answered(void) {
    return bus.answered;
}

struct can_bus_health can_bus_health(void) {
    return (struct can_bus_health){.bus_offs = bus.bus_offs};
}
