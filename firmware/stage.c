// SPDX-License-Identifier: MIT
// Stage: the board's state, the loaded program, and what each command does.
#include "stage.h"

#include <string.h>

#include "board.h"
#include "fault.h"
#include "frame.h"
#include "player.h"
#include "sequence.h"
#include "text.h"
#include "trigger_log.h"
#include "witness.h"

enum { PROGRAM_BYTES_MAX = OLS_SLOTS_MAX * sizeof(struct ols_slot) + SEQUENCE_PATTERN_WORDS_MAX * 4 };

static enum ols_state state;
static struct ols_load_begin header;  // of the program that is loaded, or being loaded
static bool loading;
static uint32_t loaded_bytes;
static uint32_t loaded_crc32;  // kept up chunk by chunk: all at once would take a third of the watchdog's time
static uint8_t program[PROGRAM_BYTES_MAX];
static struct sequence sequence;
static uint32_t sequence_crc32;
static uint64_t start_us;
static uint32_t stamps_read;

static bool refuse(struct ols_error_reply* error, enum ols_error_code code, const char* reason) {
    error->code = (uint16_t)code;
    error->slot = OLS_NO_SLOT;
    struct text text = text_in(error->text, sizeof error->text);
    text_append(&text, reason);
    return false;
}

static bool refuse_fault(struct ols_error_reply* error) {
    return refuse(error, OLS_ERROR_FAULT_LATCHED, "a fault is latched: read the status, then clear the fault");
}

static bool refuse_state(struct ols_error_reply* error, const char* reason) {
    return state == OLS_STATE_FAULT ? refuse_fault(error) : refuse(error, OLS_ERROR_BAD_STATE, reason);
}

static uint64_t ticks_since_start(void) {
    return (board_time_us() - start_us) * BOARD_TICKS_PER_US;
}

static uint32_t crc_of_sequence(void) {
    const uint32_t crc = ols_crc32(0, sequence.events, sequence.event_count * sizeof *sequence.events);
    return ols_crc32(crc, sequence.patterns, 4u * sequence.slot_count * sequence.pattern_words);
}

static void forget_program(void) {
    state = OLS_STATE_IDLE;
    loading = false;
    header = (struct ols_load_begin){0};
}

static void end_in_fault(enum ols_fault cause, uint64_t ticks) {
    fault_latch(cause, trigger_log_slot(), ticks);
    loading = false;
    state = OLS_STATE_FAULT;
}

void stage_init(void) {
    forget_program();
    trigger_log_begin(&sequence);
    if (fault_latched().cause != OLS_FAULT_NONE) state = OLS_STATE_FAULT;
}

// Reads the witness's stamps into the log. False when a trigger was not where it should be.
static bool read_witness(void) {
    const uint32_t seen = witness_count();
    if (seen - stamps_read > WITNESS_RING_STAMPS) {
        trigger_log_skip(seen - stamps_read - WITNESS_RING_STAMPS);
        stamps_read = seen - WITNESS_RING_STAMPS;
    }
    const uint64_t now_ticks = ticks_since_start();
    while (stamps_read != seen)
        if (!trigger_log_add(witness_stamp(stamps_read++), now_ticks)) return false;
    return true;
}

static void follow_play(void) {
    // Events first: when all cycles are played, all triggers have fired.
    const uint32_t events = player_events();
    const bool on_time = read_witness();
    const uint64_t now_ticks = ticks_since_start();
    if (events & PLAYER_TIMELINE_STARVED) return end_in_fault(OLS_FAULT_TIMELINE_STARVED, now_ticks);
    if (events & PLAYER_SHIFTER_STARVED) return end_in_fault(OLS_FAULT_SHIFTER_STARVED, now_ticks);
    if (!on_time) return end_in_fault(OLS_FAULT_SLIPPED, now_ticks);
    if (events & PLAYER_DONE) {
        player_stop();
        fault_note_idle();
        state = OLS_STATE_DONE;
        return;
    }
    fault_note_progress(trigger_log_slot(), now_ticks);
}

void stage_poll(bool host_is_there) {
    if (state == OLS_STATE_PLAYING) follow_play();
    if (host_is_there) return;
    if (state == OLS_STATE_PLAYING || state == OLS_STATE_ARMED)
        end_in_fault(OLS_FAULT_HOST_LOST, state == OLS_STATE_PLAYING ? ticks_since_start() : 0);
}

