// SPDX-License-Identifier: MIT
// Board: pins, time, sleep and watchdog of an RP2040 (Raspberry Pi Pico and kin).
#include "board_rp2040.h"

#include "board.h"
#include "frame.h"
#include "rp2040.h"

enum { WATCHDOG_US = 20000, WAKE_US = 1000 };

// In the fourth scratch register while this firmware runs: the boot ROM and debuggers reset by watchdog, too, and those
// are no faults.
#define RUNNING_MAGIC 0x6f6c7321u

volatile bool board_is_woken;
static uint32_t slept_us;
static bool reset_by_watchdog;

static const uint8_t output_pins[] = BOARD_OUTPUT_PINS;
enum { OUTPUT_PINS = sizeof output_pins };
// Each output's control register and what makes it dark, ready to be written: there is no time to work it out then.
static struct {
    volatile uint32_t* control;
    uint32_t dark;
} outputs[OUTPUT_PINS];

// Bit n of `inverted`: GPIO n is active low. Both ways, so that the witness sees a trigger as the timeline plays it.
static void prepare_dark(uint32_t inverted) {
    for (uint32_t n = 0; n < OUTPUT_PINS; n++) {
        const uint32_t inversion = inverted >> output_pins[n] & 1 ? GPIO_OUTPUT_INVERTED | GPIO_INPUT_INVERTED : 0;
        outputs[n].control = &GPIO_CTRL(output_pins[n]);
        outputs[n].dark = GPIO_FUNCTION_SIO | GPIO_OUTPUT_ALWAYS | inversion;
    }
}

void board_dark(void) {
    // What they show is SIO's output register, which init_pins has cleared; nobody but HEALTHY, none of these, is set in it.
    for (uint32_t n = 0; n < OUTPUT_PINS; n++) *outputs[n].control = outputs[n].dark;
}

void board_connect_pins(uint8_t inverted_triggers) {
    prepare_dark(BOARD_LIGHT_EN_ACTIVE_LOW << BOARD_PIN_LIGHT_EN | (uint32_t)inverted_triggers << BOARD_PIN_TRIG0);
    for (uint32_t n = 0; n < OUTPUT_PINS; n++)
        *outputs[n].control = outputs[n].dark ^ GPIO_FUNCTION_SIO ^ GPIO_FUNCTION_PIO0;
}

static void init_pins(void) {
    // A debugger, or a jump to the reset handler, may leave bits: SIO has no reset of its own in RESETS.
    SIO_GPIO_OUT = 0;
    prepare_dark(BOARD_LIGHT_EN_ACTIVE_LOW << BOARD_PIN_LIGHT_EN);
    board_dark();
    for (uint32_t n = 0; n < OUTPUT_PINS; n++) {
        const uint32_t pin = output_pins[n];
        const bool pull_up = pin == BOARD_PIN_LIGHT_EN && BOARD_LIGHT_EN_ACTIVE_LOW;
        PAD_GPIO(pin) = PAD_INPUT | PAD_12MA | PAD_SCHMITT | (pull_up ? PAD_PULL_UP : PAD_PULL_DOWN);
    }
    for (uint32_t pin = BOARD_PIN_STOP_INPUTS; pin < BOARD_PIN_STOP_INPUTS + BOARD_STOP_INPUTS; pin++) {
        PAD_GPIO(pin) = PAD_INPUT | PAD_SCHMITT | PAD_PULL_DOWN;
    }
    PAD_GPIO(BOARD_PIN_GENLOCK) = PAD_INPUT | PAD_SCHMITT | PAD_PULL_DOWN;
    PAD_GPIO(BOARD_PIN_PHOTO) = PAD_INPUT | PAD_4MA | PAD_PULL_DOWN;
    GPIO_CTRL(BOARD_PIN_PHOTO) = GPIO_FUNCTION_PIO1 | GPIO_OUTPUT_ALWAYS;
    PAD_GPIO(BOARD_PIN_HEALTHY) = PAD_INPUT | PAD_12MA | PAD_PULL_DOWN;
    GPIO_CTRL(BOARD_PIN_HEALTHY) = GPIO_FUNCTION_SIO | GPIO_OUTPUT_ALWAYS;
}

void board_init(void) {
    reset_blocks(RESET_IO_BANK0 | RESET_PADS_BANK0);
    init_pins();
    reset_blocks(RESET_SYSINFO | RESET_BUSCTRL | RESET_PIO0 | RESET_PIO1 | RESET_DMA | RESET_TIMER | RESET_USBCTRL);
    BUSCTRL_BUS_PRIORITY = BUS_PRIORITY_DMA;  // the processor waits rather than a FIFO
    TIMER_INTE = 1u << BOARD_ALARM_TICK | 1u << BOARD_ALARM_HEARTBEAT | 1u << BOARD_ALARM_TRIGGER;
    reset_by_watchdog = WATCHDOG_REASON != 0 && WATCHDOG_SCRATCH(3) == RUNNING_MAGIC;
    WATCHDOG_SCRATCH(3) = RUNNING_MAGIC;
    board_feed_watchdog();
}

