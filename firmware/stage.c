// SPDX-License-Identifier: MIT
// Stage: the board's state, and what each command does in it.
#include "stage.h"

#include "board.h"
#include "cycle_digest.h"
#include "edges.h"
#include "fault.h"
#include "heartbeat.h"
#include "light_watch.h"
#include "player.h"
#include "program_check.h"
#include "programs.h"
#include "refusal.h"
#include "schedule.h"
#include "stop.h"
#include "trigger_log.h"
#include "witness.h"

enum { STAMPS_A_LOOK = 16 };  // the log takes 8 us for a trigger, so that a hundred of them keep the player waiting

static enum ols_state state;
static struct play {
    uint64_t start_us;
    enum ols_start_source started_by;
    uint32_t stamps_read;
    uint32_t cycles_of_done;   // of the program that has played to its end
    uint8_t programs_swapped;  // in
} play;                        // since arm
static bool leaving;           // for the boot loader

static bool refuse_fault(struct ols_error_reply* error) {
    return refuse(error, OLS_ERROR_FAULT_LATCHED, "a fault is latched: read the status, then clear the fault");
}

static bool refuse_state(struct ols_error_reply* error, const char* reason) {
    return state == OLS_STATE_FAULT ? refuse_fault(error) : refuse(error, OLS_ERROR_BAD_STATE, reason);
}

static uint64_t ticks_since_start(void) {
    return (board_time_us() - play.start_us) * BOARD_TICKS_PER_US;
}

static void forget_programs(void) {
    state = OLS_STATE_IDLE;
    programs_forget();
}

void stage_init(void) {
    leaving = false;
    stop_unguard();
    heartbeat_end();
    edges_arm(OLS_START_BY_COMMAND, 0);
    forget_programs();
    trigger_log_begin(programs_current(), false);
    if (fault_latched().cause != OLS_FAULT_NONE) state = OLS_STATE_FAULT;
}

// Reads the witness's stamps into the log. False when a trigger was not where it should be.
static bool read_witness(void) {
    const uint32_t seen = witness_count();
    cycle_digest_begin_turn(seen - play.stamps_read);
    if (seen - play.stamps_read > WITNESS_RING_STAMPS) {
        trigger_log_skip(seen - play.stamps_read - WITNESS_RING_STAMPS);
        play.stamps_read = seen - WITNESS_RING_STAMPS;
    }
    const uint64_t now_ticks = ticks_since_start();
    while (play.stamps_read != seen) {
        if (play.stamps_read % STAMPS_A_LOOK == 0) player_poll();
        if (!trigger_log_add(witness_stamp(play.stamps_read++), now_ticks)) return false;
    }
    return true;
}

static void latch(struct stop stop) {
    const bool playing = state == OLS_STATE_PLAYING;
    edges_stop();
    if (playing) read_witness();
    fault_latch(stop.cause, trigger_log_slot(),
                playing && stop.us > play.start_us ? (stop.us - play.start_us) * BOARD_TICKS_PER_US : 0);
    cycle_digest_end(false);
    heartbeat_end();
    programs_forget_next();
    state = OLS_STATE_FAULT;
}

// Dark, and the cause is latched; or that of a handler, if it has come before.
static void end_in_fault(enum ols_fault cause) {
    stop_now(cause);
    const struct stop stop = stop_unguard();
    latch(stop.cause != OLS_FAULT_NONE ? stop : (struct stop){cause, board_time_us()});  // none: nothing was guarded
}

// Play is over: a program that was ready to follow is the one to play next. False when a handler has stopped it.
static bool end_play(enum ols_state ended) {
    const struct stop stop = stop_unguard();
    if (stop.cause != OLS_FAULT_NONE) {
        latch(stop);
        return false;
    }
    board_dark();  // first of all
    heartbeat_end();
    edges_stop();
    player_stop();
    fault_note_idle();
    programs_take_next();
    state = ended;
    return true;
}

// All of the old program has been played, and its triggers are in the log: its slots may be overwritten. From the next
// light on the new program's limit holds.
static void end_swap(void) {
    programs_take_next();
    program_check_begin_play();
    schedule_settle();
    light_watch_allow(programs_current()->longest_light_ticks);
}

