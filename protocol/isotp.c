// SPDX-License-Identifier: MIT
// ISO-TP: both halves of a link, after ISO 15765-2:2016, chapter 9, with normal addressing and frames as short as they
// can be (no padding).
#include "isotp.h"

#include <string.h>

enum { PCI_SINGLE = 0x0, PCI_FIRST = 0x1, PCI_CONSECUTIVE = 0x2, PCI_FLOW_CONTROL = 0x3 };
enum { FLOW_CONTINUE = 0, FLOW_WAIT = 1, FLOW_OVERFLOW = 2, FLOW_NONE = 0xff };
enum { RECEIVE_IDLE, RECEIVE_CONSECUTIVE, RECEIVE_WHOLE };
enum { SEND_IDLE, SEND_BEGIN, SEND_AWAIT_FLOW, SEND_CONSECUTIVE };
enum { SINGLE_BYTES_MAX = 7, FIRST_BYTES = 6, CONSECUTIVE_BYTES = 7, SEPARATION_NONE = 0 };

static void count(struct isotp* isotp, enum isotp_error error) {
    isotp->last_error = error;
    isotp->errors[error]++;
}

void isotp_init(struct isotp* isotp, uint8_t* buffer, uint16_t capacity, uint8_t block_size) {
    *isotp = (struct isotp){.buffer = buffer, .capacity = capacity, .block_size = block_size, .flow_status = FLOW_NONE};
}

// Receiving

static void give_up_receiving(struct isotp* isotp, enum isotp_error error) {
    isotp->receive_state = RECEIVE_IDLE;
    isotp->flow_status = FLOW_NONE;
    count(isotp, error);
}

// Makes room for a new message; false when the last one is still there.
static bool begin_receiving(struct isotp* isotp) {
    if (isotp->receive_state == RECEIVE_CONSECUTIVE) give_up_receiving(isotp, ISOTP_UNEXPECTED);
    return isotp->receive_state == RECEIVE_IDLE;
}

static void take_single(struct isotp* isotp, const uint8_t* data, uint8_t data_bytes) {
    const uint8_t bytes = data[0] & 0xf;
    if (bytes == 0 || bytes >= data_bytes) return;
    if (!begin_receiving(isotp) || bytes > isotp->capacity) return count(isotp, ISOTP_BUFFER_OVERFLOW);
    memcpy(isotp->buffer, data + 1, bytes);
    isotp->receive_bytes = isotp->received = bytes;
    isotp->receive_state = RECEIVE_WHOLE;
}

static void take_first(struct isotp* isotp, const uint8_t* data, uint8_t data_bytes, uint64_t now_us) {
    const uint16_t bytes = (uint16_t)((data[0] & 0xf) << 8 | data[1]);
    const bool longer_than_can = bytes == 0;  // the length follows in 32 bits (9.6.3.1)
    if (data_bytes < ISOTP_FRAME_BYTES || (!longer_than_can && bytes <= SINGLE_BYTES_MAX)) return;
    if (!begin_receiving(isotp) || longer_than_can || bytes > isotp->capacity) {
        isotp->flow_status = FLOW_OVERFLOW;
        return count(isotp, ISOTP_BUFFER_OVERFLOW);
    }
    memcpy(isotp->buffer, data + 2, FIRST_BYTES);
    isotp->receive_bytes = bytes;
    isotp->received = FIRST_BYTES;
    isotp->receive_number = 1;
    isotp->receive_block_left = isotp->block_size;
    isotp->flow_status = FLOW_CONTINUE;
    isotp->receive_deadline_us = now_us + ISOTP_TIMEOUT_US;
    isotp->receive_state = RECEIVE_CONSECUTIVE;
}

