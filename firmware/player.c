// SPDX-License-Identifier: MIT
// Player: PIO block 0 with the timeline and the shifter of pulse.pio, each with a cycle feed.
#include "player.h"

#include <stddef.h>

#include "board.h"
#include "cycle_feed.h"
#include "events.h"
#include "pio.h"
#include "pulse.h"
#include "schedule.h"
#include "stop.h"

enum { SHIFTER_ORIGIN = TIMELINE_WORDS, GUARD_ORIGIN = SHIFTER_ORIGIN + SHIFTER_WORDS };
enum { FLAG_SEND = 4, FLAG_SENT = 5, FLAGS_ALL = 0xff, FLAGS_FOR_PROCESSOR = 7 };
enum { READY_BIT = 7 };            // of the timeline's pins
enum { SHIFT_TIMEOUT_US = 1000 };  // 40 times what a chain of 256 bits takes
_Static_assert(GUARD_ORIGIN + GUARD_WORDS <= 32, "all programs fit the block's instruction memory");
_Static_assert(TIMELINE_HALT == 0, "a starved FIFO jumps to the word 0");
_Static_assert(PIN_READY == 1 << READY_BIT, "READY is where the words for a wait have it");

static const struct pio_machine timeline = {PIO0_BASE, 0};
static const struct pio_machine shifter = {PIO0_BASE, 1};
static const struct pio_machine guards[] = {{PIO0_BASE, 2}, {PIO0_BASE, 3}};  // of the first stop inputs
#define TIMELINE_SHIFT_CONTROL (PIO_SHIFT_JOIN_TX | PIO_SHIFT_OUT_RIGHT)
#define SHIFTER_SHIFT_CONTROL PIO_SHIFT_JOIN_TX

// The feeds are never so many cycles apart: a FIFO of 8 words holds two of the shortest cycles.
enum { FEEDS_APART = 16, RING_USED = CYCLE_FEED_RING - FEEDS_APART };

#define IN_RINGS __attribute__((section(".rings"), aligned(4 * CYCLE_FEED_RING)))
static uint32_t timeline_counts[CYCLE_FEED_RING] IN_RINGS;
static const uint32_t* timeline_tables[CYCLE_FEED_RING] IN_RINGS;
static uint32_t shifter_counts[CYCLE_FEED_RING] IN_RINGS;
static const uint32_t* shifter_tables[CYCLE_FEED_RING] IN_RINGS;
static const struct cycle_feed timeline_feed = {{PIO0_BASE, 0},  DMA_REQUEST_PIO0_TX0, 0, 1, 2,
                                                timeline_counts, timeline_tables};
static const struct cycle_feed shifter_feed = {{PIO0_BASE, 1}, DMA_REQUEST_PIO0_TX1, 3, 5, 6,
                                               shifter_counts, shifter_tables};

static const struct sequence* playing;
static enum ols_start_source started_by;
static uint32_t playing_from;        // cycle of the feeds, since arm, in which `playing` began
static uint32_t begun;               // cycles begun by the feed that is ahead, since arm
static const struct sequence* next;  // follows from cycle next_from on; null when the ring has no cycle of another
static uint32_t next_from;
static bool entering;  // from player_swap until the timeline has taken the next one's first word

void player_init(void) {
    static const uint16_t timeline_program[] = TIMELINE_PROGRAM;
    static const uint16_t shifter_program[] = SHIFTER_PROGRAM;
    static const uint16_t guard_program[] = GUARD_PROGRAM;
    pio_load(PIO0_BASE, 0, timeline_program, TIMELINE_WORDS);
    pio_load(PIO0_BASE, SHIFTER_ORIGIN, shifter_program, SHIFTER_WORDS);
    pio_load(PIO0_BASE, GUARD_ORIGIN, guard_program, GUARD_WORDS);

    PIO_SM_CLKDIV(PIO0_BASE, timeline.machine) = PIO_CLKDIV(1);
    PIO_SM_EXECCTRL(PIO0_BASE, timeline.machine) = PIO_EXEC_WRAP(TIMELINE_WRAP_TARGET, TIMELINE_WRAP);
    PIO_SM_CLKDIV(PIO0_BASE, shifter.machine) = PIO_CLKDIV(BOARD_SHIFT_DIVIDER);
    PIO_SM_EXECCTRL(PIO0_BASE, shifter.machine) =
        PIO_EXEC_WRAP(SHIFTER_ORIGIN + SHIFTER_WRAP_TARGET, SHIFTER_ORIGIN + SHIFTER_WRAP) |
        PIO_EXEC_STATUS_TX_BELOW(slot_pattern_words(BOARD_CHAIN_BITS));
    PIO_SM_PINCTRL(PIO0_BASE, shifter.machine) = PIO_PINS_OUT(BOARD_PIN_DATA, 1) | PIO_PINS_SIDE(BOARD_PIN_CLK, 1);

    for (uint32_t n = 0; n < 2; n++) {
        PIO_SM_CLKDIV(PIO0_BASE, guards[n].machine) = PIO_CLKDIV(1);
        PIO_SM_EXECCTRL(PIO0_BASE, guards[n].machine) =
            PIO_EXEC_WRAP(GUARD_ORIGIN + GUARD_WRAP_TARGET, GUARD_ORIGIN + GUARD_WRAP);
        PIO_SM_PINCTRL(PIO0_BASE, guards[n].machine) =
            PIO_PINS_OUT(BOARD_PIN_TIMELINE, 8) | PIO_PINS_IN(BOARD_PIN_STOP_INPUTS + n);
    }

    player_stop();
}