static void follow_play(void) {
    // Events first: when all cycles are played, all triggers have fired.
    const uint32_t events = player_events();
    // Likewise: what has been entered was entered after the old program's last trigger.
    player_poll();
    const bool is_swapping = programs_next_state() == OLS_NEXT_SWAPPING;
    const bool swap_is_over = is_swapping && !player_swapping();
    const bool on_time = read_witness();
    if (events & PLAYER_TIMELINE_STARVED) return end_in_fault(OLS_FAULT_TIMELINE_STARVED);
    if (events & PLAYER_SHIFTER_STARVED) return end_in_fault(OLS_FAULT_SHIFTER_STARVED);
    if (!on_time) return end_in_fault(OLS_FAULT_SLIPPED);
    if (!program_check_turn_in_play(programs_current())) return end_in_fault(OLS_FAULT_BAD_MEMORY);
    if (events & PLAYER_DONE) {
        if (is_swapping) programs_take_next();
        play.cycles_of_done = programs_current()->header.cycles;
        end_play(OLS_STATE_DONE);
        cycle_digest_end(state == OLS_STATE_DONE);
        return;
    }
    if (swap_is_over) end_swap();
    fault_note_progress(trigger_log_slot(), ticks_since_start());
}

// What a level of the stop inputs, or the host's absence, means. Handlers have seen the change before (interrupts.h).
static enum ols_fault cause_from_outside(bool host_is_there) {
    const uint32_t stops = board_stop_inputs();
    if (stops & 1u << BOARD_EMERGENCY_STOP) return OLS_FAULT_EMERGENCY_STOP;
    if (stops & 1u << BOARD_OVER_TEMPERATURE) return OLS_FAULT_OVER_TEMPERATURE;
    if (stops & 1u << BOARD_OPEN_LAMP) return OLS_FAULT_OPEN_LAMP;
    return host_is_there ? OLS_FAULT_NONE : OLS_FAULT_HOST_LOST;
}

bool stage_is_armed(void) {
    return state == OLS_STATE_ARMED || state == OLS_STATE_WAITING || state == OLS_STATE_PLAYING;
}

void stage_fail(enum ols_fault cause) {
    if (state != OLS_STATE_FAULT) end_in_fault(cause);
}

static void begin_play(void) {
    play.start_us = board_time_us();
    state = OLS_STATE_PLAYING;
}

void stage_poll(bool host_is_there) {
    if (stage_is_armed()) {
        // First, for the program's own faults may be its consequences.
        const enum ols_fault cause = cause_from_outside(host_is_there);
        if (cause != OLS_FAULT_NONE) return end_in_fault(cause);
        if (stop_seen() != OLS_FAULT_NONE) return end_in_fault(stop_seen());
    }
    if (state == OLS_STATE_WAITING) board_watch_genlock();  // before the look at what it does
    edges_count();
    // A cycle may be over, and the next one waited for, before this turn could see it play.
    if (state == OLS_STATE_WAITING && (edges_seen() > 0 || !player_waiting())) begin_play();
    if (state == OLS_STATE_PLAYING) follow_play();
}

bool stage_load_begin(const struct ols_load_begin* begin, struct ols_error_reply* error) {
    if (state == OLS_STATE_ARMED || state == OLS_STATE_WAITING || state == OLS_STATE_FAULT)
        return refuse_state(error, "a program is armed: stop it, or start it, before loading another");
    if (state != OLS_STATE_PLAYING) forget_programs();
    return programs_load_begin(begin, error);
}

bool stage_load_chunk(uint32_t offset_bytes, const uint8_t* data, size_t data_bytes, struct ols_error_reply* error) {
    return state == OLS_STATE_FAULT ? refuse_fault(error) : programs_load_chunk(offset_bytes, data, data_bytes, error);
}

enum stage_answer stage_load_end(struct ols_error_reply* error) {
    if (state == OLS_STATE_FAULT) {
        refuse_fault(error);
        return STAGE_REFUSED;
    }
    switch (programs_load_end(error)) {
        case SEQUENCE_UNFINISHED: return STAGE_BUSY;
        case SEQUENCE_REFUSED: return STAGE_REFUSED;
        case SEQUENCE_MADE: break;
    }
    if (state == OLS_STATE_PLAYING) return STAGE_OK;
    programs_take_next();
    state = OLS_STATE_LOADED;
    return STAGE_OK;
}

