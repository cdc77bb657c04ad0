// SPDX-License-Identifier: MIT
// The registers of the RP2040 that this firmware uses, each with its section of the RP2040 datasheet.
#ifndef OLS_RP2040_H
#define OLS_RP2040_H

#include <stdint.h>

#define REGISTER(address) (*(volatile uint32_t*)(address))
// Aliases of peripheral registers that set or clear the bits written, in one bus access (2.1.2).
#define REGISTER_SET(address) REGISTER((address) + 0x2000)
#define REGISTER_CLEAR(address) REGISTER((address) + 0x3000)

// Resets (2.14.3)
#define RESETS_RESET 0x4000c000
#define RESETS_RESET_DONE REGISTER(0x4000c008)
enum {
    RESET_BUSCTRL = 1 << 1,
    RESET_DMA = 1 << 2,
    RESET_IO_BANK0 = 1 << 5,
    RESET_PADS_BANK0 = 1 << 8,
    RESET_PIO0 = 1 << 10,
    RESET_PIO1 = 1 << 11,
    RESET_PLL_SYS = 1 << 12,
    RESET_PLL_USB = 1 << 13,
    RESET_SPI0 = 1 << 16,
    RESET_SPI1 = 1 << 17,
    RESET_SYSINFO = 1 << 19,
    RESET_TIMER = 1 << 21,
    RESET_USBCTRL = 1 << 24
};

// Resets blocks (RESET_ bits) and waits until they answer: known state, also after a jump from a debugger.
static inline __attribute__((always_inline)) void reset_blocks(uint32_t blocks) {
    REGISTER_SET(RESETS_RESET) = blocks;
    REGISTER_CLEAR(RESETS_RESET) = blocks;
    while (~RESETS_RESET_DONE & blocks) {
    }
}

// Boot ROM: functions by two letters, found with a function of its own (2.8.3)
#define ROM_FUNCTION_TABLE (*(volatile uint16_t*)0x14)
#define ROM_LOOKUP (*(volatile uint16_t*)0x18)
#define ROM_CODE(first, second) ((uint32_t)(first) | (uint32_t)(second) << 8)
typedef uint32_t (*rom_lookup_function)(uint32_t table, uint32_t code);
typedef void (*rom_usb_boot_function)(uint32_t activity_pin_mask, uint32_t disable_interface_mask);  // 2.8.3.1.6

// Power-on state machine: what a watchdog reset resets (2.13.5)
#define PSM_WDSEL REGISTER(0x40010008)
enum { PSM_ALL_BUT_OSCILLATORS = 0x1fffc };

// Crystal oscillator (2.16.7)
#define XOSC_CTRL REGISTER(0x40024000)
#define XOSC_STATUS REGISTER(0x40024004)
#define XOSC_STARTUP REGISTER(0x4002400c)
// STARTUP counts 256 periods of 12 MHz a step, 14 bits of them. A Pico's crystal takes some 6 ms, others several times that.
enum { XOSC_1_15MHZ = 0xaa0, XOSC_ENABLE = 0xfab << 12, XOSC_STARTUP_64MS = 64 * 47 };
#define XOSC_STABLE (1u << 31)

// Ring oscillator: a random bit (2.17.8)
#define ROSC_RANDOMBIT REGISTER(0x4006001c)

// Phase-locked loops (2.18.4)
#define PLL_SYS_BASE 0x40028000
#define PLL_USB_BASE 0x4002c000
#define PLL_CS(base) REGISTER((base) + 0x0)
#define PLL_PWR(base) ((base) + 0x4)
#define PLL_FBDIV(base) REGISTER((base) + 0x8)
#define PLL_PRIM(base) REGISTER((base) + 0xc)
enum { PLL_PWR_PD = 1 << 0, PLL_PWR_POSTDIVPD = 1 << 3, PLL_PWR_VCOPD = 1 << 5 };
#define PLL_CS_LOCK (1u << 31)

