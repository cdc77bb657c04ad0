// SPDX-License-Identifier: MIT
// Clocks: the crystal, then the PLLs (RP2040 datasheet 2.15 to 2.18). Runs in flash, before the image is copied: at 125 MHz that
// takes 17 ms, from the ring oscillator between 0.2 and 1.2 s. Nothing here may call what is to be copied.
#include "clocks.h"

#include "rp2040.h"

#define IN_FLASH __attribute__((section(".reset")))

enum { BOOT_WATCHDOG_US = 500000 };

// Should a wait below not end, for a crystal that does not swing or a PLL that does not lock, the chip starts anew, and the
// crystal, which goes on meanwhile, has had that much longer. The tick comes from the ring oscillator, 1.8 to 12 MHz, until
// clk_ref does not: 0.5 s are then 0.5 to 3.3 s.
IN_FLASH static void start_watchdog(void) {
    PSM_WDSEL = PSM_ALL_BUT_OSCILLATORS;
    WATCHDOG_TICK = WATCHDOG_TICK_ENABLE | 12;  // 12 MHz / 12: microseconds for timer and watchdog (4.7.2)
    WATCHDOG_LOAD = WATCHDOG_COUNTS_A_US * BOOT_WATCHDOG_US;
    WATCHDOG_CTRL = WATCHDOG_ENABLE;
}

IN_FLASH static void start_crystal(void) {
    XOSC_STARTUP = XOSC_STARTUP_64MS;
    XOSC_CTRL = XOSC_1_15MHZ | XOSC_ENABLE;
    while (!(XOSC_STATUS & XOSC_STABLE)) {
    }
}

// 12 MHz x feedback / (first x second), datasheet 2.18.2.
IN_FLASH static void start_pll(uint32_t base, uint32_t feedback, uint32_t first, uint32_t second) {
    PLL_CS(base) = 1;  // reference divider
    PLL_FBDIV(base) = feedback;
    REGISTER_CLEAR(PLL_PWR(base)) = PLL_PWR_PD | PLL_PWR_VCOPD;
    while (!(PLL_CS(base) & PLL_CS_LOCK)) {
    }
    PLL_PRIM(base) = first << 16 | second << 12;
    REGISTER_CLEAR(PLL_PWR(base)) = PLL_PWR_POSTDIVPD;
}

IN_FLASH void clocks_start(void) {
    start_watchdog();
    start_crystal();
    // Off the PLLs before they are touched: a debugger's reset leaves the clocks as they were (2.15.3.2).
    REGISTER_CLEAR(CLK_SYS_CTRL) = CLK_SYS_SRC_AUX;
    while (!(CLK_SYS_SELECTED & 1)) {
    }
    CLK_REF_CTRL = CLK_REF_SRC_XOSC;
    while (!(CLK_REF_SELECTED & 1 << CLK_REF_SRC_XOSC)) {
    }
    reset_blocks(RESET_PLL_SYS | RESET_PLL_USB);
    start_pll(PLL_SYS_BASE, 125, 6, 2);  // 1500 MHz / 12 = 125 MHz
    start_pll(PLL_USB_BASE, 100, 5, 5);  // 1200 MHz / 25 = 48 MHz
    REGISTER_SET(CLK_SYS_CTRL) = CLK_SYS_SRC_AUX;
    while (!(CLK_SYS_SELECTED & 1 << CLK_SYS_SRC_AUX)) {
    }
    CLK_USB_CTRL = CLK_ENABLE;
}
