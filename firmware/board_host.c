// SPDX-License-Identifier: MIT
// Board on Linux: board.h, player.h, witness.h, receptor.h and the USB of usb.h without hardware. Time passes when the test
// says so, and triggers fire at their scheduled ticks; what PIO makes of the words is not imitated here, but tested on its
// own.
#include "board_host.h"

#include <stdlib.h>
#include <string.h>

#include "board.h"
#include "can.h"
#include "fault.h"
#include "healthy.h"
#include "light_watch.h"
#include "link.h"
#include "player.h"
#include "pulse.h"
#include "receptor.h"
#include "schedule.h"
#include "stage.h"
#include "stop.h"
#include "usb.h"
#include "witness.h"

enum { ANSWER_BYTES_MAX = 1 << 16 };

static struct {
    uint64_t time_us;
    uint32_t boots;
    bool bitten;
    uint32_t surviving[3];
    bool pins_connected;
    uint32_t stop_inputs;          // low now
    uint64_t message_until_us;     // 0: no message is expected
    uint32_t longest_light_ticks;  // that is allowed
    bool light_shorted;            // to the level that lights
    uint32_t healthy_changes;

    struct sequence* armed;
    const struct sequence* following;  // from cycle following_from on; null when no swap is due
    uint32_t following_from;
    bool playing;
    enum ols_start_source start;
    bool waiting;  // for GENLOCK
    uint32_t edges, cycles_begun;
    uint64_t start_ticks;
    uint64_t next_rise_ticks;  // of next_slot, on the board's clock
    uint32_t next_slot, cycle;
    uint32_t events;
    uint32_t stamps[WITNESS_RING_STAMPS];
    uint32_t stamp_count;
    bool shifter_starved;
    uint32_t delay_ticks;

    bool attached;
    uint32_t session;
    const uint8_t* incoming;
    size_t incoming_bytes;
    uint8_t answer[ANSWER_BYTES_MAX];
    size_t answer_bytes;
} board;

static uint64_t now_ticks(void) {
    return board.time_us * BOARD_TICKS_PER_US;
}

static void start_firmware(void) {
    board.boots++;
    player_stop();
    fault_init();
    stage_init();
    can_init();
}

void board_host_power_up(void) {
    memset(&board, 0, sizeof board);
    start_firmware();
}

void board_host_bite(void) {
    board.bitten = true;
    board.attached = false;
    start_firmware();
}

static bool turn_main_loop(void) {
    can_poll();
    stage_poll(link_host_is_there());
    const bool is_busy = link_poll();
    healthy_turn();
    return is_busy;
}

// Fires what is due until now.
static void play(void) {
    while (board.playing && board.next_rise_ticks <= now_ticks()) {
        const struct sequence* const sequence = board.armed;
        const struct ols_slot* const slot = &sequence_slots(sequence)[board.next_slot];
        if (board.pins_connected && sequence_triggers(sequence, slot) & 1) {
            const uint64_t rise = board.next_rise_ticks + board.delay_ticks - board.start_ticks +
                                  (uint64_t)sequence_trigger_offset_ticks(sequence, slot, 0);
            const uint32_t stamp = ~(uint32_t)(rise / WITNESS_COUNT_TICKS);
            board.stamps[board.stamp_count++ % WITNESS_RING_STAMPS] = stamp;
            if (!schedule_take(stamp)) stop_now(OLS_FAULT_SLIPPED);
            schedule_seek();
        }
        board.next_rise_ticks += slot->period_ticks;
        if (++board.next_slot < sequence->header.slot_count) continue;
        board.next_slot = 0;
        if (board.start == OLS_START_EACH_CYCLE_BY_EDGE) {
            board.playing = false;
            board.waiting = true;
        }
        if (++board.cycle == board.following_from && board.following) {
            board.armed = (struct sequence*)board.following;
            board.following = NULL;
            board.cycle = 0;
        } else if (board.cycle == sequence->header.cycles) {
            board.playing = board.waiting = false;
            board.events |= PLAYER_DONE;
        }
    }
}

