// SPDX-License-Identifier: MIT
// Player: PIO block 0 with the timeline and the shifter of pulse.pio, each fed by a pair of DMA channels: one copies
// the table to the machine's FIFO, the other starts the first again from the top, so cycles follow without a gap.
#include "player.h"

#include "board.h"
#include "pio.h"
#include "pulse.h"

enum { SHIFTER_ORIGIN = TIMELINE_WORDS };
enum { FLAG_SEND = 4, FLAG_SENT = 5, FLAGS_ALL = 0xff, FLAGS_FOR_PROCESSOR = 7 };
enum { SHIFT_TIMEOUT_US = 1000 };  // 40 times what a chain of 256 bits takes
_Static_assert(TIMELINE_WORDS + SHIFTER_WORDS <= 32, "both programs fit the block's instruction memory");
_Static_assert(TIMELINE_HALT == 0, "a starved FIFO jumps to the word 0");

static const struct pio_machine timeline = {PIO0_BASE, 0};
static const struct pio_machine shifter = {PIO0_BASE, 1};
#define TIMELINE_SHIFT_CONTROL (PIO_SHIFT_JOIN_TX | PIO_SHIFT_OUT_RIGHT)
#define SHIFTER_SHIFT_CONTROL PIO_SHIFT_JOIN_TX

struct feed {
    uint32_t table_channel, restart_channel;
    uint32_t request;
    struct pio_machine machine;
};
static const struct feed timeline_feed = {0, 1, DMA_REQUEST_PIO0_TX0, {PIO0_BASE, 0}};
static const struct feed shifter_feed = {2, 3, DMA_REQUEST_PIO0_TX1, {PIO0_BASE, 1}};
static uint32_t table_addresses[2];  // read by the restart channels

void player_init(void) {
    static const uint16_t timeline_program[] = TIMELINE_PROGRAM;
    static const uint16_t shifter_program[] = SHIFTER_PROGRAM;
    pio_load(PIO0_BASE, 0, timeline_program, TIMELINE_WORDS);
    pio_load(PIO0_BASE, SHIFTER_ORIGIN, shifter_program, SHIFTER_WORDS);

    PIO_SM_CLKDIV(PIO0_BASE, timeline.machine) = PIO_CLKDIV(1);
    PIO_SM_EXECCTRL(PIO0_BASE, timeline.machine) = PIO_EXEC_WRAP(TIMELINE_WRAP_TARGET, TIMELINE_WRAP);
    PIO_SM_PINCTRL(PIO0_BASE, timeline.machine) = PIO_PINS_OUT(BOARD_PIN_TIMELINE, 8);

    PIO_SM_CLKDIV(PIO0_BASE, shifter.machine) = PIO_CLKDIV(BOARD_SHIFT_DIVIDER);
    PIO_SM_EXECCTRL(PIO0_BASE, shifter.machine) =
        PIO_EXEC_WRAP(SHIFTER_ORIGIN + SHIFTER_WRAP_TARGET, SHIFTER_ORIGIN + SHIFTER_WRAP) |
        PIO_EXEC_STATUS_TX_BELOW(sequence_pattern_words(BOARD_CHAIN_BITS));
    PIO_SM_PINCTRL(PIO0_BASE, shifter.machine) = PIO_PINS_OUT(BOARD_PIN_DATA, 1) | PIO_PINS_SIDE(BOARD_PIN_CLK, 1);

    player_stop();
    PIO_IRQ0_INTE(PIO0_BASE) = PIO_INTE_FLAG(0) | PIO_INTE_FLAG(1) | PIO_INTE_FLAG(2);
}

static void start_feed(const struct feed* feed, const uint32_t* table, uint32_t words, uint32_t* table_address) {
    *table_address = (uint32_t)table;
    DMA_READ_ADDR(feed->restart_channel) = (uint32_t)table_address;
    DMA_WRITE_ADDR(feed->restart_channel) = (uint32_t)&DMA_AL3_READ_ADDR_TRIG(feed->table_channel);
    DMA_TRANS_COUNT(feed->restart_channel) = 1;
    DMA_AL1_CTRL(feed->restart_channel) = DMA_CTRL_ENABLE | DMA_CTRL_HIGH_PRIORITY | DMA_CTRL_WORDS |
                                          DMA_CTRL_CHAIN_TO(feed->restart_channel) | DMA_CTRL_PACE(DMA_REQUEST_NONE);
    DMA_READ_ADDR(feed->table_channel) = (uint32_t)table;
    DMA_WRITE_ADDR(feed->table_channel) = (uint32_t)&PIO_TXF(feed->machine.block, feed->machine.machine);
    DMA_TRANS_COUNT(feed->table_channel) = words;
    DMA_CTRL_TRIG(feed->table_channel) = DMA_CTRL_ENABLE | DMA_CTRL_HIGH_PRIORITY | DMA_CTRL_WORDS |
                                         DMA_CTRL_INCREMENT_READ | DMA_CTRL_CHAIN_TO(feed->restart_channel) |
                                         DMA_CTRL_PACE(feed->request);
}

static void stop_feed(const struct feed* feed) {
    // Disabled first, lest one restarts the other during the abort.
    DMA_AL1_CTRL(feed->restart_channel) = 0;
    DMA_AL1_CTRL(feed->table_channel) = 0;
    DMA_CHAN_ABORT = 1u << feed->table_channel | 1u << feed->restart_channel;
    while ((DMA_AL1_CTRL(feed->table_channel) | DMA_AL1_CTRL(feed->restart_channel)) & DMA_CTRL_BUSY) {
    }
}

// Loads a scratch register through the FIFO; the machine must be stopped and its FIFO empty.
static void set_scratch(struct pio_machine machine, uint32_t value, uint32_t mov_from_osr) {
    PIO_TXF(machine.block, machine.machine) = value;
    pio_execute(machine, PIO_PULL);
    pio_execute(machine, mov_from_osr);
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

bool player_arm(const struct sequence* sequence) {
    player_stop();
    set_scratch(timeline, sequence->cycles - 1, PIO_MOV_Y_OSR);
    set_scratch(shifter, BOARD_CHAIN_BITS - 1u, PIO_MOV_ISR_OSR);
    pio_execute(timeline, PIO_JMP | TIMELINE_NEXT);
    pio_execute(shifter, PIO_JMP | (SHIFTER_ORIGIN + SHIFTER_WRAP_TARGET));
    start_feed(&timeline_feed, sequence->events, sequence->event_count, &table_addresses[0]);
    start_feed(&shifter_feed, sequence->patterns, sequence->slot_count * sequence->pattern_words, &table_addresses[1]);
    board_connect_pins(sequence->inverted_triggers);
    if (send_first_pattern()) return true;
    player_stop();
    return false;
}

void player_start(void) {
    REGISTER_SET(PIO_CTRL(PIO0_BASE)) = PIO_CTRL_ENABLE(timeline.machine);
}

uint32_t player_events(void) {
    return PIO_IRQ(PIO0_BASE) & FLAGS_FOR_PROCESSOR;
}

void player_stop(void) {
    board_dark();
    stop_feed(&timeline_feed);
    stop_feed(&shifter_feed);
    pio_stop(timeline, TIMELINE_SHIFT_CONTROL);
    pio_stop(shifter, SHIFTER_SHIFT_CONTROL);
    // The machines' output registers, too, so that connecting the pins again cannot light anything.
    pio_execute(timeline, PIO_MOV_PINS_NULL);
    pio_execute(shifter, PIO_MOV_PINS_NULL);
    PIO_IRQ(PIO0_BASE) = FLAGS_ALL;
}
