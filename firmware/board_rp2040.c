// SPDX-License-Identifier: MIT
// Board: clocks, pins, time, sleep and watchdog of an RP2040 with a 12 MHz crystal (Raspberry Pi Pico and kin).
#include "board_rp2040.h"

#include "board.h"
#include "frame.h"
#include "rp2040.h"

enum { WATCHDOG_US = 20000, WAKE_US = 1000 };
#define WAKE_INTERRUPTS (1u << IRQ_TIMER_0 | 1u << IRQ_USBCTRL | 1u << IRQ_PIO0_0 | 1u << IRQ_GPIO)

// In the fourth scratch register while this firmware runs: the boot ROM and debuggers reset by watchdog, too, and those
// are no faults.
#define RUNNING_MAGIC 0x6f6c7321u

static volatile bool woken;
static bool reset_by_watchdog;

static void release_reset(uint32_t blocks) {
    REGISTER_SET(RESETS_RESET) = blocks;  // known state, also after a jump from a debugger
    REGISTER_CLEAR(RESETS_RESET) = blocks;
    while (~RESETS_RESET_DONE & blocks) {
    }
}

// 12 MHz x feedback / (first x second), datasheet 2.18.2.
static void start_pll(uint32_t base, uint32_t feedback, uint32_t first, uint32_t second) {
    PLL_CS(base) = 1;  // reference divider
    PLL_FBDIV(base) = feedback;
    REGISTER_CLEAR(PLL_PWR(base)) = PLL_PWR_PD | PLL_PWR_VCOPD;
    while (!(PLL_CS(base) & PLL_CS_LOCK)) {
    }
    PLL_PRIM(base) = first << 16 | second << 12;
    REGISTER_CLEAR(PLL_PWR(base)) = PLL_PWR_POSTDIVPD;
}

static void init_clocks(void) {
    XOSC_STARTUP = XOSC_STARTUP_1MS;
    XOSC_CTRL = XOSC_1_15MHZ | XOSC_ENABLE;
    while (!(XOSC_STATUS & XOSC_STABLE)) {
    }
    // Off the PLLs before they are touched: a watchdog reset leaves the clocks as they were (2.15.3.2).
    REGISTER_CLEAR(CLK_SYS_CTRL) = CLK_SYS_SRC_AUX;
    while (!(CLK_SYS_SELECTED & 1)) {
    }
    CLK_REF_CTRL = CLK_REF_SRC_XOSC;
    while (!(CLK_REF_SELECTED & 1 << CLK_REF_SRC_XOSC)) {
    }
    release_reset(RESET_PLL_SYS | RESET_PLL_USB);
    start_pll(PLL_SYS_BASE, 125, 6, 2);  // 1500 MHz / 12 = 125 MHz
    start_pll(PLL_USB_BASE, 100, 5, 5);  // 1200 MHz / 25 = 48 MHz
    REGISTER_SET(CLK_SYS_CTRL) = CLK_SYS_SRC_AUX;
    while (!(CLK_SYS_SELECTED & 1 << CLK_SYS_SRC_AUX)) {
    }
    CLK_USB_CTRL = CLK_ENABLE;
    WATCHDOG_TICK = WATCHDOG_TICK_ENABLE | 12;  // 12 MHz / 12: microseconds for timer and watchdog (4.7.2)
}

static uint32_t inverted_pins = BOARD_LIGHT_EN_ACTIVE_LOW << BOARD_PIN_LIGHT_EN;

static void set_pins(uint32_t function) {
    for (uint32_t pin = BOARD_PIN_DATA; pin < BOARD_PINS_END; pin++) {
        // Both ways, so that the witness sees a trigger as the timeline plays it.
        const uint32_t inversion = inverted_pins >> pin & 1 ? GPIO_OUTPUT_INVERTED | GPIO_INPUT_INVERTED : 0;
        GPIO_CTRL(pin) = function | GPIO_OUTPUT_ALWAYS | inversion;
    }
}

void board_dark(void) {
    // Nobody writes SIO's output register: it holds zero from reset on.
    set_pins(GPIO_FUNCTION_SIO);
}

void board_connect_pins(uint8_t inverted_triggers) {
    inverted_pins = BOARD_LIGHT_EN_ACTIVE_LOW << BOARD_PIN_LIGHT_EN | (uint32_t)inverted_triggers << BOARD_PIN_TRIG0;
    set_pins(GPIO_FUNCTION_PIO0);
}

static void init_pins(void) {
    board_dark();
    for (uint32_t pin = BOARD_PIN_DATA; pin < BOARD_PINS_END; pin++) {
        const bool pull_up = pin == BOARD_PIN_LIGHT_EN && BOARD_LIGHT_EN_ACTIVE_LOW;
        PAD_GPIO(pin) = PAD_INPUT | PAD_4MA | PAD_SCHMITT | (pull_up ? PAD_PULL_UP : PAD_PULL_DOWN);
    }
    for (uint32_t pin = BOARD_PIN_STOP_INPUTS; pin < BOARD_PIN_STOP_INPUTS + BOARD_STOP_INPUTS; pin++) {
        PAD_GPIO(pin) = PAD_INPUT | PAD_SCHMITT | PAD_PULL_DOWN;
        REGISTER_SET((uint32_t)&GPIO_INTE(pin)) = GPIO_EDGE_LOW(pin);
    }
    PAD_GPIO(BOARD_PIN_GENLOCK) = PAD_INPUT | PAD_SCHMITT | PAD_PULL_DOWN;
    REGISTER_SET((uint32_t)&GPIO_INTE(BOARD_PIN_GENLOCK)) = GPIO_EDGE_HIGH(BOARD_PIN_GENLOCK);
    PAD_GPIO(BOARD_PIN_PHOTO) = PAD_INPUT | PAD_4MA | PAD_PULL_DOWN;
    GPIO_CTRL(BOARD_PIN_PHOTO) = GPIO_FUNCTION_PIO1 | GPIO_OUTPUT_ALWAYS;
}

