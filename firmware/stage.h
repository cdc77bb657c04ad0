// SPDX-License-Identifier: MIT
// Stage: the board's state (wire.h, ols_state) and what each command does in it.
#ifndef OLS_STAGE_H
#define OLS_STAGE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "wire.h"

// Idle, or fault when the previous run ended in one.
void stage_init(void);

// Once each turn of the main loop: follows what player, witness and the stop inputs saw. `host_is_there` says whether
// anybody could stop the light.
void stage_poll(bool host_is_there);

// The answer to a command that may take more than a turn of the main loop: while it is busy, ask again in the next one.
enum stage_answer { STAGE_OK, STAGE_REFUSED, STAGE_BUSY };

// To be called before a command, or anything else that a host asks, is answered for the first time: a sign of life, if it
// comes from the host that armed.
void stage_begin_request(bool from_owner);

// Commands. False, or STAGE_REFUSED, with `error` filled in when refused; nothing has changed then, except that a program
// whose loading failed is gone.
bool stage_load_begin(const struct ols_load_begin* header, struct ols_error_reply* error);
bool stage_load_chunk(uint32_t offset_bytes, const uint8_t* data, size_t data_bytes, struct ols_error_reply* error);
enum stage_answer stage_load_end(struct ols_error_reply* error);
enum stage_answer stage_arm(const struct ols_arm* arm, struct ols_error_reply* error);
bool stage_start(struct ols_error_reply* error);
bool stage_stop(struct ols_error_reply* error);
enum stage_answer stage_swap(struct ols_swap_reply* reply, struct ols_error_reply* error);
bool stage_clear_fault(struct ols_error_reply* error);

// The firmware is to end, to be flashed: not while armed, waiting or playing. A fault is no obstacle. No command follows.
bool stage_leave(struct ols_error_reply* error);
bool stage_is_leaving(void);

void stage_status(struct ols_status_reply* status);

// The gist of the status, for everybody on the bus.
struct ols_canbus_state stage_summary(void);

// Armed, waiting for the edge that starts, or playing.
bool stage_is_armed(void);

// Dark, and the cause is latched, or the one that a handler has seen before; nothing in a fault.
void stage_fail(enum ols_fault cause);

#endif
