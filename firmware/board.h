// SPDX-License-Identifier: MIT
// Board: the hardware boundary. What is wired where, and the few things the portable code asks of the machine it runs
// on. board_rp2040.c is the real one; board_host.c gives the same on Linux, for tests and fuzzers.
#ifndef OLS_BOARD_H
#define OLS_BOARD_H

#include <stdbool.h>
#include <stdint.h>

#include "sequence.h"

// Wiring (docs/architecture.md, "Pins"). All these pins are low at the PIO level when idle or dark.
enum {
    BOARD_PIN_DATA = 2,
    BOARD_PIN_CLK = 3,
    BOARD_PIN_TIMELINE = 4,  // the first of the timeline's eight: LATCH
    BOARD_PIN_LIGHT_EN = 5,
    BOARD_PIN_TRIG0 = 6,
    BOARD_PIN_READY = 11,  // high while the timeline waits for an edge
    BOARD_PINS_END = 12,
    BOARD_PIN_STOP_INPUTS = 12,     // the first of BOARD_STOP_INPUTS, in the order of enum board_stop_input
    BOARD_PIN_GENLOCK = 15,         // its rise can start play
    BOARD_PIN_PHOTO = 28,           // GENLOCK debounced, an output that PIO reads back
    BOARD_LIGHT_EN_ACTIVE_LOW = 0,  // 1: the pad is inverted and pulled up, for drivers with an OE input
    BOARD_CHAIN_BITS = 176,         // 11 drivers of 16 outputs: 156 lamps, 6 on the matte board, spares
    BOARD_SHIFT_DIVIDER = 1         // 17.9 MHz; 2 for drivers or wiring that need 8.9 MHz
};

// Inputs that must be high for anything to be lit. They are pulled down, so that an open wire stops; an input that nothing
// is connected to is wired to 3.3 V.
enum board_stop_input { BOARD_EMERGENCY_STOP, BOARD_OVER_TEMPERATURE, BOARD_OPEN_LAMP, BOARD_STOP_INPUTS };

// What supply and lamps stand. docs/hardware.md of a stage has the reasons for its own.
enum {
    BOARD_LAMP_MA = 700,
    BOARD_SUPPLY_MA = 120000,  // all 162 lamps at once, for tracking slots
    BOARD_LAMP_DUTY_MAX_PERMILLE = 750
};

#define BOARD_TICK_HZ 125000000u
#define BOARD_TICKS_PER_US (BOARD_TICK_HZ / 1000000u)
#define BOARD_FIRMWARE_VERSION "0.1.0"

static const struct sequence_board board_sequence = {
    BOARD_CHAIN_BITS, BOARD_SHIFT_DIVIDER, {BOARD_SUPPLY_MA / BOARD_LAMP_MA, BOARD_LAMP_DUTY_MAX_PERMILLE}};

// Clocks, pins (dark), wake-up interrupts, watchdog.
void board_init(void);

// Lamps off and triggers idle at once, whatever PIO does: the pins are taken from it. Safe in any state. Triggers idle
// at the level that board_connect_pins last chose, low after a reset.
void board_dark(void);

// Gives the pins to PIO. Bit n of `inverted_triggers`: TRIGn is active low at the pad, for PIO it is high all the same.
void board_connect_pins(uint8_t inverted_triggers);

// Bit n: stop input n is low, or has been since the last call, however shortly.
uint32_t board_stop_inputs(void);

// Forgets rises of GENLOCK. They only wake: PIO starts by itself, and the processor is to notice soon.
void board_forget_genlock(void);

uint64_t board_time_us(void);

// Sleeps until an interrupt, a millisecond at most. Returns at once when one came since the last call.
void board_sleep(void);

// To be called at least every 20 ms, or the processor is reset.
void board_feed_watchdog(void);

// True when the watchdog, or board_reset, ended the previous run of this firmware.
bool board_was_reset_by_watchdog(void);

// Resets the processor now.
_Noreturn void board_reset(void);

// Three words that survive a watchdog reset, not a power-up.
void board_remember(const uint32_t words[3]);
void board_recall(uint32_t words[3]);

// The flash chip's unique number.
void board_read_id(uint8_t id[8]);

// A number that differs from the previous boot's.
uint32_t board_boot_nonce(void);

#endif