void board_host_run_us(uint64_t us) {
    const uint64_t end_us = board.time_us + us;
    while (board.time_us < end_us) {
        board.time_us += end_us - board.time_us < 1000 ? end_us - board.time_us : 1000;
        play();
        if (board.message_until_us != 0 && board.time_us >= board.message_until_us) stop_now(OLS_FAULT_HEARTBEAT);
        turn_main_loop();
    }
}

void board_host_attach(void) {
    board.attached = true;
    board.session++;
}

void board_host_detach(void) {
    board.attached = false;
    if (link_usb_has_armed()) stop_now(OLS_FAULT_HOST_LOST);
}

size_t board_host_exchange(const uint8_t* bytes, size_t byte_count, uint8_t* answer, size_t answer_bytes_max) {
    board.incoming = bytes;
    board.incoming_bytes = byte_count;
    board.answer_bytes = 0;
    while ((turn_main_loop() || board.incoming_bytes > 0) && !link_is_leaving()) {
    }
    const size_t answer_bytes = board.answer_bytes < answer_bytes_max ? board.answer_bytes : answer_bytes_max;
    memcpy(answer, board.answer, answer_bytes);
    return answer_bytes;
}

void board_host_starve_timeline(void) {
    board.playing = false;
    board.events |= PLAYER_TIMELINE_STARVED;
    stop_now(OLS_FAULT_TIMELINE_STARVED);
}

void board_host_starve_shifter(void) {
    board.shifter_starved = true;
    if (!board.playing) return;
    board.events |= PLAYER_SHIFTER_STARVED;
    board.playing = false;
    stop_now(OLS_FAULT_SHIFTER_STARVED);
}

void board_host_delay_triggers(uint32_t ticks) {
    board.delay_ticks = ticks;
}

void board_host_corrupt_program(void) {
    board.armed->words[board.armed->header.program_bytes / 4 - 1] ^= 1;
}

void board_host_pull_stop_input(unsigned input, bool low) {
    board.stop_inputs &= ~(1u << input);
    static const enum ols_fault causes[] = {OLS_FAULT_EMERGENCY_STOP, OLS_FAULT_OVER_TEMPERATURE, OLS_FAULT_OPEN_LAMP};
    if (!low) return;
    board.stop_inputs |= 1u << input;
    stop_now(causes[input]);
}

void board_host_hold_light(uint32_t ticks) {
    if (ticks > board.longest_light_ticks) stop_now(OLS_FAULT_OVER_DUTY);
}

void board_host_short_light(bool shorted) {
    board.light_shorted = shorted;
}

uint32_t board_host_healthy_changes(void) {
    return board.healthy_changes;
}

bool board_host_pins_are_connected(void) {
    return board.pins_connected;
}

// board.h

void board_dark(void) {
    board.pins_connected = false;
}

void board_connect_pins(uint8_t inverted_triggers) {
    (void)inverted_triggers;  // nobody looks at pins here
    board.pins_connected = true;
}

uint32_t board_stop_inputs(void) {
    return board.stop_inputs;
}

void board_watch_stop_inputs(void) {
    // board_host_pull_stop_input tells of each fall.
}

void board_watch_genlock(void) {
    // Nobody sleeps here.
}

bool board_light_is_on(void) {
    return board.light_shorted || (board.pins_connected && board.playing);
}

void board_pulse_healthy(void) {
    board.healthy_changes++;
}

uint32_t board_hold_interrupts(void) {
    return 0;  // there are none
}

void board_release_interrupts(uint32_t held) {
    (void)held;
}

void board_expect_message(uint32_t within_us) {
    board.message_until_us = within_us == 0 ? 0 : board.time_us + within_us;
}

uint64_t board_time_us(void) {
    return board.time_us;
}

bool board_was_reset_by_watchdog(void) {
    return board.bitten;
}

_Noreturn void board_reset(void) {
    abort();
}

void board_remember(const uint32_t words[3]) {
    memcpy(board.surviving, words, sizeof board.surviving);
}

