// SPDX-License-Identifier: MIT
// The registers that are modelled, by block, each with the bits that may be written (RP2040 datasheet, the "List of registers" of
// the section given). Whatever is not in this table is not modelled, and using it is a violation. tests/oracle compares
// it with the vendor's own machine-readable list.

import { USB_REGISTERS } from './usb_registers.mjs';

const NONE = 0; // read only
const WRITE_ONLY = true;
const ALL = 0xffffffff;

/** `count` registers `stride` bytes apart, one group after the other: NAMEn -> [offset, writable bits, write only]. */
function repeated(count, stride, group) {
  const all = {};
  for (let n = 0; n < count; n++) {
    for (const [name, [offset, ...rest]] of Object.entries(group)) all[name.replace('#', n)] = [offset + n * stride, ...rest];
  }
  return all;
}

const GPIO_CTRL = 0x3003331f; // FUNCSEL, OUTOVER, OEOVER, INOVER, IRQOVER
const PAD = 0xff;
const PINS = 0x3fffffff;
const PLL = { CS: [0x0, 0x13f], PWR: [0x4, 0x2d], FBDIV_INT: [0x8, 0xfff], PRIM: [0xc, 0x77000] };
const DMA_CTRL = 0x60ffffff;
const SPI = { SSPCR0: [0x0, 0xffff], SSPCR1: [0x4, 0xf], SSPDR: [0x8, 0xffff], SSPSR: [0xc, NONE], SSPCPSR: [0x10, 0xff],
              SSPIMSC: [0x14, 0xf], SSPRIS: [0x18, NONE], SSPMIS: [0x1c, NONE], SSPICR: [0x20, 0x3], SSPDMACR: [0x24, 0x3] };
const PIO = {
  CTRL: [0x0, 0xfff], FSTAT: [0x4, NONE], FDEBUG: [0x8, 0x0f0f0f0f], FLEVEL: [0xc, NONE],
  ...repeated(4, 4, { 'TXF#': [0x10, ALL, WRITE_ONLY], 'RXF#': [0x20, NONE] }),
  IRQ: [0x30, 0xff], IRQ_FORCE: [0x34, 0xff], INPUT_SYNC_BYPASS: [0x38, ALL],
  DBG_PADOUT: [0x3c, NONE], DBG_PADOE: [0x40, NONE], DBG_CFGINFO: [0x44, NONE],
  ...repeated(32, 4, { 'INSTR_MEM#': [0x48, 0xffff, WRITE_ONLY] }),
  ...repeated(4, 0x18, { 'SM#_CLKDIV': [0xc8, 0xffffff00], 'SM#_EXECCTRL': [0xcc, 0x7fffff9f], 'SM#_SHIFTCTRL': [0xd0, 0xffff0000],
                         'SM#_ADDR': [0xd4, NONE], 'SM#_INSTR': [0xd8, 0xffff], 'SM#_PINCTRL': [0xdc, ALL] }),
  INTR: [0x128, NONE],
  ...repeated(2, 12, { 'IRQ#_INTE': [0x12c, 0xfff], 'IRQ#_INTF': [0x130, 0xfff], 'IRQ#_INTS': [0x134, NONE] }),
};

/** What a block needs for its time to be what is modelled. */
export const FULL_CLOCK = 'clk_sys at 125 MHz';
export const TICK = 'the watchdog\'s tick at 1 MHz';

