// SPDX-License-Identifier: MIT
// ISO-TP (ISO 15765-2): how a message of more than seven bytes travels in CAN frames of eight. One end of one pair of
// identifiers, as a state machine without clock, bus or allocation, so that board and host share it.
#ifndef OLS_ISOTP_H
#define OLS_ISOTP_H

#include <stdbool.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

enum {
    ISOTP_FRAME_BYTES = 8,
    ISOTP_MESSAGE_BYTES_MAX = 4095,  // what a first frame of CAN 2.0 can announce (9.6.3)
    ISOTP_TIMEOUT_US = 1000000,      // N_As, N_Bs, N_Cr (table 16)
    ISOTP_WAITS_MAX = 16             // N_WFTmax: "wait" in a row that a sender bears
};

// Why a message was given up: N_Result of 8.3.7, without N_OK's prefix.
enum isotp_error {
    ISOTP_OK = 0,
    ISOTP_TIMEOUT_A = 1,        // the bus did not take a frame in time
    ISOTP_TIMEOUT_BS = 2,       // no flow control came
    ISOTP_TIMEOUT_CR = 3,       // no consecutive frame came
    ISOTP_WRONG_SN = 4,         // a consecutive frame is missing, twice there or out of order
    ISOTP_INVALID_FS = 5,       // a flow status that does not exist
    ISOTP_UNEXPECTED = 6,       // a new message began before the end of this one
    ISOTP_WAIT_OVERRUN = 7,     // the receiver said "wait" too often
    ISOTP_BUFFER_OVERFLOW = 8,  // the receiver has no room: too long, or the message before was not taken yet
    ISOTP_ERRORS = 9
};

// Initialise with isotp_init. Only `last_error` and `errors` are for others to read.
struct isotp {
    uint8_t* buffer;  // of the message that is received
    uint16_t capacity;
    uint8_t block_size;  // announced to the sender: consecutive frames between flow controls, 0: all

    uint8_t receive_state, receive_number, receive_block_left;
    uint8_t flow_status;  // to be sent, or FLOW_NONE
    uint16_t receive_bytes, received;
    uint64_t receive_deadline_us;

    uint8_t send_state, send_number, send_block_left, waits;
    uint16_t send_bytes, sent;
    const uint8_t* message;  // that is sent
    uint32_t separation_us;
    uint64_t send_due_us, send_deadline_us;

    enum isotp_error last_error;
    uint16_t errors[ISOTP_ERRORS];  // messages given up, by reason
};

// `buffer` takes messages of up to `capacity` bytes and stays in use.
void isotp_init(struct isotp* isotp, uint8_t* buffer, uint16_t capacity, uint8_t block_size);

// Begins to send. False while another message is being sent, or when this one is empty or too long. `message` must stay
// as it is until isotp_is_sending says no; whether it arrived is not known then, only that nobody refused it.
bool isotp_send(struct isotp* isotp, const uint8_t* message, uint16_t message_bytes, uint64_t now_us);
bool isotp_is_sending(const struct isotp* isotp);

// A frame has come from the other end. Frames that are none of ISO-TP's are ignored, as 9.8.2 wants.
void isotp_take_frame(struct isotp* isotp, const uint8_t* data, uint8_t data_bytes, uint64_t now_us);

// The next frame to put on the bus: its bytes to `data`, or 0 when there is none now. Ask only when the bus takes it.
uint8_t isotp_next_frame(struct isotp* isotp, uint8_t data[ISOTP_FRAME_BYTES], uint64_t now_us);

// Gives up what is overdue. Call it now and then, at the latest when isotp_due_us says.
void isotp_poll(struct isotp* isotp, uint64_t now_us);

// When there will be a frame to send or something overdue; UINT64_MAX: not by itself.
uint64_t isotp_due_us(const struct isotp* isotp);

// Bytes of the whole message in the buffer, 0 while there is none. It stays until released, and others are refused.
uint16_t isotp_message_bytes(const struct isotp* isotp);
void isotp_release(struct isotp* isotp);

#ifdef __cplusplus
}
#endif

#endif