// Gives every cycle in first..end-1 to the sequence; each ends with the wait for the next one's edge where it has one.
static void set_cycles(const struct sequence* sequence, uint32_t first, uint32_t end) {
    const uint32_t waits = started_by == OLS_START_EACH_CYCLE_BY_EDGE;
    for (uint32_t n = first; n != end; n++) {
        cycle_feed_set(&timeline_feed, n, sequence_enter(sequence) + 1, sequence->cycle_words + waits);
        cycle_feed_set(&shifter_feed, n, sequence_patterns(sequence), sequence_patterns_words(sequence));
    }
}

static bool send_first_pattern(void) {
    REGISTER_SET(PIO_CTRL(PIO0_BASE)) = PIO_CTRL_ENABLE(shifter.machine);
    PIO_IRQ_FORCE(PIO0_BASE) = 1u << FLAG_SEND;
    const uint64_t begin_us = board_time_us();
    while (!(PIO_IRQ(PIO0_BASE) & 1u << FLAG_SENT))
        if (board_time_us() - begin_us > SHIFT_TIMEOUT_US) return false;
    PIO_IRQ(PIO0_BASE) = 1u << FLAG_SENT;  // or the first sync would not wait for the second pattern
    return true;
}

static uint8_t inverted_triggers(const struct sequence* sequence) {
    uint32_t inverted = 0;
    for (unsigned n = 0; n < OLS_TRIGGERS; n++) inverted |= (uint32_t)sequence->header.triggers[n].active_low << n;
    return (uint8_t)inverted;
}

bool player_arm(const struct sequence* sequence, enum ols_start_source start) {
    player_stop();
    const uint32_t edge_pin = start == OLS_START_EACH_CYCLE_BY_EDGE ? BOARD_PIN_PHOTO : BOARD_PIN_GENLOCK;
    PIO_SM_PINCTRL(PIO0_BASE, timeline.machine) =
        PIO_PINS_OUT(BOARD_PIN_TIMELINE, 8) | PIO_PINS_SET(BOARD_PIN_TIMELINE + READY_BIT, 1) | PIO_PINS_IN(edge_pin);
    playing = sequence;
    started_by = start;
    playing_from = begun = 0;
    set_cycles(sequence, 0, CYCLE_FEED_RING);
    pio_set_scratch(timeline, sequence->header.cycles - 1, PIO_MOV_Y_OSR);
    pio_set_scratch(shifter, BOARD_CHAIN_BITS - 1u, PIO_MOV_ISR_OSR);
    pio_execute(timeline, PIO_JMP | (start == OLS_START_BY_COMMAND ? TIMELINE_NEXT : TIMELINE_GENLOCK));
    pio_execute(shifter, PIO_JMP | (SHIFTER_ORIGIN + SHIFTER_WRAP_TARGET));
    for (uint32_t n = 0; n < 2; n++) pio_execute(guards[n], PIO_JMP | GUARD_ORIGIN);
    REGISTER_SET(PIO_CTRL(PIO0_BASE)) = PIO_CTRL_ENABLE(guards[0].machine) | PIO_CTRL_ENABLE(guards[1].machine);
    cycle_feed_start(&timeline_feed);
    cycle_feed_start(&shifter_feed);
    stop_connect_pins(inverted_triggers(sequence));
    if (send_first_pattern()) return true;
    player_stop();
    return false;
}

void player_start(void) {
    if (started_by != OLS_START_BY_COMMAND)
        pio_execute(timeline, PIO_SET_PINS | 1);  // READY, as the later waits have it
    REGISTER_SET(PIO_CTRL(PIO0_BASE)) = PIO_CTRL_ENABLE(timeline.machine);
}

bool player_waiting(void) {
    const uint32_t address = PIO_SM_ADDR(PIO0_BASE, timeline.machine);
    return address == TIMELINE_GENLOCK || address == TIMELINE_GENLOCK + 1;
}

// Cycles that a feed has begun since `begun`. One that is behind the other reads as almost a whole ring ahead.
static uint32_t new_cycles(const struct cycle_feed* feed) {
    const uint32_t ahead = (cycle_feed_begun(feed) - begun) % CYCLE_FEED_RING;
    return ahead < RING_USED ? ahead : 0;
}