void stage_begin_request(bool from_owner) {
    if (from_owner) heartbeat_renew();
    program_check_begin();
}

// A turn's part of reading a program's words once more. Damaged ones are a fault.
static enum stage_answer check_program(const struct sequence* program, struct ols_error_reply* error) {
    switch (program_check_turn(program)) {
        case PROGRAM_UNDECIDED: return STAGE_BUSY;
        case PROGRAM_GOOD: return STAGE_OK;
        case PROGRAM_DAMAGED: break;
    }
    end_in_fault(OLS_FAULT_BAD_MEMORY);
    refuse_fault(error);
    return STAGE_REFUSED;
}

static bool arm_is_valid(const struct ols_arm* arm, struct ols_error_reply* error) {
    if (arm->heartbeat_ticks != 0 && arm->heartbeat_ticks < OLS_HEARTBEAT_TICKS_MIN)
        return refuse(error, OLS_ERROR_BAD_PROGRAM, "a heartbeat of less than 5 ms cannot be kept: choose more, or 0");
    if (arm->start_source > OLS_START_EACH_CYCLE_BY_EDGE || arm->reserved[0] || arm->reserved[1] || arm->reserved[2])
        return refuse(error, OLS_ERROR_BAD_PROGRAM,
                      "start_source is 0 (command), 1 (edge) or 2 (edges); reserved is 0");
    const bool debounces = arm->start_source == OLS_START_EACH_CYCLE_BY_EDGE;
    const bool debounce_is_valid = debounces
                                       ? arm->debounce_ticks >= OLS_DEBOUNCE_TICKS_MIN && arm->debounce_ticks % 2 == 0
                                       : arm->debounce_ticks == 0;
    return debounce_is_valid ||
           refuse(error, OLS_ERROR_BAD_PROGRAM, "debounce_ticks is even and 4 at least with start_source 2, else 0");
}

// What must be so before anything may be lit.
static bool arm_is_safe(struct ols_error_reply* error) {
    if (board_light_is_on()) return refuse(error, OLS_ERROR_NOT_SAFE, FAULT_LIGHT_STUCK_TEXT);
    const uint32_t stops = board_stop_inputs();
    if (stops & 1u << BOARD_EMERGENCY_STOP)
        return refuse(error, OLS_ERROR_NOT_SAFE, "the emergency stop is pressed, or its wire is open: release it");
    return stops == 0 || refuse(error, OLS_ERROR_NOT_SAFE,
                                "a lamp driver reports a fault (over-temperature, open lamp), or its wire is open");
}

enum stage_answer stage_arm(const struct ols_arm* arm, struct ols_error_reply* error) {
    if (state != OLS_STATE_LOADED && state != OLS_STATE_DONE) {
        refuse_state(error, "no program is ready: load one, and stop what is armed or playing");
        return STAGE_REFUSED;
    }
    if (!arm_is_valid(arm, error)) return STAGE_REFUSED;
    const struct sequence* const current = programs_current();
    const enum stage_answer checked = check_program(current, error);
    if (checked != STAGE_OK) return checked;
    stop_guard();  // before the look at the inputs, so that no fall is between them
    if (!arm_is_safe(error)) {
        stop_unguard();
        return STAGE_REFUSED;
    }
    const enum ols_start_source start = arm->start_source;
    const bool cycles_wait = start == OLS_START_EACH_CYCLE_BY_EDGE;
    trigger_log_begin(current, cycles_wait);
    schedule_begin(current, cycles_wait);
    play = (struct play){.started_by = start};
    witness_arm(start);
    edges_arm(start, arm->debounce_ticks);
    light_watch_arm(current->longest_light_ticks);
    program_check_begin_play();
    if (!player_arm(current, start)) {
        end_in_fault(OLS_FAULT_SHIFTER_STARVED);
        refuse_fault(error);
        return STAGE_REFUSED;
    }
    heartbeat_begin(arm->heartbeat_ticks);
    state = OLS_STATE_ARMED;
    return STAGE_OK;
}

