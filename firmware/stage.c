// SPDX-License-Identifier: MIT
// Stage: the board's state, the loaded program, and what each command does.
#include "stage.h"

#include <string.h>

#include "board.h"
#include "cycle_digest.h"
#include "fault.h"
#include "frame.h"
#include "light_watch.h"
#include "player.h"
#include "receptor.h"
#include "schedule.h"
#include "sequence.h"
#include "stop.h"
#include "text.h"
#include "trigger_log.h"
#include "witness.h"

enum { CHECKED_BYTES_A_TURN = 4096, RECHECKED_BYTES_A_TURN = 256 };
enum { STAMPS_A_LOOK = 16 };  // the log takes 8 us for a trigger, so that a hundred of them keep the player waiting

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
struct check {                      // of a sequence's words, turn by turn
    uint32_t bytes, crc32;
};
static struct check checked;    // for a request
static struct check rechecked;  // of the playing sequence, again and again
static uint64_t start_us;
static uint32_t stamps_read;
static uint32_t cycles_of_done;  // of the program that has played to its end
static enum ols_start_source started_by;
static uint32_t edges_seen, edges_missed;  // since start, where each cycle waits for one
static uint32_t heartbeat_us;              // 0: the host may be silent
static uint8_t programs_swapped;           // since start
static bool leaving;                       // for the boot loader

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

// Goes on with the CRC of a sequence's words; true when complete. All at once takes half of the watchdog's time.
static bool check_words(struct check* check, const struct sequence* sequence, uint32_t bytes_a_turn) {
    const uint32_t left = sequence_bytes(sequence) - check->bytes;
    const uint32_t now = left < bytes_a_turn ? left : bytes_a_turn;
    check->crc32 = ols_crc32(check->crc32, (const uint8_t*)sequence->words + check->bytes, now);
    check->bytes += now;
    return now == left;
}

static bool words_are_good(const struct check* check, const struct sequence* sequence) {
    return check->crc32 == sequence_crc32[sequence - sequences];
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
    rechecked = (struct check){0};
    struct sequence* const before = current;
    current = spare;
    spare = before;
    next = OLS_NEXT_NONE;
}

// Each edge begins a cycle, or came while one played and is missed. Reading takes longer than a cycle takes to begin after
// its edge, so with as many cycles before as after, all of them are of the edges read in between.
static void count_edges(void) {
    if (started_by != OLS_START_EACH_CYCLE_BY_EDGE) return;
    uint32_t cycles;
    do {
        cycles = player_cycles_begun();
        edges_seen = receptor_edges();
    } while (cycles != player_cycles_begun());
    edges_missed = edges_seen - cycles;
}

// While it and the player still know what they counted.
static void stop_receptor(void) {
    if (state == OLS_STATE_WAITING || state == OLS_STATE_PLAYING) count_edges();
    receptor_stop();
}

void stage_init(void) {
    leaving = false;
    stop_unguard();
    forget_programs();
    trigger_log_begin(current, false);
    if (fault_latched().cause != OLS_FAULT_NONE) state = OLS_STATE_FAULT;
}

// Reads the witness's stamps into the log. False when a trigger was not where it should be.
static bool read_witness(void) {
    const uint32_t seen = witness_count();
    cycle_digest_begin_turn(seen - stamps_read);
    if (seen - stamps_read > WITNESS_RING_STAMPS) {
        trigger_log_skip(seen - stamps_read - WITNESS_RING_STAMPS);
        stamps_read = seen - WITNESS_RING_STAMPS;
    }
    const uint64_t now_ticks = ticks_since_start();
    while (stamps_read != seen) {
        if (stamps_read % STAMPS_A_LOOK == 0) player_poll();
        if (!trigger_log_add(witness_stamp(stamps_read++), now_ticks)) return false;
    }
    return true;
}

static void latch(struct stop stop) {
    const bool playing = state == OLS_STATE_PLAYING;
    stop_receptor();
    if (playing) read_witness();
    fault_latch(stop.cause, trigger_log_slot(),
                playing && stop.us > start_us ? (stop.us - start_us) * BOARD_TICKS_PER_US : 0);
    cycle_digest_end(false);
    board_expect_message(0);
    forget_next();
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
    board_expect_message(0);
    stop_receptor();
    player_stop();
    fault_note_idle();
    if (next == OLS_NEXT_READY || next == OLS_NEXT_SWAPPING) take_next();
    state = ended;
    return true;
}