void board_init(void) {
    release_reset(RESET_IO_BANK0 | RESET_PADS_BANK0);
    init_pins();
    init_clocks();
    release_reset(RESET_PIO0 | RESET_PIO1 | RESET_DMA | RESET_TIMER | RESET_USBCTRL);
    BUSCTRL_BUS_PRIORITY = BUS_PRIORITY_DMA;  // the processor waits rather than a FIFO
    TIMER_INTE = 1;
    reset_by_watchdog = WATCHDOG_REASON != 0 && WATCHDOG_SCRATCH(3) == RUNNING_MAGIC;
    WATCHDOG_SCRATCH(3) = RUNNING_MAGIC;
    PSM_WDSEL = PSM_ALL_BUT_OSCILLATORS;
    board_feed_watchdog();
    WATCHDOG_CTRL = WATCHDOG_ENABLE;
}

uint32_t board_stop_inputs(void) {
    uint32_t low = 0;
    for (uint32_t n = 0; n < BOARD_STOP_INPUTS; n++) {
        const uint32_t pin = BOARD_PIN_STOP_INPUTS + n;
        const bool fell = GPIO_INTR(pin) & GPIO_EDGE_LOW(pin);
        GPIO_INTR(pin) = GPIO_EDGE_LOW(pin);
        if (fell || !(GPIO_STATUS(pin) & GPIO_FROM_PAD)) low |= 1u << n;
    }
    return low;
}

void board_forget_genlock(void) {
    GPIO_INTR(BOARD_PIN_GENLOCK) = GPIO_EDGE_HIGH(BOARD_PIN_GENLOCK);
}

uint64_t board_time_us(void) {
    for (;;) {
        const uint32_t high = TIMER_RAW_HIGH;
        const uint32_t low = TIMER_RAW_LOW;
        if (high == TIMER_RAW_HIGH) return (uint64_t)high << 32 | low;
    }
}

void board_wake_interrupt(void) {
    NVIC_ICER = WAKE_INTERRUPTS;
    woken = true;
}

void board_sleep(void) {
    TIMER_INTR = 1;
    TIMER_ALARM0 = TIMER_RAW_LOW + WAKE_US;
    NVIC_ISER = WAKE_INTERRUPTS;
    __asm volatile("cpsid i" ::: "memory");
    if (!woken) __asm volatile("wfi");  // wakes on a pending interrupt although they are masked (ARMv6-M B1.5.19)
    __asm volatile("cpsie i" ::: "memory");
    woken = false;
}

void board_feed_watchdog(void) {
    WATCHDOG_LOAD = 2 * WATCHDOG_US;  // counts down twice a microsecond (erratum RP2040-E1)
}

bool board_was_reset_by_watchdog(void) {
    return reset_by_watchdog;
}

_Noreturn void board_reset(void) {
    WATCHDOG_CTRL = WATCHDOG_TRIGGER;
    for (;;) {
    }
}

void board_remember(const uint32_t words[3]) {
    for (int i = 0; i < 3; i++) WATCHDOG_SCRATCH(i) = words[i];
}

void board_recall(uint32_t words[3]) {
    for (int i = 0; i < 3; i++) words[i] = WATCHDOG_SCRATCH(i);
}

void board_read_id(uint8_t id[8]) {
    // Command 4Bh of W25Q-class flash: 4 dummy bytes, then 64 bits. The code runs from SRAM, so the flash interface is
    // free to leave execute-in-place and is not needed for it again before the next reset.
    enum { COMMAND = 0x4b, DUMMY_BYTES = 4, ID_BYTES = 8 };
    SSI_SSIENR = 0;
    SSI_CTRLR0 = SSI_8_BITS_BOTH_WAYS;
    SSI_SER = 1;
    SSI_SSIENR = 1;
    QSPI_SS_CTRL = QSPI_SS_LOW;
    for (int i = 0; i < 1 + DUMMY_BYTES + ID_BYTES; i++) {
        SSI_DR0 = i == 0 ? COMMAND : 0;
        while (!(SSI_SR & SSI_SR_RECEIVED)) {
        }
        const uint8_t received = (uint8_t)SSI_DR0;
        if (i > DUMMY_BYTES) id[i - 1 - DUMMY_BYTES] = received;
    }
    QSPI_SS_CTRL = QSPI_SS_HIGH;
}

uint32_t board_boot_nonce(void) {
    // Each boot hashes the word the previous one left in SRAM, which a reset keeps, with noise of the ring oscillator.
    static uint32_t seed __attribute__((section(".noinit")));
    static uint32_t nonce;
    if (nonce != 0) return nonce;
    uint32_t noise[9] = {seed};
    for (int bit = 0; bit < 256; bit++) noise[1 + bit / 32] = noise[1 + bit / 32] << 1 | (ROSC_RANDOMBIT & 1);
    seed = ols_crc32(0, noise, sizeof noise);
    nonce = seed ? seed : 1;
    return nonce;
}