static void take_consecutive(struct isotp* isotp, const uint8_t* data, uint8_t data_bytes, uint64_t now_us) {
    if (isotp->receive_state != RECEIVE_CONSECUTIVE) return;
    if ((data[0] & 0xf) != isotp->receive_number) return give_up_receiving(isotp, ISOTP_WRONG_SN);
    const uint16_t left = (uint16_t)(isotp->receive_bytes - isotp->received);
    const uint8_t bytes = left < CONSECUTIVE_BYTES ? (uint8_t)left : CONSECUTIVE_BYTES;
    if (data_bytes <= bytes) return;  // too short to be the one that is due
    memcpy(isotp->buffer + isotp->received, data + 1, bytes);
    isotp->received = (uint16_t)(isotp->received + bytes);
    isotp->receive_number = (isotp->receive_number + 1) & 0xf;
    isotp->receive_deadline_us = now_us + ISOTP_TIMEOUT_US;
    if (isotp->received == isotp->receive_bytes) {
        isotp->receive_state = RECEIVE_WHOLE;
    } else if (isotp->block_size != 0 && --isotp->receive_block_left == 0) {
        isotp->receive_block_left = isotp->block_size;
        isotp->flow_status = FLOW_CONTINUE;
    }
}

uint16_t isotp_message_bytes(const struct isotp* isotp) {
    return isotp->receive_state == RECEIVE_WHOLE ? isotp->receive_bytes : 0;
}

void isotp_release(struct isotp* isotp) {
    if (isotp->receive_state == RECEIVE_WHOLE) isotp->receive_state = RECEIVE_IDLE;
}

// Sending

static void give_up_sending(struct isotp* isotp, enum isotp_error error) {
    isotp->send_state = SEND_IDLE;
    count(isotp, error);
}

bool isotp_send(struct isotp* isotp, const uint8_t* message, uint16_t message_bytes, uint64_t now_us) {
    if (isotp->send_state != SEND_IDLE || message_bytes == 0 || message_bytes > ISOTP_MESSAGE_BYTES_MAX) return false;
    isotp->message = message;
    isotp->send_bytes = message_bytes;
    isotp->sent = 0;
    isotp->send_number = 1;
    isotp->waits = 0;
    isotp->send_due_us = now_us;
    isotp->send_deadline_us = now_us + ISOTP_TIMEOUT_US;
    isotp->send_state = SEND_BEGIN;
    return true;
}

bool isotp_is_sending(const struct isotp* isotp) {
    return isotp->send_state != SEND_IDLE;
}

// STmin (9.6.5.4): milliseconds, or hundreds of microseconds; what is reserved means the longest.
static uint32_t separation_us(uint8_t code) {
    if (code >= 0xf1 && code <= 0xf9) return (code - 0xf0u) * 100;
    return (code <= 0x7f ? code : 0x7fu) * 1000;
}

static void take_flow_control(struct isotp* isotp, const uint8_t* data, uint8_t data_bytes, uint64_t now_us) {
    if (isotp->send_state != SEND_AWAIT_FLOW || data_bytes < 3) return;
    switch (data[0] & 0xf) {
        case FLOW_CONTINUE:
            isotp->waits = 0;
            isotp->send_block_left = data[1];
            isotp->separation_us = separation_us(data[2]);
            isotp->send_due_us = now_us;
            isotp->send_deadline_us = now_us + ISOTP_TIMEOUT_US;
            isotp->send_state = SEND_CONSECUTIVE;
            return;
        case FLOW_WAIT:
            if (++isotp->waits > ISOTP_WAITS_MAX) return give_up_sending(isotp, ISOTP_WAIT_OVERRUN);
            isotp->send_deadline_us = now_us + ISOTP_TIMEOUT_US;
            return;
        case FLOW_OVERFLOW: return give_up_sending(isotp, ISOTP_BUFFER_OVERFLOW);
        default: return give_up_sending(isotp, ISOTP_INVALID_FS);
    }
}

void isotp_take_frame(struct isotp* isotp, const uint8_t* data, uint8_t data_bytes, uint64_t now_us) {
    if (data_bytes < 2 || data_bytes > ISOTP_FRAME_BYTES) return;
    isotp_poll(isotp, now_us);  // what comes too late is no part of a message any more
    switch (data[0] >> 4) {
        case PCI_SINGLE: return take_single(isotp, data, data_bytes);
        case PCI_FIRST: return take_first(isotp, data, data_bytes, now_us);
        case PCI_CONSECUTIVE: return take_consecutive(isotp, data, data_bytes, now_us);
        case PCI_FLOW_CONTROL: return take_flow_control(isotp, data, data_bytes, now_us);
        default: return;
    }
}