/** Writes to these are lost or change, and read as zeros, while their bit of RESETS is set; `reset` is that bit. */
export const BLOCKS = [
  { name: 'XIP_CTRL', section: '2.6.3.6', base: 0x14000000,
    registers: { CTRL: [0x0, 0xb], FLUSH: [0x4, 0x1], STAT: [0x8, NONE] } },
  { name: 'XIP_SSI', section: '4.10.13', base: 0x18000000, noAliases: true,
    registers: { CTRLR0: [0x0, 0x017fffff], CTRLR1: [0x4, 0xffff], SSIENR: [0x8, 1], SER: [0x10, 1], BAUDR: [0x14, 0xffff],
                 TXFLR: [0x20, NONE], RXFLR: [0x24, NONE], SR: [0x28, NONE], ICR: [0x48, NONE], DR0: [0x60, ALL],
                 RX_SAMPLE_DLY: [0xf0, 0xff], SPI_CTRLR0: [0xf4, 0xff07fb3f] } },
  { name: 'SYSINFO', section: '2.20.1', base: 0x40000000, reset: 19,
    registers: { CHIP_ID: [0x0, NONE], PLATFORM: [0x4, NONE], GITREF_RP2040: [0x40, NONE] } },
  { name: 'CLOCKS', section: '2.15.7', base: 0x40008000,
    registers: { CLK_REF_CTRL: [0x30, 0x63], CLK_REF_DIV: [0x34, 0x300], CLK_REF_SELECTED: [0x38, NONE],
                 CLK_SYS_CTRL: [0x3c, 0xe1], CLK_SYS_DIV: [0x40, ALL], CLK_SYS_SELECTED: [0x44, NONE],
                 CLK_PERI_CTRL: [0x48, 0xce0], CLK_USB_CTRL: [0x54, 0x130ce0], CLK_USB_DIV: [0x58, 0x300],
                 WAKE_EN0: [0xa0, ALL], WAKE_EN1: [0xa4, 0x7fff] } },
  { name: 'RESETS', section: '2.14.3', base: 0x4000c000,
    registers: { RESET: [0x0, 0x01ffffff], WDSEL: [0x4, 0x01ffffff], RESET_DONE: [0x8, NONE] } },
  { name: 'PSM', section: '2.13.5', base: 0x40010000,
    registers: { FRCE_ON: [0x0, 0x1ffff], FRCE_OFF: [0x4, 0x1ffff], WDSEL: [0x8, 0x1ffff], DONE: [0xc, NONE] } },
  { name: 'IO_BANK0', section: '2.19.6.1', base: 0x40014000, reset: 5,
    registers: { ...repeated(30, 8, { 'GPIO#_STATUS': [0x0, NONE], 'GPIO#_CTRL': [0x4, GPIO_CTRL] }),
                 ...repeated(3, 4, { 'INTR#': [0xf0, 0xcccccccc], 'PROC0_INTE#': [0x100, ALL], 'PROC0_INTF#': [0x110, ALL],
                                     'PROC0_INTS#': [0x120, NONE], 'PROC1_INTE#': [0x130, ALL], 'PROC1_INTF#': [0x140, ALL],
                                     'PROC1_INTS#': [0x150, NONE] }),
                 INTR3: [0xfc, 0x00cccccc], PROC0_INTE3: [0x10c, 0x00ffffff], PROC0_INTF3: [0x11c, 0x00ffffff],
                 PROC0_INTS3: [0x12c, NONE], PROC1_INTE3: [0x13c, 0x00ffffff], PROC1_INTF3: [0x14c, 0x00ffffff],
                 PROC1_INTS3: [0x15c, NONE] } },
  { name: 'IO_QSPI', section: '2.19.6.2', base: 0x40018000, reset: 6,
    registers: Object.assign({}, ...['SCLK', 'SS', 'SD0', 'SD1', 'SD2', 'SD3'].map((pin, n) => ({
      [`GPIO_QSPI_${pin}_STATUS`]: [8 * n, NONE], [`GPIO_QSPI_${pin}_CTRL`]: [8 * n + 4, GPIO_CTRL] }))) },
  { name: 'PADS_BANK0', section: '2.19.6.3', base: 0x4001c000, reset: 8,
    registers: { VOLTAGE_SELECT: [0x0, 1], ...repeated(30, 4, { 'GPIO#': [0x4, PAD] }), SWCLK: [0x7c, PAD], SWD: [0x80, PAD] } },
  { name: 'PADS_QSPI', section: '2.19.6.4', base: 0x40020000, reset: 9,
    registers: Object.assign({ VOLTAGE_SELECT: [0x0, 1] }, ...['SCLK', 'SD0', 'SD1', 'SD2', 'SD3', 'SS'].map((pin, n) => ({
      [`GPIO_QSPI_${pin}`]: [4 * n + 4, PAD] }))) },
  { name: 'XOSC', section: '2.16.7', base: 0x40024000,
    registers: { CTRL: [0x0, 0xffffff], STATUS: [0x4, 0x01000000], STARTUP: [0xc, 0x103fff] } },
  { name: 'PLL_SYS', section: '2.18.4', base: 0x40028000, reset: 12, registers: PLL },
  { name: 'PLL_USB', section: '2.18.4', base: 0x4002c000, reset: 13, registers: PLL },
  { name: 'BUSCTRL', section: '2.1.5', base: 0x40030000, reset: 1,
    registers: { BUS_PRIORITY: [0x0, 0x1111], BUS_PRIORITY_ACK: [0x4, NONE] } },
  { name: 'SPI0', section: '4.4.4', base: 0x4003c000, reset: 16, wants: FULL_CLOCK, registers: SPI },
  { name: 'SPI1', section: '4.4.4', base: 0x40040000, reset: 17, wants: FULL_CLOCK, registers: SPI },
  { name: 'TIMER', section: '4.6.5', base: 0x40054000, reset: 21, wants: TICK,
    registers: { TIMEHR: [0x8, NONE], TIMELR: [0xc, NONE], ...repeated(4, 4, { 'ALARM#': [0x10, ALL] }), ARMED: [0x20, 0xf],
                 TIMERAWH: [0x24, NONE], TIMERAWL: [0x28, NONE], INTR: [0x34, 0xf], INTE: [0x38, 0xf], INTF: [0x3c, 0xf],
                 INTS: [0x40, NONE] } },
  { name: 'WATCHDOG', section: '4.7.6', base: 0x40058000,
    registers: { CTRL: [0x0, 0xc7000000], LOAD: [0x4, 0xffffff, WRITE_ONLY], REASON: [0x8, NONE],
                 ...repeated(8, 4, { 'SCRATCH#': [0xc, ALL] }), TICK: [0x2c, 0x3ff] } },
  { name: 'ROSC', section: '2.17.8', base: 0x40060000, registers: { STATUS: [0x18, 0x01000000], RANDOMBIT: [0x1c, NONE] } },
  { name: 'VREG_AND_CHIP_RESET', section: '2.12.7', base: 0x40064000,
    registers: { VREG: [0x0, 0xf3], BOD: [0x4, 0xf1], CHIP_RESET: [0x8, 0x01000000] } },
  { name: 'DMA', section: '2.5.7', base: 0x50000000, reset: 2, wants: FULL_CLOCK,
    registers: { ...repeated(12, 0x40, {
      'CH#_READ_ADDR': [0x00, ALL], 'CH#_WRITE_ADDR': [0x04, ALL], 'CH#_TRANS_COUNT': [0x08, ALL],
      'CH#_CTRL_TRIG': [0x0c, DMA_CTRL], 'CH#_AL1_CTRL': [0x10, DMA_CTRL], 'CH#_AL1_READ_ADDR': [0x14, ALL],
      'CH#_AL1_WRITE_ADDR': [0x18, ALL], 'CH#_AL1_TRANS_COUNT_TRIG': [0x1c, ALL], 'CH#_AL2_CTRL': [0x20, DMA_CTRL],
      'CH#_AL2_TRANS_COUNT': [0x24, ALL], 'CH#_AL2_READ_ADDR': [0x28, ALL], 'CH#_AL2_WRITE_ADDR_TRIG': [0x2c, ALL],
      'CH#_AL3_CTRL': [0x30, DMA_CTRL], 'CH#_AL3_WRITE_ADDR': [0x34, ALL], 'CH#_AL3_TRANS_COUNT': [0x38, ALL],
      'CH#_AL3_READ_ADDR_TRIG': [0x3c, ALL] }),
                 INTR: [0x400, 0xffff], INTE0: [0x404, 0xffff], INTF0: [0x408, 0xffff], INTS0: [0x40c, 0xffff],
                 INTE1: [0x414, 0xffff], INTF1: [0x418, 0xffff], INTS1: [0x41c, 0xffff],
                 ...repeated(4, 4, { 'TIMER#': [0x420, ALL] }),
                 MULTI_CHAN_TRIGGER: [0x430, 0xffff], CHAN_ABORT: [0x444, 0xffff], N_CHANNELS: [0x448, NONE],
                 ...repeated(12, 0x40, { 'CH#_DBG_CTDREQ': [0x800, 0x3f], 'CH#_DBG_TCR': [0x804, NONE] }) } },
  { name: 'USBCTRL', section: '4.1.4', base: 0x50110000, reset: 24, wants: FULL_CLOCK, registers: USB_REGISTERS },
  { name: 'PIO0', section: '3.7', base: 0x50200000, reset: 10, wants: FULL_CLOCK, registers: PIO },
  { name: 'PIO1', section: '3.7', base: 0x50300000, reset: 11, wants: FULL_CLOCK, registers: PIO },
  { name: 'SIO', section: '2.3.1.7', base: 0xd0000000, noAliases: true,
    registers: { CPUID: [0x0, NONE], GPIO_IN: [0x4, NONE], GPIO_HI_IN: [0x8, NONE],
                 GPIO_OUT: [0x10, PINS], GPIO_OUT_SET: [0x14, PINS], GPIO_OUT_CLR: [0x18, PINS], GPIO_OUT_XOR: [0x1c, PINS],
                 GPIO_OE: [0x20, PINS], GPIO_OE_SET: [0x24, PINS], GPIO_OE_CLR: [0x28, PINS], GPIO_OE_XOR: [0x2c, PINS],
                 DIV_UDIVIDEND: [0x60, ALL], DIV_UDIVISOR: [0x64, ALL], DIV_SDIVIDEND: [0x68, ALL], DIV_SDIVISOR: [0x6c, ALL],
                 DIV_QUOTIENT: [0x70, ALL], DIV_REMAINDER: [0x74, ALL], DIV_CSR: [0x78, NONE] } },
  // Cortex-M0+ (datasheet 2.4.8, ARMv6-M B3.2, B3.3, B3.4).
  { name: 'PPB', section: '2.4.8', base: 0xe000e000, noAliases: true,
    registers: { SYST_CSR: [0x10, 0x7], SYST_RVR: [0x14, 0xffffff], SYST_CVR: [0x18, ALL], NVIC_ISER: [0x100, ALL],
                 NVIC_ICER: [0x180, ALL], NVIC_ISPR: [0x200, ALL], NVIC_ICPR: [0x280, ALL],
                 ...repeated(8, 4, { 'NVIC_IPR#': [0x400, 0xc0c0c0c0] }), CPUID: [0xd00, NONE], ICSR: [0xd04, 0x9e000000],
                 VTOR: [0xd08, 0xffffff00], AIRCR: [0xd0c, 0xffff0006], SCR: [0xd10, 0x16], SHPR2: [0xd1c, 0xc0000000],
                 SHPR3: [0xd20, 0xc0c00000] } },
];

/** Blocks that the chip has and this model has not: named, so that using one is told as what it is. */
export const NOT_MODELLED = { SYSCFG: 0x40004000, UART0: 0x40034000, UART1: 0x40038000, I2C0: 0x40044000, I2C1: 0x40048000,
                              ADC: 0x4004c000, PWM: 0x40050000, RTC: 0x4005c000, TBMAN: 0x4006c000 };
