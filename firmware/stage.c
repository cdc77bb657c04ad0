// SPDX-License-Identifier: MIT
// Stage: the board's state, the loaded program, and what each command does.
#include "stage.h"

#include <string.h>

#include "board.h"
#include "fault.h"
#include "frame.h"
#include "player.h"
#include "receptor.h"
#include "sequence.h"
#include "text.h"
#include "trigger_log.h"
#include "witness.h"

enum { CHECKED_BYTES_A_TURN = 4096 };

static enum ols_state state;
static struct sequence sequences[2];
static struct sequence* current = &sequences[0];  // what is played, or would be
static struct sequence* spare = &sequences[1];    // where the next program is loaded
static enum ols_next next;                        // what is in the spare one
static struct ols_load_begin announced;           // of the program that is being loaded
static uint32_t loaded_bytes;
static uint32_t loaded_crc32;  // kept up chunk by chunk
static struct sequence_compiler compiler;
static bool compiling;
static uint32_t sequence_crc32[2];  // of all words of each sequence, once it is made
static uint32_t checked_bytes;      // of a sequence that is being checked, turn by turn
static uint32_t checked_crc32;
static uint64_t start_us;
static uint32_t stamps_read;
static uint32_t cycles_of_done;  // of the program that has played to its end
static enum ols_start_source started_by;
static uint32_t edges_seen, edges_missed;  // since start, where each cycle waits for one
static uint32_t heartbeat_ticks;           // 0: the host may be silent
static uint64_t heard_us;                  // when the host's last request came
static uint8_t programs_swapped;           // since start

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

static uint32_t sequence_bytes(const struct sequence* sequence) {
    return sequence->header.program_bytes + 4 * (2 + sequence->cycle_words);
}

// Goes on with the CRC of a sequence's words; true when it is complete. All at once would take half of the watchdog's
// time.
static bool check_words(const struct sequence* sequence) {
    const uint32_t left = sequence_bytes(sequence) - checked_bytes;
    const uint32_t now = left < CHECKED_BYTES_A_TURN ? left : CHECKED_BYTES_A_TURN;
    checked_crc32 = ols_crc32(checked_crc32, (const uint8_t*)sequence->words + checked_bytes, now);
    checked_bytes += now;
    return now == left;
}

static bool words_are_good(const struct sequence* sequence) {
    return checked_crc32 == sequence_crc32[sequence - sequences];
}

static void forget_next(void) {
    next = OLS_NEXT_NONE;
    compiling = false;
}

static void forget_programs(void) {
    state = OLS_STATE_IDLE;
    current->header = (struct ols_load_begin){0};
    forget_next();
}

// The spare program becomes the current one.
static void take_next(void) {
    struct sequence* const before = current;
    current = spare;
    spare = before;
    next = OLS_NEXT_NONE;
}

static void count_edges(void) {
    if (started_by != OLS_START_EACH_CYCLE_BY_EDGE) return;
    edges_missed = receptor_missed();
    edges_seen = receptor_edges();
}

static void stop_receptor(void) {
    if (state == OLS_STATE_WAITING || state == OLS_STATE_PLAYING) count_edges();
    receptor_stop();
}

// Play is over: a program that was ready to follow is the one to play next.
static void end_play(enum ols_state ended) {
    stop_receptor();
    player_stop();
    fault_note_idle();
    if (next == OLS_NEXT_READY || next == OLS_NEXT_SWAPPING) take_next();
    state = ended;
}

static void end_in_fault(enum ols_fault cause, uint64_t ticks) {
    stop_receptor();
    fault_latch(cause, trigger_log_slot(), ticks);
    forget_next();
    state = OLS_STATE_FAULT;
}

void stage_init(void) {
    forget_programs();
    trigger_log_begin(current, false);
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
        if (next == OLS_NEXT_SWAPPING) take_next();
        cycles_of_done = current->header.cycles;
        return end_play(OLS_STATE_DONE);
    }
    player_poll();
    if (next == OLS_NEXT_SWAPPING && !player_swapping()) take_next();
    fault_note_progress(trigger_log_slot(), now_ticks);
}

// The fault that a stop input, or the host's silence, means; OLS_FAULT_NONE when all is well. For the first two inputs it
// is dark already (pulse.pio, guard).
static enum ols_fault cause_from_outside(uint32_t stops, bool host_is_there) {
    if (stops & 1u << BOARD_EMERGENCY_STOP) return OLS_FAULT_EMERGENCY_STOP;
    if (stops & 1u << BOARD_OVER_TEMPERATURE) return OLS_FAULT_OVER_TEMPERATURE;
    if (stops & 1u << BOARD_OPEN_LAMP) return OLS_FAULT_OPEN_LAMP;
    if (!host_is_there) return OLS_FAULT_HOST_LOST;
    const uint64_t silent_ticks = (board_time_us() - heard_us) * BOARD_TICKS_PER_US;
    return heartbeat_ticks != 0 && silent_ticks > heartbeat_ticks ? OLS_FAULT_HEARTBEAT : OLS_FAULT_NONE;
}