// The next piece of the message behind `head_bytes` of protocol information.
static uint8_t fill(struct isotp* isotp, uint8_t* data, uint8_t head_bytes) {
    const uint16_t left = (uint16_t)(isotp->send_bytes - isotp->sent);
    const uint8_t room = (uint8_t)(ISOTP_FRAME_BYTES - head_bytes);
    const uint8_t bytes = left < room ? (uint8_t)left : room;
    memcpy(data + head_bytes, isotp->message + isotp->sent, bytes);
    isotp->sent = (uint16_t)(isotp->sent + bytes);
    return (uint8_t)(head_bytes + bytes);
}

static uint8_t begin_message(struct isotp* isotp, uint8_t* data) {
    if (isotp->send_bytes <= SINGLE_BYTES_MAX) {
        data[0] = (uint8_t)isotp->send_bytes;
        isotp->send_state = SEND_IDLE;
        return fill(isotp, data, 1);
    }
    data[0] = (uint8_t)(PCI_FIRST << 4 | isotp->send_bytes >> 8);
    data[1] = (uint8_t)isotp->send_bytes;
    isotp->send_state = SEND_AWAIT_FLOW;
    return fill(isotp, data, 2);
}

static uint8_t continue_message(struct isotp* isotp, uint8_t* data, uint64_t now_us) {
    data[0] = (uint8_t)(PCI_CONSECUTIVE << 4 | isotp->send_number);
    const uint8_t bytes = fill(isotp, data, 1);
    isotp->send_number = (isotp->send_number + 1) & 0xf;
    isotp->send_due_us = now_us + isotp->separation_us;
    if (isotp->sent == isotp->send_bytes)
        isotp->send_state = SEND_IDLE;
    else if (isotp->send_block_left != 0 && --isotp->send_block_left == 0)
        isotp->send_state = SEND_AWAIT_FLOW;
    return bytes;
}

uint8_t isotp_next_frame(struct isotp* isotp, uint8_t data[ISOTP_FRAME_BYTES], uint64_t now_us) {
    if (isotp->flow_status != FLOW_NONE) {
        data[0] = (uint8_t)(PCI_FLOW_CONTROL << 4 | isotp->flow_status);
        data[1] = isotp->block_size;
        data[2] = SEPARATION_NONE;
        isotp->flow_status = FLOW_NONE;
        return 3;
    }
    if ((isotp->send_state != SEND_BEGIN && isotp->send_state != SEND_CONSECUTIVE) || now_us < isotp->send_due_us)
        return 0;
    const uint8_t bytes =
        isotp->send_state == SEND_BEGIN ? begin_message(isotp, data) : continue_message(isotp, data, now_us);
    isotp->send_deadline_us = now_us + ISOTP_TIMEOUT_US;
    return bytes;
}

void isotp_poll(struct isotp* isotp, uint64_t now_us) {
    if (isotp->receive_state == RECEIVE_CONSECUTIVE && now_us >= isotp->receive_deadline_us)
        give_up_receiving(isotp, ISOTP_TIMEOUT_CR);
    if (isotp->send_state != SEND_IDLE && now_us >= isotp->send_deadline_us)
        give_up_sending(isotp, isotp->send_state == SEND_AWAIT_FLOW ? ISOTP_TIMEOUT_BS : ISOTP_TIMEOUT_A);
}

uint64_t isotp_due_us(const struct isotp* isotp) {
    uint64_t due_us = UINT64_MAX;
    if (isotp->flow_status != FLOW_NONE) return 0;
    if (isotp->receive_state == RECEIVE_CONSECUTIVE) due_us = isotp->receive_deadline_us;
    if (isotp->send_state == SEND_IDLE) return due_us;
    const uint64_t send_us = isotp->send_state == SEND_AWAIT_FLOW ? isotp->send_deadline_us : isotp->send_due_us;
    return send_us < due_us ? send_us : due_us;
}