bool stage_start(struct ols_error_reply* error) {
    if (state != OLS_STATE_ARMED) return refuse_state(error, "not armed: arm first");
    begin_play();
    witness_start();
    player_start();
    edges_start();
    if (play.started_by != OLS_START_BY_COMMAND) state = OLS_STATE_WAITING;
    return true;
}

bool stage_stop(struct ols_error_reply* error) {
    if (state == OLS_STATE_IDLE || state == OLS_STATE_FAULT)
        return refuse_state(error, "nothing to stop: no program is loaded");
    const bool was_playing = state == OLS_STATE_PLAYING;
    if (!end_play(OLS_STATE_LOADED)) return refuse_fault(error);
    if (was_playing) read_witness();
    cycle_digest_end(false);
    return true;
}

enum stage_answer stage_swap(struct ols_swap_reply* reply, struct ols_error_reply* error) {
    if (state != OLS_STATE_PLAYING || programs_next_state() != OLS_NEXT_READY) {
        refuse_state(error, "nothing to swap: load the next program while one is playing");
        return STAGE_REFUSED;
    }
    if (play.started_by == OLS_START_EACH_CYCLE_BY_EDGE) {
        refuse_state(error, "cycles that wait for edges are not swapped: stop, and arm the next program");
        return STAGE_REFUSED;
    }
    const struct sequence* const next = programs_next();
    const enum stage_answer checked = check_program(next, error);
    if (checked != STAGE_OK) return checked;
    if (!programs_fit(error)) return STAGE_REFUSED;
    uint32_t after_cycles;
    const uint32_t longest_light_ticks = programs_current()->longest_light_ticks;
    if (next->longest_light_ticks > longest_light_ticks) light_watch_allow(next->longest_light_ticks);
    if (!player_swap(next, &after_cycles)) {
        light_watch_allow(longest_light_ticks);
        refuse(error, OLS_ERROR_BAD_STATE, "the playing program ends before a swap: arm and start the next one then");
        return STAGE_REFUSED;
    }
    trigger_log_swap(next, after_cycles);
    programs_swap();
    *reply = (struct ols_swap_reply){.after_cycles = after_cycles, .program = ++play.programs_swapped};
    return STAGE_OK;
}

bool stage_clear_fault(struct ols_error_reply* error) {
    if (state != OLS_STATE_FAULT) return refuse(error, OLS_ERROR_BAD_STATE, "no fault is latched: nothing to clear");
    if (!fault_clear()) return refuse(error, OLS_ERROR_NOT_SAFE, FAULT_LIGHT_STUCK_TEXT);
    forget_programs();
    return true;
}

bool stage_leave(struct ols_error_reply* error) {
    leaving = state != OLS_STATE_ARMED && state != OLS_STATE_WAITING && state != OLS_STATE_PLAYING;
    return leaving || refuse(error, OLS_ERROR_BAD_STATE, "a program is armed or playing: stop it before flashing");
}

bool stage_is_leaving(void) {
    return leaving;
}

static uint32_t cycles_played(void) {
    return state == OLS_STATE_DONE ? play.cycles_of_done : trigger_log_cycle();
}

struct ols_canbus_state stage_summary(void) {
    const struct fault fault = fault_latched();
    return (struct ols_canbus_state){.state = (uint8_t)state,
                                     .fault = (uint8_t)fault.cause,
                                     .fault_slot = fault.slot,
                                     .cycles_played = cycles_played()};
}

void stage_status(struct ols_status_reply* status) {
    const struct fault fault = fault_latched();
    *status = (struct ols_status_reply){.state = (uint8_t)state,
                                        .fault = (uint8_t)fault.cause,
                                        .fault_slot = fault.slot,
                                        .boot_nonce = board_boot_nonce(),
                                        .fault_ticks = fault.ticks,
                                        .now_ticks = state == OLS_STATE_PLAYING ? ticks_since_start() : 0,
                                        .triggers_fired = trigger_log_fired(),
                                        .cycles_played = cycles_played(),
                                        .log_entries_lost = trigger_log_lost(),
                                        .program_crc32 = programs_current()->header.program_crc32,
                                        .next = (uint8_t)programs_next_state(),
                                        .edges_seen = edges_seen(),
                                        .edges_missed = edges_missed()};
}