// Clocks (2.15.7)
#define CLK_REF_CTRL REGISTER(0x40008030)
#define CLK_REF_SELECTED REGISTER(0x40008038)
#define CLK_SYS_CTRL 0x4000803c
#define CLK_SYS_SELECTED REGISTER(0x40008044)
#define CLK_PERI_CTRL REGISTER(0x40008048)
#define CLK_USB_CTRL REGISTER(0x40008054)
enum {
    CLK_REF_SRC_XOSC = 2,
    CLK_SYS_SRC_AUX = 1,  // the auxiliary source after reset is PLL_SYS
    CLK_ENABLE = 1 << 11  // for clk_usb and clk_peri, whose sources after reset are PLL_USB and clk_sys
};

// Watchdog (4.7.6)
#define WATCHDOG_CTRL REGISTER(0x40058000)
#define WATCHDOG_LOAD REGISTER(0x40058004)
#define WATCHDOG_REASON REGISTER(0x40058008)
#define WATCHDOG_SCRATCH(n) REGISTER(0x4005800c + 4 * (n))
#define WATCHDOG_TICK REGISTER(0x4005802c)
enum { WATCHDOG_ENABLE = 1 << 30, WATCHDOG_TICK_ENABLE = 1 << 9, WATCHDOG_COUNTS_A_US = 2 };  // erratum RP2040-E1
#define WATCHDOG_TRIGGER (1u << 31)

// Timer, microseconds (4.6.5)
#define TIMER_ALARM(n) REGISTER(0x40054010 + 4 * (n))
#define TIMER_ARMED REGISTER(0x40054020)  // write an alarm's bit to disarm it
#define TIMER_RAW_HIGH REGISTER(0x40054024)
#define TIMER_RAW_LOW REGISTER(0x40054028)
#define TIMER_INTR REGISTER(0x40054034)
#define TIMER_INTE REGISTER(0x40054038)

// GPIO control (2.19.6.1) and pads (2.19.6.3)
#define GPIO_CTRL(pin) REGISTER(0x40014004 + 8 * (pin))
#define PAD_GPIO(pin) REGISTER(0x4001c004 + 4 * (pin))
#define GPIO_STATUS(pin) REGISTER(0x40014000 + 8 * (pin))
#define GPIO_FROM_PAD (1u << 17)
// Edges of inputs, eight pins a register, four bits each: write an edge's bit to clear it
#define GPIO_INTR(pin) REGISTER(0x400140f0 + 4 * ((pin) / 8))
#define GPIO_INTE(pin) REGISTER(0x40014100 + 4 * ((pin) / 8))  // of processor 0
#define GPIO_INTS(pin) REGISTER(0x40014120 + 4 * ((pin) / 8))  // what has come of those enabled
#define GPIO_EDGE_LOW(pin) (4u << 4 * ((pin) % 8))
#define GPIO_EDGE_HIGH(pin) (8u << 4 * ((pin) % 8))
enum {
    GPIO_FUNCTION_SPI = 1,
    GPIO_FUNCTION_SIO = 5,
    GPIO_FUNCTION_PIO0 = 6,
    GPIO_FUNCTION_PIO1 = 7,
    GPIO_FUNCTION_USB_MUXING =
        8,  // GPIO 15: the controller's D+ while USB_MUXING_TO_DIGITAL_PAD (appendix B, RP2040-E5)
    GPIO_FUNCTION_NONE = 31,
    GPIO_OUTPUT_INVERTED = 1 << 8,
    GPIO_OUTPUT_LOW = 2 << 8,
    GPIO_OUTPUT_HIGH = 3 << 8,
    GPIO_OUTPUT_NEVER = 2 << 12,
    GPIO_OUTPUT_ALWAYS = 3 << 12,
    GPIO_INPUT_INVERTED = 1 << 16,
    GPIO_INPUT_HIGH = 3 << 16,
    PAD_SCHMITT = 1 << 1,
    PAD_PULL_DOWN = 1 << 2,
    PAD_PULL_UP = 1 << 3,
    PAD_4MA = 1 << 4,
    PAD_12MA = 3 << 4,
    PAD_INPUT = 1 << 6
};

// QSPI pads' control, to hold the flash's chip select by hand (2.19.6.2)
#define QSPI_SS_CTRL REGISTER(0x4001800c)
enum { QSPI_SS_AUTO = 0, QSPI_SS_LOW = 2 << 8, QSPI_SS_HIGH = 3 << 8 };

