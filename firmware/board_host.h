// SPDX-License-Identifier: MIT
// The host's end of board_host.c: what a test does to the board, and what it sees of it.
#ifndef OLS_BOARD_HOST_H
#define OLS_BOARD_HOST_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

// Powers the board up anew: time zero, nothing attached, no fault; then firmware start-up as in main.c.
void board_host_power_up(void);

// The watchdog bites: start-up again, with what survives a reset.
void board_host_bite(void);

// Lets time pass and turns the main loop once a millisecond.
void board_host_run_us(uint64_t us);

// The cable. Attaching starts a new session.
void board_host_attach(void);
void board_host_detach(void);

// Bytes to the board, and its answers; the main loop turns until all are taken, or the firmware is to end. Returns the bytes written to `answer`.
size_t board_host_exchange(const uint8_t* bytes, size_t byte_count, uint8_t* answer, size_t answer_bytes_max);

// Hardware trouble, from now on.
void board_host_starve_timeline(void);
void board_host_starve_shifter(void);
void board_host_delay_triggers(uint32_t ticks);
void board_host_corrupt_program(void);

// A light of so many ticks at LIGHT_EN's pad, whatever the program says.
void board_host_hold_light(uint32_t ticks);

// LIGHT_EN's pad is lit, whoever drives it, or no longer.
void board_host_short_light(bool shorted);

// How often HEALTHY has changed since power-up.
uint32_t board_host_healthy_changes(void);

// A rise of GENLOCK that debouncing lets through.
void board_host_genlock(void);

// Pulls a stop input low (enum board_stop_input), or lets go of it.
void board_host_pull_stop_input(unsigned input, bool low);

// True while pins belong to PIO; false is dark.
bool board_host_pins_are_connected(void);

// Fits or removes a CAN controller; before power-up.
void board_host_fit_can(bool fitted);

// A frame for the board, or one of its own; false when there is no room, or none.
bool board_host_can_put(uint16_t id, const uint8_t* data, uint8_t length);
bool board_host_can_take(uint16_t* id, uint8_t data[8], uint8_t* length);

// Whether anybody acknowledges what the board sends; and a bus-off with its recovery.
void board_host_can_answer(bool answered);
void board_host_can_bus_off(void);

#ifdef __cplusplus
}
#endif

#endif