// Follows the feeds, which count modulo their ring: to be called at least every RING_USED cycles.
static void count_cycles(void) {
    const uint32_t timeline_new = new_cycles(&timeline_feed), shifter_new = new_cycles(&shifter_feed);
    begun += timeline_new > shifter_new ? timeline_new : shifter_new;
}

struct progress {
    uint32_t cycles;     // whose table the timeline's feed has begun, since arm
    uint32_t next_word;  // address of the one that it copies next
    uint32_t queued;     // words that the FIFO still holds
};

// Read until nothing was copied in between; each read takes longer than DMA does from a word's read to its write.
static struct progress timeline_progress(void) {
    struct progress now;
    do {
        now.next_word = cycle_feed_next_word(&timeline_feed);
        count_cycles();
        now.cycles = begun - (begun - cycle_feed_begun(&timeline_feed)) % CYCLE_FEED_RING;
        now.queued = PIO_TX_LEVEL(PIO0_BASE, timeline.machine);
    } while (now.next_word != cycle_feed_next_word(&timeline_feed));
    return now;
}

// From what DMA has copied less what the FIFO still holds.
uint32_t player_cycles_begun(void) {
    const uint32_t cycle_words = playing->cycle_words + 1;  // with the wait for the next cycle's edge
    const struct progress now = timeline_progress();
    // Of the cycles that are fed, those have not begun of which no word has been taken from the FIFO.
    const uint32_t to_come = cycle_words - (now.next_word - (uint32_t)(sequence_enter(playing) + 1)) / 4;
    return now.cycles - (to_come + now.queued) / cycle_words;
}

static bool feed_is_past(const struct cycle_feed* feed, uint32_t cycle) {
    return (begun - cycle_feed_begun(feed)) % CYCLE_FEED_RING < begun - cycle;
}

bool player_swap(const struct sequence* following, uint32_t* after_cycles) {
    // The next cycle may begin this very moment; the one after it at least a cycle (10 us) later, when its entry, which
    // is written first, is long there: no handler may come between.
    const uint32_t held = board_hold_interrupts();
    count_cycles();
    const uint32_t last = begun + 1;
    *after_cycles = last + 1 - playing_from;
    const bool in_time = playing->header.cycles == 0 || *after_cycles <= playing->header.cycles;
    if (in_time) {
        cycle_feed_set(&timeline_feed, last, sequence_enter(playing) + 1, playing->cycle_words - 1);
        cycle_feed_set(&timeline_feed, last + 1, sequence_enter(following), following->cycle_words + 1);
        cycle_feed_set(&shifter_feed, last + 1, sequence_patterns(following), sequence_patterns_words(following));
        schedule_swap(following, *after_cycles);
    }
    board_release_interrupts(held);
    if (!in_time) return false;
    next = following;
    entering = true;
    next_from = last + 1;
    set_cycles(following, next_from + 1, next_from + RING_USED);
    return true;
}

bool player_swapping(void) {
    return next != NULL || entering;
}

// Both feeds are in the new program: what is left in the ring of the old one is not to come round again.
static void fill_ring(void) {
    if (begun - next_from > RING_USED || !feed_is_past(&timeline_feed, next_from) ||
        !feed_is_past(&shifter_feed, next_from))
        return;
    set_cycles(next, next_from + RING_USED, next_from + CYCLE_FEED_RING + 1);
    playing = next;
    playing_from = next_from;
    next = NULL;
}

// The first word of `playing` enters it, and comes after the last light and trigger of the program before: while that word
// is queued those may be queued, too, or be at the pins. Of the words copied since, the FIFO holds the last.
static bool has_entered(void) {
    const struct progress now = timeline_progress();
    const uint32_t copied = (now.cycles - 1 - playing_from) * playing->cycle_words +
                            (now.next_word - (uint32_t)sequence_enter(playing)) / 4;
    return copied > now.queued;
}

void player_poll(void) {
    count_cycles();
    if (next != NULL) fill_ring();
    if (entering && next == NULL) entering = !has_entered();
}

uint32_t player_events(void) {
    return PIO_IRQ(PIO0_BASE) & FLAGS_FOR_PROCESSOR;
}

void player_stop(void) {
    board_dark();
    next = NULL;
    entering = false;
    cycle_feed_stop(&timeline_feed);
    cycle_feed_stop(&shifter_feed);
    pio_stop(timeline, TIMELINE_SHIFT_CONTROL);
    pio_stop(shifter, SHIFTER_SHIFT_CONTROL);
    for (uint32_t n = 0; n < 2; n++) pio_stop(guards[n], PIO_SHIFT_JOIN_TX);
    // The machines' output registers, too, so that connecting the pins again cannot light anything.
    pio_execute(timeline, PIO_MOV_PINS_NULL);
    pio_execute(shifter, PIO_MOV_PINS_NULL);
    PIO_IRQ(PIO0_BASE) = FLAGS_ALL;
    REGISTER(PIO_IRQ0_INTE(PIO0_BASE)) = PIO_INTE_FLAG(0) | PIO_INTE_FLAG(1) | PIO_INTE_FLAG(2);
}