// Flash interface (4.10.13)
#define SSI_CTRLR0 REGISTER(0x18000000)
#define SSI_SSIENR REGISTER(0x18000008)
#define SSI_SER REGISTER(0x18000010)
#define SSI_SR REGISTER(0x18000028)
#define SSI_DR0 REGISTER(0x18000060)
enum { SSI_8_BITS_BOTH_WAYS = 7 << 16, SSI_SR_RECEIVED = 1 << 3 };

// SPI, ARM PL022 (4.4.4)
#define SPI_CR0(block) REGISTER(0x4003c000 + 0x4000 * (block))
#define SPI_CR1(block) REGISTER(0x4003c004 + 0x4000 * (block))
#define SPI_DR(block) REGISTER(0x4003c008 + 0x4000 * (block))
#define SPI_SR(block) REGISTER(0x4003c00c + 0x4000 * (block))
#define SPI_CPSR(block) REGISTER(0x4003c010 + 0x4000 * (block))
enum { SPI_8_BITS = 7, SPI_MODE_1_1 = 3 << 6, SPI_ENABLE = 1 << 1, SPI_SR_RECEIVED = 1 << 2 };

// Bus priority (2.1.5)
#define BUSCTRL_BUS_PRIORITY REGISTER(0x40030000)
enum { BUS_PRIORITY_DMA = 1 << 8 | 1 << 12 };

// PIO (3.7)
#define PIO0_BASE 0x50200000
#define PIO1_BASE 0x50300000
#define PIO_CTRL(base) ((base) + 0x000)
#define PIO_TX_LEVEL(base, machine) (REGISTER((base) + 0x00c) >> 8 * (machine)&15)  // words in the FIFO
#define PIO_TXF(base, machine) REGISTER((base) + 0x010 + 4 * (machine))
#define PIO_RXF(base, machine) REGISTER((base) + 0x020 + 4 * (machine))
#define PIO_IRQ(base) REGISTER((base) + 0x030)
#define PIO_IRQ_FORCE(base) REGISTER((base) + 0x034)
#define PIO_INSTR_MEM(base, word) REGISTER((base) + 0x048 + 4 * (word))
#define PIO_SM_CLKDIV(base, machine) REGISTER((base) + 0x0c8 + 0x18 * (machine))
#define PIO_SM_EXECCTRL(base, machine) REGISTER((base) + 0x0cc + 0x18 * (machine))
#define PIO_SM_SHIFTCTRL(base, machine) REGISTER((base) + 0x0d0 + 0x18 * (machine))
#define PIO_SM_ADDR(base, machine) REGISTER((base) + 0x0d4 + 0x18 * (machine))
#define PIO_SM_INSTR(base, machine) REGISTER((base) + 0x0d8 + 0x18 * (machine))
#define PIO_SM_PINCTRL(base, machine) REGISTER((base) + 0x0dc + 0x18 * (machine))
#define PIO_IRQ0_INTE(base) ((base) + 0x12c)
#define PIO_IRQ1_INTE(base) ((base) + 0x138)
#define PIO_CTRL_ENABLE(machine) (1u << (machine))
#define PIO_CTRL_RESTART(machine) (0x11u << (4 + (machine)))  // the machine and its clock divider
#define PIO_INTE_FLAG(flag) (1u << (8 + (flag)))
#define PIO_CLKDIV(divider) ((uint32_t)(divider) << 16)
#define PIO_EXEC_WRAP(target, top) ((uint32_t)(top) << 12 | (uint32_t)(target) << 7)
#define PIO_EXEC_JMP_PIN(pin) ((uint32_t)(pin) << 24)
#define PIO_EXEC_STATUS_TX_BELOW(words) ((uint32_t)(words))
#define PIO_SHIFT_JOIN_RX (1u << 31)
#define PIO_SHIFT_JOIN_TX (1u << 30)
#define PIO_SHIFT_OUT_RIGHT (1u << 19)
#define PIO_PINS_OUT(base, count) ((uint32_t)(count) << 20 | (uint32_t)(base))
#define PIO_PINS_IN(base) ((uint32_t)(base) << 15)
#define PIO_PINS_SET(base, count) ((uint32_t)(count) << 26 | (uint32_t)(base) << 5)
#define PIO_PINS_SIDE(base, count) ((uint32_t)(count) << 29 | (uint32_t)(base) << 10)
// Instructions that the processor executes on a machine (3.4)
enum {
    PIO_JMP = 0x0000,            // | address
    PIO_PULL = 0x80a0,           // pull block
    PIO_MOV_PINS_NULL = 0xa003,  // with side-set 0 where the machine has one
    PIO_MOV_Y_OSR = 0xa047,
    PIO_MOV_X_ONES = 0xa02b,  // mov x, ~null
    PIO_MOV_ISR_OSR = 0xa0c7,
    PIO_SET_PINS = 0xe000  // | value
};