static void begin_play(void) {
    start_us = board_time_us();
    state = OLS_STATE_PLAYING;
}

void stage_poll(bool host_is_there) {
    const uint32_t stops = board_stop_inputs();  // in every state: an edge that nobody takes would not let it sleep
    board_forget_genlock();
    if (state == OLS_STATE_ARMED || state == OLS_STATE_WAITING || state == OLS_STATE_PLAYING) {
        // First, for the program's own faults may be its consequences.
        const enum ols_fault cause = cause_from_outside(stops, host_is_there);
        if (cause != OLS_FAULT_NONE) {
            const bool playing = state == OLS_STATE_PLAYING;
            if (playing) read_witness();
            return end_in_fault(cause, playing ? ticks_since_start() : 0);
        }
    }
    if (state == OLS_STATE_WAITING || state == OLS_STATE_PLAYING) count_edges();
    // A cycle may be over, and the next one waited for, before this turn could see it play.
    if (state == OLS_STATE_WAITING && (edges_seen > 0 || !player_waiting())) begin_play();
    if (state == OLS_STATE_PLAYING) follow_play();
}

bool stage_load_begin(const struct ols_load_begin* begin, struct ols_error_reply* error) {
    if (state == OLS_STATE_ARMED || state == OLS_STATE_WAITING || state == OLS_STATE_FAULT)
        return refuse_state(error, "a program is armed: stop it, or start it, before loading another");
    if (next == OLS_NEXT_SWAPPING)
        return refuse_state(error, "a swap is under way: load when the status no longer says so");
    if (state == OLS_STATE_PLAYING)
        forget_next();
    else
        forget_programs();
    if (begin->program_bytes > sizeof spare->words)
        return refuse(error, OLS_ERROR_BAD_PROGRAM, "the program is too long for this board: send fewer slots");
    announced = *begin;
    next = OLS_NEXT_LOADING;
    loaded_bytes = 0;
    loaded_crc32 = 0;
    return true;
}

bool stage_load_chunk(uint32_t offset_bytes, const uint8_t* data, size_t data_bytes, struct ols_error_reply* error) {
    if (next != OLS_NEXT_LOADING || compiling)
        return refuse_state(error, "no program is being loaded: begin with load begin");
    if (offset_bytes != loaded_bytes || data_bytes > announced.program_bytes - loaded_bytes) {
        forget_next();
        return refuse(error, OLS_ERROR_BAD_OFFSET,
                      "chunks must follow each other and end with the program: load again");
    }
    memcpy((uint8_t*)spare->words + loaded_bytes, data, data_bytes);
    loaded_bytes += data_bytes;
    loaded_crc32 = ols_crc32(loaded_crc32, data, data_bytes);
    return true;
}

static bool program_has_arrived(struct ols_error_reply* error) {
    if (loaded_bytes != announced.program_bytes)
        return refuse(error, OLS_ERROR_BAD_OFFSET, "the program is not complete: load again");
    if (loaded_crc32 != announced.program_crc32)
        return refuse(error, OLS_ERROR_BAD_CRC, "the program arrived damaged (CRC): load again");
    return true;
}

// One turn's part of making the sequence; then one turn's part of its CRC.
static enum stage_answer make_sequence(struct ols_error_reply* error) {
    if (!compiling) {
        if (!program_has_arrived(error)) return STAGE_REFUSED;
        spare->header = announced;
        sequence_begin(&compiler, &board_sequence, spare);
        compiling = true;
    }
    if (spare->cycle_words == 0)
        return sequence_step(&compiler, error) == SEQUENCE_REFUSED ? STAGE_REFUSED : STAGE_BUSY;
    if (checked_bytes == 0) {
        // What was loaded has its CRC already.
        checked_bytes = loaded_bytes;
        checked_crc32 = loaded_crc32;
    }
    if (!check_words(spare)) return STAGE_BUSY;
    sequence_crc32[spare - sequences] = checked_crc32;
    return STAGE_OK;
}

enum stage_answer stage_load_end(struct ols_error_reply* error) {
    if (next != OLS_NEXT_LOADING) {
        refuse_state(error, "no program is being loaded: begin with load begin");
        return STAGE_REFUSED;
    }
    const enum stage_answer answer = make_sequence(error);
    if (answer == STAGE_BUSY) return answer;
    forget_next();
    if (answer == STAGE_REFUSED) return answer;
    next = OLS_NEXT_READY;
    if (state == OLS_STATE_PLAYING) return answer;
    take_next();
    state = OLS_STATE_LOADED;
    return answer;
}

void stage_begin_request(void) {
    heard_us = board_time_us();
    checked_bytes = 0;
    checked_crc32 = 0;
}