void board_recall(uint32_t words[3]) {
    memcpy(words, board.surviving, sizeof board.surviving);
}

void board_read_id(uint8_t id[8]) {
    memcpy(id, "no-flash", 8);
}

uint32_t board_boot_nonce(void) {
    return board.boots;
}

// player.h and witness.h

bool player_arm(const struct sequence* sequence, enum ols_start_source start) {
    board.start = start;
    board.next_slot = board.cycle = board.cycles_begun = 0;
    board.armed = (struct sequence*)sequence;  // board_host_corrupt_program writes through it
    board.events = 0;
    stop_connect_pins(0);
    if (!board.shifter_starved) return true;
    player_stop();
    return false;
}

static void begin_cycle(void) {
    board.waiting = false;
    board.playing = true;
    board.cycles_begun++;
    if (board.cycle == 0) board.start_ticks = now_ticks();
    board.next_rise_ticks = now_ticks() + SLOT_LATCH_TICKS;
}

void player_start(void) {
    board.waiting = board.start != OLS_START_BY_COMMAND;
    if (!board.waiting) begin_cycle();
}

uint32_t player_cycles_begun(void) {
    return board.cycles_begun;
}

bool player_waiting(void) {
    return board.waiting;
}

void board_host_genlock(void) {
    board.edges++;
    if (board.waiting) begin_cycle();
}

uint32_t player_events(void) {
    return board.events;
}

bool player_swap(const struct sequence* following, uint32_t* after_cycles) {
    *after_cycles = board.cycle + 2;
    if (board.armed->header.cycles != 0 && *after_cycles > board.armed->header.cycles) return false;
    board.following = following;
    board.following_from = *after_cycles;
    schedule_swap(following, *after_cycles);
    return true;
}

bool player_swapping(void) {
    return board.following != NULL;
}

void player_poll(void) {
    // play() follows the cycles.
}

void player_stop(void) {
    board_dark();
    board.playing = board.waiting = false;
    board.following = NULL;
    board.events = 0;
}

void witness_arm(enum ols_start_source start) {
    (void)start;  // play() stamps from the start of play on
    board.stamp_count = 0;
}

void witness_start(void) {
    // Counts from player_start on, which is the same moment here.
}

uint32_t witness_count(void) {
    return board.stamp_count;
}

uint32_t witness_stamp(uint32_t n) {
    return board.stamps[n % WITNESS_RING_STAMPS];
}

// receptor.h

void receptor_arm(uint32_t debounce_ticks) {
    (void)debounce_ticks;  // board_host_genlock's rises are debounced
    board.edges = 0;
}

void receptor_start(void) {
    // Counts from player_start on, which is the same moment here.
}

void receptor_stop(void) {
    // What has been counted stays.
}

uint32_t receptor_edges(void) {
    return board.edges;
}

// light_watch.h

void light_watch_arm(uint32_t longest_ticks) {
    board.longest_light_ticks = longest_ticks;
}

void light_watch_allow(uint32_t longest_ticks) {
    board.longest_light_ticks = longest_ticks;
}

// usb.h

static bool is_attached(void) {
    return board.attached;
}

static uint32_t session(void) {
    return board.session;
}

static size_t receive(uint8_t* bytes) {
    const size_t byte_count =
        board.incoming_bytes < TRANSPORT_PACKET_BYTES ? board.incoming_bytes : TRANSPORT_PACKET_BYTES;
    if (byte_count == 0) return 0;
    memcpy(bytes, board.incoming, byte_count);
    board.incoming += byte_count;
    board.incoming_bytes -= byte_count;
    return byte_count;
}

static bool can_send(void) {
    return true;
}

static void send(const uint8_t* bytes, size_t byte_count) {
    if (board.answer_bytes + byte_count > sizeof board.answer) return;  // like a host that reads no more
    memcpy(board.answer + board.answer_bytes, bytes, byte_count);
    board.answer_bytes += byte_count;
}

const struct transport usb_transport = {is_attached, session, receive, can_send, send};