// DMA (2.5.7)
#define DMA_READ_ADDR(channel) REGISTER(0x50000000 + 0x40 * (channel))
#define DMA_WRITE_ADDR(channel) REGISTER(0x50000004 + 0x40 * (channel))
#define DMA_TRANS_COUNT(channel) REGISTER(0x50000008 + 0x40 * (channel))
#define DMA_CTRL_TRIG(channel) REGISTER(0x5000000c + 0x40 * (channel))
#define DMA_AL1_CTRL(channel) REGISTER(0x50000010 + 0x40 * (channel))
#define DMA_AL3_READ_ADDR_TRIG(channel) REGISTER(0x5000003c + 0x40 * (channel))
#define DMA_CHAN_ABORT REGISTER(0x50000444)
#define DMA_CTRL_STOPPED(channel) DMA_CTRL_CHAIN_TO(channel)  // of its own number: to none
#define DMA_CTRL_CHAIN_TO(channel) ((uint32_t)(channel) << 11)
#define DMA_CTRL_PACE(request) ((uint32_t)(request) << 15)
#define DMA_CTRL_READ_RING(bits) ((uint32_t)(bits) << 6)
#define DMA_CTRL_WRITE_RING(bits) (1u << 10 | (uint32_t)(bits) << 6)
enum {
    DMA_CTRL_ENABLE = 1 << 0,
    DMA_CTRL_HIGH_PRIORITY = 1 << 1,
    DMA_CTRL_WORDS = 2 << 2,
    DMA_CTRL_INCREMENT_READ = 1 << 4,
    DMA_CTRL_INCREMENT_WRITE = 1 << 5,
    DMA_CTRL_BUSY = 1 << 24,
    DMA_REQUEST_PIO0_TX0 = 0,
    DMA_REQUEST_PIO0_TX1 = 1,
    DMA_REQUEST_PIO1_RX0 = 12,
    DMA_REQUEST_PIO1_RX2 = 14,
    DMA_REQUEST_NONE = 0x3f
};

// System information: 1 in the top four bits for B0 and B1, 2 for B2 (2.20)
#define SYSINFO_CHIP_ID REGISTER(0x40000000)
#define SYSINFO_CHIP_REVISION (SYSINFO_CHIP_ID >> 28)
#define REVISION_B2 2

