// SPDX-License-Identifier: MIT
// Programs: the current one, which is played or would be, and the next one, which is loaded into memory of its own: nothing
// that happens to it touches the current one.
#ifndef OLS_PROGRAMS_H
#define OLS_PROGRAMS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "sequence.h"

#ifdef __cplusplus
extern "C" {
#endif

// Its header is all zero when there is none.
const struct sequence* programs_current(void);

// How far the next one has come; and it, when it is ready or swapping.
enum ols_next programs_next_state(void);
const struct sequence* programs_next(void);

// Without either, or without the next one.
void programs_forget(void);
void programs_forget_next(void);

// Loading the next one: announced, received chunk by chunk, and made ready to play, a part each turn of the main loop.
// Refused, with `error` filled in, it is gone, but for a call at the wrong time, which changes nothing.
bool programs_load_begin(const struct ols_load_begin* begin, struct ols_error_reply* error);
bool programs_load_chunk(uint32_t offset_bytes, const uint8_t* data, size_t data_bytes, struct ols_error_reply* error);
enum sequence_progress programs_load_end(struct ols_error_reply* error);

// Whether the next one can go on where the current one leaves off: what the pins mean, and how a cycle begins, stays.
bool programs_fit(struct ols_error_reply* error);

// The next one is to follow at the end of a cycle: none can be loaded until it has been taken.
void programs_swap(void);

// The next one becomes the current one, if it is ready or swapping.
void programs_take_next(void);

#ifdef __cplusplus
}
#endif

#endif