// What must be so before anything may be lit.
static bool arm_is_safe(const struct ols_arm* arm, struct ols_error_reply* error) {
    if (arm->heartbeat_ticks != 0 && arm->heartbeat_ticks < OLS_HEARTBEAT_TICKS_MIN)
        return refuse(error, OLS_ERROR_BAD_PROGRAM, "a heartbeat of less than 5 ms cannot be kept: choose more, or 0");
    if (arm->start_source > OLS_START_EACH_CYCLE_BY_EDGE || arm->reserved[0] || arm->reserved[1] || arm->reserved[2])
        return refuse(error, OLS_ERROR_BAD_PROGRAM,
                      "start_source is 0 (command), 1 (edge) or 2 (edges); reserved is 0");
    const bool debounces = arm->start_source == OLS_START_EACH_CYCLE_BY_EDGE;
    if (debounces ? arm->debounce_ticks < OLS_DEBOUNCE_TICKS_MIN || arm->debounce_ticks % 2 : arm->debounce_ticks != 0)
        return refuse(error, OLS_ERROR_BAD_PROGRAM,
                      "debounce_ticks is even and 4 at least with start_source 2, else 0");
    board_stop_inputs();  // forgets edges of the past
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
    if (checked_bytes == 0 && !arm_is_safe(arm, error)) return STAGE_REFUSED;
    if (!check_words(current)) return STAGE_BUSY;
    if (!words_are_good(current)) {
        end_in_fault(OLS_FAULT_BAD_MEMORY, 0);
        refuse_fault(error);
        return STAGE_REFUSED;
    }
    started_by = arm->start_source;
    trigger_log_begin(current, started_by == OLS_START_EACH_CYCLE_BY_EDGE);
    programs_swapped = 0;
    stamps_read = 0;
    edges_seen = edges_missed = 0;
    witness_arm(started_by);
    if (started_by == OLS_START_EACH_CYCLE_BY_EDGE) receptor_arm(arm->debounce_ticks);
    if (!player_arm(current, started_by)) {
        end_in_fault(OLS_FAULT_SHIFTER_STARVED, 0);
        refuse_fault(error);
        return STAGE_REFUSED;
    }
    heartbeat_ticks = arm->heartbeat_ticks;
    state = OLS_STATE_ARMED;
    return STAGE_OK;
}

bool stage_start(struct ols_error_reply* error) {
    if (state != OLS_STATE_ARMED) return refuse_state(error, "not armed: arm first");
    begin_play();
    witness_start();
    player_start();
    if (started_by == OLS_START_EACH_CYCLE_BY_EDGE) receptor_start();
    if (started_by != OLS_START_BY_COMMAND) state = OLS_STATE_WAITING;
    return true;
}

bool stage_stop(struct ols_error_reply* error) {
    if (state == OLS_STATE_IDLE || state == OLS_STATE_FAULT)
        return refuse_state(error, "nothing to stop: no program is loaded");
    const bool was_playing = state == OLS_STATE_PLAYING;
    end_play(OLS_STATE_LOADED);
    if (was_playing) read_witness();
    return true;
}

// Whether the next program can go on where this one leaves off: what the pins mean, and how a cycle begins, stays.
static bool next_fits(struct ols_error_reply* error) {
    bool fits = current->header.lead_ticks == spare->header.lead_ticks;
    for (int n = 0; n < OLS_TRIGGERS; n++)
        fits = fits && current->header.triggers[n].active_low == spare->header.triggers[n].active_low;
    return fits || refuse(error, OLS_ERROR_BAD_PROGRAM,
                          "lead_ticks and polarities of both programs must be the same to swap them");
}

enum stage_answer stage_swap(struct ols_swap_reply* reply, struct ols_error_reply* error) {
    if (state != OLS_STATE_PLAYING || next != OLS_NEXT_READY) {
        refuse_state(error, "nothing to swap: load the next program while one is playing");
        return STAGE_REFUSED;
    }
    if (started_by == OLS_START_EACH_CYCLE_BY_EDGE) {
        refuse_state(error, "cycles that wait for edges are not swapped: stop, and arm the next program");
        return STAGE_REFUSED;
    }
    if (!check_words(spare)) return STAGE_BUSY;
    if (!words_are_good(spare)) {
        end_in_fault(OLS_FAULT_BAD_MEMORY, ticks_since_start());
        refuse_fault(error);
        return STAGE_REFUSED;
    }
    if (!next_fits(error)) return STAGE_REFUSED;
    uint32_t after_cycles;
    if (!player_swap(spare, &after_cycles)) {
        refuse(error, OLS_ERROR_BAD_STATE, "the playing program ends before a swap: arm and start the next one then");
        return STAGE_REFUSED;
    }
    trigger_log_swap(spare, after_cycles);
    next = OLS_NEXT_SWAPPING;
    *reply = (struct ols_swap_reply){.after_cycles = after_cycles, .program = ++programs_swapped};
    return STAGE_OK;
}

bool stage_clear_fault(struct ols_error_reply* error) {
    if (state != OLS_STATE_FAULT) return refuse(error, OLS_ERROR_BAD_STATE, "no fault is latched: nothing to clear");
    fault_clear();
    forget_programs();
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
                                        .cycles_played = done ? cycles_of_done : trigger_log_cycle(),
                                        .log_entries_lost = trigger_log_lost(),
                                        .program_crc32 = current->header.program_crc32,
                                        .next = (uint8_t)next,
                                        .edges_seen = edges_seen,
                                        .edges_missed = edges_missed};
}