// USB device controller (4.1.4) and its memory (4.1.2.5)
#define USB_MEMORY 0x50100000
#define USB_ADDR_ENDP REGISTER(0x50110000)
#define USB_MAIN_CTRL REGISTER(0x50110040)
#define USB_SOF_RD REGISTER(0x50110048)  // a read clears USB_INT_SOF
#define USB_SIE_CTRL 0x5011004c
#define USB_SIE_STATUS REGISTER(0x50110050)
#define USB_SIE_STATUS_CLEAR REGISTER_CLEAR(0x50110050)
#define USB_BUFF_STATUS REGISTER(0x50110058)
#define USB_BUFF_STATUS_CLEAR REGISTER_CLEAR(0x50110058)
#define USB_EP_ABORT 0x50110060
#define USB_EP_ABORT_DONE REGISTER(0x50110064)
#define USB_EP_ABORT_DONE_CLEAR REGISTER_CLEAR(0x50110064)
#define USB_EP_STALL_ARM REGISTER(0x50110068)
#define USB_MUXING REGISTER(0x50110074)
#define USB_PWR REGISTER(0x50110078)
#define USB_PHY_DIRECT REGISTER(0x5011007c)
#define USB_PHY_DIRECT_OVERRIDE REGISTER(0x50110080)
#define USB_INTR REGISTER(0x5011008c)
#define USB_INTE 0x50110090
#define USB_INTS REGISTER(0x50110098)
#define USB_ENDPOINT_CONTROL_IN(endpoint) REGISTER(USB_MEMORY + 8 * (endpoint))
#define USB_ENDPOINT_CONTROL_OUT(endpoint) REGISTER(USB_MEMORY + 4 + 8 * (endpoint))
#define USB_BUFFER_CONTROL_IN(endpoint) REGISTER(USB_MEMORY + 0x80 + 8 * (endpoint))
#define USB_BUFFER_CONTROL_OUT(endpoint) REGISTER(USB_MEMORY + 0x84 + 8 * (endpoint))
#define USB_ENDPOINT_ENABLE (1u << 31)
enum {
    USB_SIE_PULLUP = 1 << 16,
    USB_SIE_EP0_INT_1BUF = 1 << 29,
    USB_SIE_BUS_RESET = 1 << 19,
    USB_SIE_SETUP_REC = 1 << 17,
    USB_SIE_CONNECTED = 1 << 16,
    USB_SIE_SUSPENDED = 1 << 4,  // read only; writing it clears USB_INT_SUSPEND
    USB_SIE_LINE_STATE = 3 << 2,
    USB_SIE_LINE_SE0 = 0 << 2,
    USB_SIE_ERRORS = 0xf << 24,  // RX_TIMEOUT, RX_OVERFLOW, BIT_STUFF_ERROR, CRC_ERROR
    USB_MUXING_TO_PHY = 1 << 0,
    USB_MUXING_TO_DIGITAL_PAD = 1 << 2,
    USB_MUXING_SOFTCON = 1 << 3,
    USB_PHY_DP_PULLUP = 1 << 1,
    USB_PHY_DP_PULLUP_OVERRIDE = 1 << 2,
    USB_PWR_VBUS_DETECT = 1 << 2,
    USB_PWR_VBUS_DETECT_OVERRIDE = 1 << 3,
    USB_INT_BUFF_STATUS = 1 << 4,
    USB_INT_BUS_RESET = 1 << 12,
    USB_INT_SUSPEND = 1 << 14,  // the state has changed, either way
    USB_INT_SETUP_REQ = 1 << 16,
    USB_INT_SOF = 1 << 17,
    USB_ENDPOINT_INTERRUPT = 1 << 29,
    USB_ENDPOINT_BULK = 2 << 26,
    USB_BUFFER_FULL = 1 << 15,
    USB_BUFFER_LAST = 1 << 14,
    USB_BUFFER_DATA1 = 1 << 13,
    USB_BUFFER_STALL = 1 << 11,
    USB_BUFFER_AVAILABLE = 1 << 10,
    USB_BUFFER_BYTES = 0x3ff
};

// Single-cycle IO: output levels, and a write of ones that inverts them (2.3.1.2, 2.3.1.7); the divider, done 8 cycles after the
// divisor is written (2.3.1.5)
#define SIO_GPIO_OUT REGISTER(0xd0000010)
#define SIO_GPIO_OUT_XOR REGISTER(0xd000001c)
#define SIO_DIV_UDIVIDEND REGISTER(0xd0000060)
#define SIO_DIV_UDIVISOR REGISTER(0xd0000064)
#define SIO_DIV_QUOTIENT REGISTER(0xd0000070)

// Cortex-M0+ (2.4.8)
#define NVIC_ISER REGISTER(0xe000e100)
#define NVIC_ICER REGISTER(0xe000e180)
#define NVIC_ISPR REGISTER(0xe000e200)
// Two bits each, highest in a byte: 0 interrupts 1, and so on
#define NVIC_IPR(interrupt) REGISTER(0xe000e400 + (interrupt) / 4 * 4)
#define NVIC_PRIORITY(interrupt, priority) ((uint32_t)(priority) << (8 * ((interrupt) % 4) + 6))
#define SCB_VTOR REGISTER(0xe000ed08)

// Interrupts (2.3.2). Nothing but software raises 26 to 31.
enum {
    IRQ_TIMER_0 = 0,
    IRQ_TIMER_1 = 1,
    IRQ_TIMER_2 = 2,
    IRQ_USBCTRL = 5,
    IRQ_PIO0_0 = 7,
    IRQ_PIO1_0 = 9,
    IRQ_PIO1_1 = 10,
    IRQ_GPIO = 13,
    IRQ_CAN = 26,
    IRQ_COUNT = 27
};

#endif