uint32_t board_stop_inputs(void) {
    uint32_t low = 0;
    for (uint32_t n = 0; n < BOARD_STOP_INPUTS; n++) {
        if (!(GPIO_STATUS(BOARD_PIN_STOP_INPUTS + n) & GPIO_FROM_PAD)) low |= 1u << n;
    }
    return low;
}

// Lets an edge of a pin interrupt, once: its handler masks it. What came before is forgotten.
static void watch_edge(uint32_t pin, uint32_t edge) {
    GPIO_INTR(pin) = edge;
    REGISTER_SET((uint32_t)&GPIO_INTE(pin)) = edge;
}

void board_watch_stop_inputs(void) {
    for (uint32_t pin = BOARD_PIN_STOP_INPUTS; pin < BOARD_PIN_STOP_INPUTS + BOARD_STOP_INPUTS; pin++)
        watch_edge(pin, GPIO_EDGE_LOW(pin));
}

void board_watch_genlock(void) {
    watch_edge(BOARD_PIN_GENLOCK, GPIO_EDGE_HIGH(BOARD_PIN_GENLOCK));
}

bool board_light_is_on(void) {
    return (GPIO_STATUS(BOARD_PIN_LIGHT_EN) & GPIO_FROM_PAD) != (BOARD_LIGHT_EN_ACTIVE_LOW ? GPIO_FROM_PAD : 0);
}

void board_pulse_healthy(void) {
    SIO_GPIO_OUT_XOR = 1u << BOARD_PIN_HEALTHY;
}

uint32_t board_hold_interrupts(void) {
    uint32_t held;
    __asm volatile("mrs %0, primask\n\tcpsid i" : "=r"(held)::"memory");
    return held;
}

void board_release_interrupts(uint32_t held) {
    __asm volatile("msr primask, %0" ::"r"(held) : "memory");
}

void board_expect_message(uint32_t within_us) {
    if (within_us > 0)
        TIMER_ALARM(BOARD_ALARM_HEARTBEAT) = TIMER_RAW_LOW + within_us;
    else
        TIMER_ARMED = 1u << BOARD_ALARM_HEARTBEAT;
}

uint64_t board_time_us(void) {
    for (;;) {
        const uint32_t high = TIMER_RAW_HIGH;
        const uint32_t low = TIMER_RAW_LOW;
        if (high == TIMER_RAW_HIGH) return (uint64_t)high << 32 | low;
    }
}

void board_watch_can_interrupt(void) {
    watch_edge(BOARD_PIN_CAN_INTERRUPT, GPIO_EDGE_LOW(BOARD_PIN_CAN_INTERRUPT));
}

void board_enable_can_interrupt(void) {
    NVIC_IPR(IRQ_CAN) = NVIC_PRIORITY(IRQ_CAN, 3);
    NVIC_ISER = 1u << IRQ_CAN;
}

void board_raise_can_interrupt(void) {
    NVIC_ISPR = 1u << IRQ_CAN;
}

void board_sleep(void) {
    TIMER_ALARM(BOARD_ALARM_TICK) = TIMER_RAW_LOW + WAKE_US;
    __asm volatile("cpsid i" ::: "memory");
    const uint32_t begin_us = TIMER_RAW_LOW;
    if (!board_is_woken) __asm volatile("wfi");  // wakes on a pending interrupt although masked (ARMv6-M B1.5.19)
    slept_us += TIMER_RAW_LOW - begin_us;
    __asm volatile("cpsie i" ::: "memory");
    board_is_woken = false;
}

uint32_t board_slept_us(void) {
    return slept_us;
}

void board_feed_watchdog(void) {
    WATCHDOG_LOAD = WATCHDOG_COUNTS_A_US * WATCHDOG_US;
}

bool board_was_reset_by_watchdog(void) {
    return reset_by_watchdog;
}

_Noreturn void board_reset(void) {
    WATCHDOG_CTRL = WATCHDOG_TRIGGER;
    for (;;) {
    }
}

_Noreturn void board_enter_bootloader(void) {
    board_dark();
    WATCHDOG_SCRATCH(3) =
        0;  // the boot ROM restarts by watchdog, now and after flashing: no fault of the next firmware
    const rom_lookup_function lookup = (rom_lookup_function)(uint32_t)ROM_LOOKUP;
    const rom_usb_boot_function usb_boot = (rom_usb_boot_function)lookup(ROM_FUNCTION_TABLE, ROM_CODE('U', 'B'));
    usb_boot(0, 0);  // no activity lamp: every pin stays as it is in reset; both of its interfaces
    board_reset();   // where a boot ROM does not know the function
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