bool stage_load_begin(const struct ols_load_begin* begin, struct ols_error_reply* error) {
    if (state == OLS_STATE_ARMED || state == OLS_STATE_PLAYING || state == OLS_STATE_FAULT)
        return refuse_state(error, "a program is armed or playing: stop it before loading another");
    forget_program();
    if (begin->program_bytes > sizeof program)
        return refuse(error, OLS_ERROR_BAD_PROGRAM, "the program is too long for this board: send fewer slots");
    header = *begin;
    loading = true;
    loaded_bytes = 0;
    loaded_crc32 = 0;
    return true;
}

bool stage_load_chunk(uint32_t offset_bytes, const uint8_t* data, size_t data_bytes, struct ols_error_reply* error) {
    if (!loading) return refuse_state(error, "no program is being loaded: begin with load begin");
    if (offset_bytes != loaded_bytes || data_bytes > header.program_bytes - loaded_bytes) {
        forget_program();
        return refuse(error, OLS_ERROR_BAD_OFFSET,
                      "chunks must follow each other and end with the program: load again");
    }
    memcpy(program + loaded_bytes, data, data_bytes);
    loaded_bytes += data_bytes;
    loaded_crc32 = ols_crc32(loaded_crc32, data, data_bytes);
    return true;
}

static bool program_is_good(struct ols_error_reply* error) {
    if (loaded_bytes != header.program_bytes)
        return refuse(error, OLS_ERROR_BAD_OFFSET, "the program is not complete: load again");
    if (loaded_crc32 != header.program_crc32)
        return refuse(error, OLS_ERROR_BAD_CRC, "the program arrived damaged (CRC): load again");
    return sequence_compile(&board_sequence, &header, program, &sequence, error);
}

bool stage_load_end(struct ols_error_reply* error) {
    if (!loading) return refuse_state(error, "no program is being loaded: begin with load begin");
    loading = false;
    if (!program_is_good(error)) {
        forget_program();
        return false;
    }
    sequence_crc32 = crc_of_sequence();
    state = OLS_STATE_LOADED;
    return true;
}

bool stage_arm(struct ols_error_reply* error) {
    if (state != OLS_STATE_LOADED && state != OLS_STATE_DONE)
        return refuse_state(error, "no program is ready: load one, and stop what is armed or playing");
    if (crc_of_sequence() != sequence_crc32) {
        end_in_fault(OLS_FAULT_BAD_MEMORY, 0);
        return refuse_fault(error);
    }
    trigger_log_begin(&sequence);
    stamps_read = 0;
    witness_arm();
    if (!player_arm(&sequence)) {
        end_in_fault(OLS_FAULT_SHIFTER_STARVED, 0);
        return refuse_fault(error);
    }
    state = OLS_STATE_ARMED;
    return true;
}

bool stage_start(struct ols_error_reply* error) {
    if (state != OLS_STATE_ARMED) return refuse_state(error, "not armed: arm first");
    start_us = board_time_us();
    witness_start();
    player_start();
    state = OLS_STATE_PLAYING;
    return true;
}

bool stage_stop(struct ols_error_reply* error) {
    if (state == OLS_STATE_IDLE || state == OLS_STATE_FAULT)
        return refuse_state(error, "nothing to stop: no program is loaded");
    player_stop();
    if (state == OLS_STATE_PLAYING) read_witness();
    fault_note_idle();
    state = OLS_STATE_LOADED;
    return true;
}

bool stage_clear_fault(struct ols_error_reply* error) {
    if (state != OLS_STATE_FAULT) return refuse(error, OLS_ERROR_BAD_STATE, "no fault is latched: nothing to clear");
    fault_clear();
    forget_program();
    return true;
}

void stage_status(struct ols_status_reply* status) {
    const struct fault fault = fault_latched();
    const bool done = state == OLS_STATE_DONE;
    *status = (struct ols_status_reply){.state = (uint8_t)state,
                                        .fault = (uint8_t)fault.cause,
                                        .fault_slot = fault.slot,
                                        .boot_nonce = board_boot_nonce(),
                                        .fault_ticks = fault.ticks,
                                        .now_ticks = state == OLS_STATE_PLAYING ? ticks_since_start() : 0,
                                        .triggers_fired = trigger_log_fired(),
                                        .cycles_played = done ? header.cycles : trigger_log_cycle(),
                                        .log_entries_lost = trigger_log_lost(),
                                        .program_crc32 = header.program_crc32};
}
