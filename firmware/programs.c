// SPDX-License-Identifier: MIT
// Programs: two sequences, of which either may be the current one.
#include "programs.h"

#include <string.h>

#include "board.h"
#include "frame.h"
#include "program_check.h"
#include "refusal.h"

static struct sequence sequences[2];
static struct sequence* current = &sequences[0];
static struct sequence* spare = &sequences[1];  // where the next one is loaded
static enum ols_next next;                      // what is in the spare one

static struct {
    struct ols_load_begin announced;
    struct program_crc received;  // kept up chunk by chunk, then over the words made
    bool complete;                // all has been received, and the words are being made
    struct sequence_compiler compiler;
} loading;

const struct sequence* programs_current(void) {
    return current;
}

enum ols_next programs_next_state(void) {
    return next;
}

const struct sequence* programs_next(void) {
    return spare;
}

void programs_forget_next(void) {
    next = OLS_NEXT_NONE;
    loading.complete = false;
}

void programs_forget(void) {
    current->header = (struct ols_load_begin){0};
    programs_forget_next();
}

bool programs_load_begin(const struct ols_load_begin* begin, struct ols_error_reply* error) {
    if (next == OLS_NEXT_SWAPPING)
        return refuse(error, OLS_ERROR_BAD_STATE, "a swap is under way: load when the status no longer says so");
    programs_forget_next();
    if (begin->program_bytes > sizeof spare->words)
        return refuse(error, OLS_ERROR_BAD_PROGRAM, "the program is too long for this board: send fewer slots");
    loading.announced = *begin;
    loading.received = (struct program_crc){0};
    next = OLS_NEXT_LOADING;
    return true;
}

static bool refuse_unannounced(struct ols_error_reply* error) {
    return refuse(error, OLS_ERROR_BAD_STATE, "no program is being loaded: begin with load begin");
}

bool programs_load_chunk(uint32_t offset_bytes, const uint8_t* data, size_t data_bytes, struct ols_error_reply* error) {
    struct program_crc* const received = &loading.received;
    if (next != OLS_NEXT_LOADING || loading.complete) return refuse_unannounced(error);
    if (offset_bytes != received->bytes || data_bytes > loading.announced.program_bytes - received->bytes) {
        programs_forget_next();
        return refuse(error, OLS_ERROR_BAD_OFFSET,
                      "chunks must follow each other and end with the program: load again");
    }
    memcpy((uint8_t*)spare->words + received->bytes, data, data_bytes);
    received->bytes += data_bytes;
    received->crc32 = ols_crc32(received->crc32, data, data_bytes);
    return true;
}

static bool has_arrived(struct ols_error_reply* error) {
    if (loading.received.bytes != loading.announced.program_bytes)
        return refuse(error, OLS_ERROR_BAD_OFFSET, "the program is not complete: load again");
    if (loading.received.crc32 != loading.announced.program_crc32)
        return refuse(error, OLS_ERROR_BAD_CRC, "the program arrived damaged (CRC): load again");
    return true;
}

// One turn's part of making the words; then one turn's part of their CRC.
static enum sequence_progress make_words(struct ols_error_reply* error) {
    if (!loading.complete) {
        if (!has_arrived(error)) return SEQUENCE_REFUSED;
        spare->header = loading.announced;
        sequence_begin(&loading.compiler, &board_sequence, spare);
        loading.complete = true;
    }
    if (spare->cycle_words == 0)
        return sequence_step(&loading.compiler, error) == SEQUENCE_REFUSED ? SEQUENCE_REFUSED : SEQUENCE_UNFINISHED;
    if (!program_crc_extend(&loading.received, spare, PROGRAM_CHECK_BYTES_A_TURN)) return SEQUENCE_UNFINISHED;
    spare->words_crc32 = loading.received.crc32;
    return SEQUENCE_MADE;
}

enum sequence_progress programs_load_end(struct ols_error_reply* error) {
    if (next != OLS_NEXT_LOADING) {
        refuse_unannounced(error);
        return SEQUENCE_REFUSED;
    }
    const enum sequence_progress progress = make_words(error);
    if (progress == SEQUENCE_UNFINISHED) return progress;
    programs_forget_next();
    if (progress == SEQUENCE_MADE) next = OLS_NEXT_READY;
    return progress;
}

bool programs_fit(struct ols_error_reply* error) {
    bool fit = current->header.lead_ticks == spare->header.lead_ticks;
    for (int n = 0; n < OLS_TRIGGERS; n++)
        fit = fit && current->header.triggers[n].active_low == spare->header.triggers[n].active_low;
    return fit || refuse(error, OLS_ERROR_BAD_PROGRAM,
                         "lead_ticks and polarities of both programs must be the same to swap them");
}

void programs_swap(void) {
    next = OLS_NEXT_SWAPPING;
}

void programs_take_next(void) {
    if (next != OLS_NEXT_READY && next != OLS_NEXT_SWAPPING) return;
    struct sequence* const before = current;
    current = spare;
    spare = before;
    next = OLS_NEXT_NONE;
}
