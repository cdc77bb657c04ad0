// SPDX-License-Identifier: MIT
// What start-up needs of the RP2040 board beyond board.h.
#ifndef OLS_BOARD_RP2040_H
#define OLS_BOARD_RP2040_H

// Handler of every interrupt in use. An interrupt only wakes: it masks itself, the main loop does the work, and
// board_sleep unmasks.
void board_wake_interrupt(void);

#endif
