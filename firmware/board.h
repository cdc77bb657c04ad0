// SPDX-License-Identifier: MIT
// Board: the hardware boundary. What is wired where, and the few things the portable code asks of the machine it runs
// on. board_rp2040.c is the real one; board_host.c gives the same on Linux, for tests and fuzzers.
#ifndef OLS_BOARD_H
#define OLS_BOARD_H

#include <stdbool.h>
#include <stdint.h>

#include "board_pins.h"  // made from boards/BOARD.toml: pins, polarity, chain, limits
#include "sequence.h"

// Inputs that must be high for anything to be lit. They are pulled down, so that an open wire stops; an input that nothing
// is connected to is wired to 3.3 V.
enum board_stop_input { BOARD_EMERGENCY_STOP, BOARD_OVER_TEMPERATURE, BOARD_OPEN_LAMP, BOARD_STOP_INPUTS };

// On the CAN bus: which of up to 16 boards this one is, and the bit rate, 1000 or 500.
#ifndef BOARD_CAN_NUMBER
#define BOARD_CAN_NUMBER 0
#endif
#define BOARD_CAN_IDS (16 * BOARD_CAN_NUMBER)  // what this board adds to the identifiers of wire.h
#ifndef BOARD_CAN_KBIT_S
#define BOARD_CAN_KBIT_S 1000
#endif

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

// Bit n: stop input n is low now. That it was, however shortly, is for its handler (interrupts.h).
uint32_t board_stop_inputs(void);

// From now on the next fall of each stop input is its handler's: one, so that no frequency at these pins takes the processor
// from anybody. While nothing is guarded nobody wants them.
void board_watch_stop_inputs(void);

// The next rise of GENLOCK, one, ends board_sleep.
void board_watch_genlock(void);

// LIGHT_EN's pad says "lit" now, whoever drives it.
bool board_light_is_on(void);

// Changes HEALTHY, which nothing else does: board_dark leaves it as it is, and a reset makes it low.
void board_pulse_healthy(void);

// Lets no handler run until board_release_interrupts, which wants what this returned. For some hundred instructions at
// most: the times of docs/firmware.md, "How each doubt ends dark", reckon with it.
uint32_t board_hold_interrupts(void);
void board_release_interrupts(uint32_t held);

// Stops with OLS_FAULT_HEARTBEAT after so many microseconds, unless it is called again before; 0: does not.
void board_expect_message(uint32_t within_us);

uint64_t board_time_us(void);

// Sleeps until an interrupt, a millisecond at most. Returns at once when one came since the last call.
void board_sleep(void);

// To be called at least every 20 ms, or the processor is reset.
void board_feed_watchdog(void);

// True when the watchdog, or board_reset, ended the previous run of this firmware.
bool board_was_reset_by_watchdog(void);

// Resets the processor now.
_Noreturn void board_reset(void);

// Ends this firmware, dark, and starts the boot ROM's USB boot loader, which takes a new image.
_Noreturn void board_enter_bootloader(void);

// Three words that survive a watchdog reset, not a power-up.
void board_remember(const uint32_t words[3]);
void board_recall(uint32_t words[3]);

// The flash chip's unique number.
void board_read_id(uint8_t id[8]);

// A number that differs from the previous boot's.
uint32_t board_boot_nonce(void);

#endif
