// SPDX-License-Identifier: MIT
// What start-up needs of the RP2040 board beyond board.h.
#ifndef OLS_BOARD_RP2040_H
#define OLS_BOARD_RP2040_H

#include <stdint.h>

// Handler of every interrupt in use. An interrupt only wakes: it masks itself, the main loop does the work, and
// board_sleep unmasks.
void board_wake_interrupt(void);

// Of inputs: the CAN controller's raises IRQ_CAN, the others wake.
void board_gpio_interrupt(void);

// No sleep before the main loop's next turn.
void board_wake(void);

// Holds and then releases the reset of peripherals (RESET_ bits).
void board_release_reset(uint32_t blocks);

// mcp2515.c: from now on IRQ_CAN comes when the controller wants something, or when it is raised.
void board_watch_can_interrupt(void);
void board_raise_can_interrupt(void);
void mcp2515_interrupt(void);

#endif