// Once more through the playing program's words, a part each turn: 94 KB take 376 turns.
static bool words_stay_good(void) {
    if (!check_words(&rechecked, current, RECHECKED_BYTES_A_TURN)) return true;
    const bool good = words_are_good(&rechecked, current);
    rechecked = (struct check){0};
    return good;
}

// All of the old program has been played, and its triggers are in the log: its slots may be overwritten. From the next
// light on the new program's limit holds.
static void end_swap(void) {
    take_next();
    schedule_settle();
    light_watch_allow(current->longest_light_ticks);
}

static void follow_play(void) {
    // Events first: when all cycles are played, all triggers have fired.
    const uint32_t events = player_events();
    // Likewise: what has been entered was entered after the old program's last trigger.
    player_poll();
    const bool swap_is_over = next == OLS_NEXT_SWAPPING && !player_swapping();
    const bool on_time = read_witness();
    if (events & PLAYER_TIMELINE_STARVED) return end_in_fault(OLS_FAULT_TIMELINE_STARVED);
    if (events & PLAYER_SHIFTER_STARVED) return end_in_fault(OLS_FAULT_SHIFTER_STARVED);
    if (!on_time) return end_in_fault(OLS_FAULT_SLIPPED);
    if (!words_stay_good()) return end_in_fault(OLS_FAULT_BAD_MEMORY);
    if (events & PLAYER_DONE) {
        if (next == OLS_NEXT_SWAPPING) take_next();
        cycles_of_done = current->header.cycles;
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
    start_us = board_time_us();
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
    if (checked.bytes == 0) checked = (struct check){loaded_bytes, loaded_crc32};  // which has its CRC already
    if (!check_words(&checked, spare, CHECKED_BYTES_A_TURN)) return STAGE_BUSY;
    sequence_crc32[spare - sequences] = checked.crc32;
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

void stage_begin_request(bool from_owner) {
    if (from_owner && stage_is_armed()) board_expect_message(heartbeat_us);
    checked = (struct check){0};
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
    if (!check_words(&checked, current, CHECKED_BYTES_A_TURN)) return STAGE_BUSY;
    if (!words_are_good(&checked, current)) {
        end_in_fault(OLS_FAULT_BAD_MEMORY);
        refuse_fault(error);
        return STAGE_REFUSED;
    }
    stop_guard();  // before the look at the inputs, so that no fall is between them
    if (!arm_is_safe(error)) {
        stop_unguard();
        return STAGE_REFUSED;
    }
    started_by = arm->start_source;
    const bool cycles_wait = started_by == OLS_START_EACH_CYCLE_BY_EDGE;
    trigger_log_begin(current, cycles_wait);
    schedule_begin(current, cycles_wait);
    programs_swapped = 0;
    stamps_read = 0;
    edges_seen = edges_missed = 0;
    witness_arm(started_by);
    if (cycles_wait) receptor_arm(arm->debounce_ticks);
    light_watch_arm(current->longest_light_ticks);
    rechecked = (struct check){0};
    if (!player_arm(current, started_by)) {
        end_in_fault(OLS_FAULT_SHIFTER_STARVED);
        refuse_fault(error);
        return STAGE_REFUSED;
    }
    heartbeat_us = arm->heartbeat_ticks / BOARD_TICKS_PER_US;
    board_expect_message(heartbeat_us);
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
    if (!end_play(OLS_STATE_LOADED)) return refuse_fault(error);
    if (was_playing) read_witness();
    cycle_digest_end(false);
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
    if (!check_words(&checked, spare, CHECKED_BYTES_A_TURN)) return STAGE_BUSY;
    if (!words_are_good(&checked, spare)) {
        end_in_fault(OLS_FAULT_BAD_MEMORY);
        refuse_fault(error);
        return STAGE_REFUSED;
    }
    if (!next_fits(error)) return STAGE_REFUSED;
    uint32_t after_cycles;
    if (spare->longest_light_ticks > current->longest_light_ticks) light_watch_allow(spare->longest_light_ticks);
    if (!player_swap(spare, &after_cycles)) {
        light_watch_allow(current->longest_light_ticks);
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
    return state == OLS_STATE_DONE ? cycles_of_done : trigger_log_cycle();
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
                                        .program_crc32 = current->header.program_crc32,
                                        .next = (uint8_t)next,
                                        .edges_seen = edges_seen,
                                        .edges_missed = edges_missed};
}
