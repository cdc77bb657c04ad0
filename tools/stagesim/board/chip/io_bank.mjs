// SPDX-License-Identifier: MIT
// The registers of IO_BANK0 and PADS_BANK0 (RP2040 datasheet 2.19.2, 2.19.3 and 2.19.6). What they do to the pins' levels is
// in pads.mjs.
import { BasePeripheral } from 'rp2040js';

const GPIO_COUNT = 30;
const CTRL_FIELDS = 0x3003331f;
const CTRL_RESET = 0x1f;
const IRQ_OVERRIDE = 0x30000000;
const STATUS_LAST = 0xec;
const INTR0 = 0xf0;
const WAKE_INTS3 = 0x18c;
const REGISTERS = 4; // of eight pins each
const EDGES = 0xcccccccc; // bits 3 and 2 of each pin: rise and fall, latched; 1 and 0: high and low now
const INTERRUPT = 13; // IO_IRQ_BANK0 (2.3.2)
const NONE = 31;
const CLOCKS = 8;
const CLOCK_PINS = new Set([20, 21, 22, 23, 24, 25]);
const USB_DP = 15; // and there the USB controller's D+, by the work-around of erratum RP2040-E5
const PAD_RESET = 0x56; // input enabled, pulled down, Schmitt trigger, 4 mA
const PAD_FIELDS = 0xff;
const SWCLK = 0x7c;
const SWD = 0x80;

export class IoBank extends BasePeripheral {
  /**
   * @param {import('rp2040js').RP2040} chip
   * @param {import('./pads.mjs').Pads} pads
   */
  constructor(chip, pads) {
    super(chip, 'IO_BANK0');
    this.pads = pads;
    this.edges = new Int32Array(REGISTERS);
    /** Processor 0, processor 1 and wake-up from dormant: enables and forces. */
    this.sets = Array.from({ length: 3 }, () => ({ enable: new Int32Array(REGISTERS), force: new Int32Array(REGISTERS) }));
  }

  /** As after the block's reset. */
  reset() {
    this.edges.fill(0);
    for (const { enable, force } of this.sets) {
      enable.fill(0);
      force.fill(0);
    }
    this.watched = false; // by processor 0
    for (const pin of this.rp2040.gpio) pin.ctrl = CTRL_RESET;
    this.pads.configure();
    this.#updateInterrupt();
  }

  /** Inputs have changed: edges are latched whether or not anybody has enabled them (2.19.3). */
  inputsChanged(risen, fallen) {
    for (let n = 0, changed = risen | fallen; changed !== 0; n++, changed >>>= 8) {
      if (changed & 0xff) this.edges[n] |= (spread(risen >>> (8 * n)) << 3) | (spread(fallen >>> (8 * n)) << 2);
    }
    if (this.watched) this.#updateInterrupt();
  }

  #raw(n) {
    const high = spread(this.pads.inputs >>> (8 * n));
    return this.edges[n] | (high << 1) | ((n === 3 ? 0x111111 : 0x11111111) & ~high);
  }

  #status({ enable, force }, n) {
    return (this.#raw(n) & enable[n]) | force[n];
  }

  #updateInterrupt() {
    const [processor0] = this.sets;
    let status = 0;
    for (let n = 0; n < REGISTERS; n++) {
      if (processor0.enable[n] | processor0.force[n]) status |= this.#status(processor0, n);
    }
    this.rp2040.setInterrupt(INTERRUPT, status !== 0);
  }

  #note(section, text) {
    this.rp2040.violations.note(section, text);
  }

  readUint32(offset) {
    if (offset <= STATUS_LAST) {
      const pin = this.rp2040.gpio[offset >> 3];
      return (offset & 4 ? pin.ctrl : this.pads.status(offset >> 3)) >>> 0;
    }
    if (offset >= INTR0 && offset <= WAKE_INTS3) {
      const [set, kind, n] = this.#place(offset);
      if (kind === 'raw') return this.#raw(n) >>> 0;
      return (kind === 'status' ? this.#status(set, n) : set[kind][n]) >>> 0;
    }
    return 0;
  }

  #place(offset) {
    const row = (offset - INTR0) >> 4;
    const n = (offset >> 2) & 3;
    return row === 0 ? [null, 'raw', n] : [this.sets[Math.floor((row - 1) / 3)], ['enable', 'force', 'status'][(row - 1) % 3], n];
  }

  writeUint32(offset, value) {
    if (offset <= STATUS_LAST && offset & 4) {
      this.#writeControl(offset >> 3, value);
    } else if (offset >= INTR0 && offset <= WAKE_INTS3) {
      const [set, kind, n] = this.#place(offset);
      if (kind === 'raw') this.edges[n] &= ~(this.rawWriteValue & EDGES); // write clear, edges alone
      else if (kind !== 'status') set[kind][n] = n === 3 ? value & 0xffffff : value;
      this.watched = this.sets[0].enable.some(Boolean) || this.sets[0].force.some(Boolean);
      this.#updateInterrupt();
    }
  }

  #writeControl(n, value) {
    const select = value & 0x1f;
    if (select !== NONE && (select < 1 || select > 9 || (select === CLOCKS && !CLOCK_PINS.has(n) && n !== USB_DP))) {
      this.#note('2.19.2', `GPIO ${n} has no function ${select}`);
    }
    if (value & IRQ_OVERRIDE) this.#note('2.19.6.1', `GPIO ${n}: IRQOVER is not modelled`);
    const pin = this.rp2040.gpio[n];
    pin.ctrl = value & CTRL_FIELDS;
    pin.checkForUpdates();
  }
}

/** Eight bits, four apart. */
function spread(bits) {
  bits &= 0xff;
  bits = (bits | (bits << 12)) & 0x000f000f;
  bits = (bits | (bits << 6)) & 0x03030303;
  return (bits | (bits << 3)) & 0x11111111;
}

export class PadsBank extends BasePeripheral {
  /** @param {import('rp2040js').RP2040} chip */
  constructor(chip, pads) {
    super(chip, 'PADS_BANK0');
    this.pads = pads;
    this.voltageSelect = 0;
    this.debugPads = [0xda, 0x5a]; // SWCLK, SWD
  }

  reset() {
    this.voltageSelect = 0;
    for (const pin of this.rp2040.gpio) pin.padValue = PAD_RESET;
    this.pads.configure();
  }

  readUint32(offset) {
    if (offset === 0) return this.voltageSelect;
    if (offset === SWCLK || offset === SWD) return this.debugPads[(offset - SWCLK) >> 2];
    const pin = this.rp2040.gpio[(offset - 4) >> 2];
    return pin.padValue;
  }

  writeUint32(offset, value) {
    const pin = this.rp2040.gpio[(offset - 4) >> 2];
    if (offset === 0) {
      if (value & 1) this.rp2040.violations.note('2.19.6.3', 'PADS_BANK0: VOLTAGE_SELECT 1 is for 1.8 V: 3.3 V damages the pads');
      this.voltageSelect = value & 1;
    } else if (offset === SWCLK || offset === SWD) {
      this.debugPads[(offset - SWCLK) >> 2] = value & PAD_FIELDS;
    } else {
      pin.padValue = value & PAD_FIELDS;
      pin.checkForUpdates();
    }
  }
}
