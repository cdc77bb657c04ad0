// SPDX-License-Identifier: MIT
// Clocks: clk_sys 125 MHz and clk_usb 48 MHz from a 12 MHz crystal, and the watchdog that ends a start that hangs.
#ifndef OLS_CLOCKS_H
#define OLS_CLOCKS_H

// First of all, and in flash (startup.c). The watchdog runs from now on: board_init gives it its time while the program runs.
void clocks_start(void);

#endif
