// SPDX-License-Identifier: MIT
// Subsystem resets (RP2040 datasheet 2.14): a block that is held in reset loses what is written, and starts anew when it is let
// go. Some come out of reset only once their own clock runs (2.14.1).
import { BasePeripheral } from 'rp2040js';
import { BLOCKS } from './registers.mjs';

const ALL = 0x01ffffff;
const RESET = 0x0;
const WDSEL = 0x4;
const RELEASE_TICKS = 32; // from the register's write to RESET_DONE: some cycles of the block's clock; no figure is given
const NAMES = ['ADC', 'BUSCTRL', 'DMA', 'I2C0', 'I2C1', 'IO_BANK0', 'IO_QSPI', 'JTAG', 'PADS_BANK0', 'PADS_QSPI', 'PIO0', 'PIO1',
               'PLL_SYS', 'PLL_USB', 'PWM', 'RTC', 'SPI0', 'SPI1', 'SYSCFG', 'SYSINFO', 'TBMAN', 'TIMER', 'UART0', 'UART1',
               'USBCTRL'];
const CLOCKED_BY_PERI = mask('SPI0', 'SPI1', 'UART0', 'UART1');
const CLOCKED_BY_USB = mask('USBCTRL');
const CLOCKED_BY_NONE = mask('ADC', 'RTC'); // whose clocks are not modelled

export class Resets extends BasePeripheral {
  #time;
  #clocks;
  #held = ALL;
  #wdsel = 0;
  #doneAt = new Array(NAMES.length).fill(Infinity);

  /** @param {{cycle: number}} time @param {import('./clocks.mjs').Clocks} clocks */
  constructor(chip, time, clocks) {
    super(chip, 'RESETS');
    this.#time = time;
    this.#clocks = clocks;
  }

  /** Whether the block with this bit of RESET is held in reset, or has been let go and does not answer yet. */
  holds(bit) {
    return ((this.#held >> bit) & 1) === 1 || this.#time.cycle < this.#doneAt[bit];
  }

  /** Every block as if let go long ago. */
  assumeReleased() {
    this.#held = 0;
    this.#doneAt.fill(this.#time.cycle);
  }

  get #clocked() {
    return ALL & ~CLOCKED_BY_NONE & ~(this.#clocks.periHz > 0 ? 0 : CLOCKED_BY_PERI) & ~(this.#clocks.usbHz > 0 ? 0 : CLOCKED_BY_USB);
  }

  readUint32(offset) {
    if (offset === RESET) return this.#held;
    if (offset === WDSEL) return this.#wdsel;
    const done = this.#doneAt.reduce((bits, at, bit) => bits | (this.#time.cycle >= at ? 1 << bit : 0), 0);
    return done & ~this.#held & this.#clocked;
  }

  writeUint32(offset, value) {
    if (offset === WDSEL) this.#wdsel = value & ALL;
    if (offset !== RESET) return;
    const released = this.#held & ~value;
    const taken = ~this.#held & value & ALL;
    this.#held = value & ALL;
    for (let bit = 0; bit < NAMES.length; bit++) {
      if ((released >> bit) & 1) this.#doneAt[bit] = this.#time.cycle + RELEASE_TICKS;
      if ((taken >> bit) & 1) this.#reset(bit);
    }
  }

  #reset(bit) {
    this.#doneAt[bit] = Infinity;
    const block = BLOCKS.find(({ reset }) => reset === bit);
    if (block === undefined) return;
    const peripheral = this.rp2040.peripherals[(block.base >>> 14) << 2];
    if (typeof peripheral.reset !== 'function') throw new Error(`${block.name}: its reset is not modelled`);
    peripheral.reset();
  }
}

function mask(...names) {
  return names.reduce((bits, name) => bits | (1 << NAMES.indexOf(name)), 0);
}
