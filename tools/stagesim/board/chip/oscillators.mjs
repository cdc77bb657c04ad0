// SPDX-License-Identifier: MIT
// Where clocks come from: the crystal oscillator (RP2040 datasheet 2.16) and the two PLLs (2.18), with the time that each takes
// before there is a clock to use. `hz` is what a user of the clock gets now, 0 for none.
import { BasePeripheral } from 'rp2040js';

const TICK_NS = 8;
const NEVER = Infinity;
const STABLE = 0x80000000;
const ENABLED = 1 << 12;

const XOSC_CTRL = 0x0;
const XOSC_STATUS = 0x4;
const XOSC_STARTUP = 0xc;
const XOSC_ENABLE = 0xfab;
const XOSC_DISABLE = 0xd1e;
const XOSC_RANGE = 0xaa0;
const STARTUP_RESET = 0xc4; // 2.16.7

export const CRYSTAL_HZ = 12_000_000;

export class CrystalOscillator extends BasePeripheral {
  #time;
  #crystalTicks; // from being enabled until the crystal really swings, as long as that crystal takes
  #ctrl = 0;
  #startup = STARTUP_RESET;
  #enabledAt = NEVER;
  #wasStable = false;

  /** @param {{cycle: number}} time @param {number} crystal_ms that the board's crystal needs */
  constructor(chip, time, crystal_ms) {
    super(chip, 'XOSC');
    this.#time = time;
    this.#crystalTicks = (crystal_ms * 1e6) / TICK_NS;
    /** Called when the clock may have come or gone. */
    this.onChange = () => {};
  }

  /** A watchdog reset leaves it running where PSM_WDSEL does not select it: on for so many ticks by now. */
  keepRunning(ticks) {
    this.#enabledAt = -ticks;
    this.#wasStable = ticks >= this.#delayTicks;
  }

  /** Ticks since it was enabled; -Infinity if it is not. */
  get runningFor() {
    return this.#time.cycle - this.#enabledAt;
  }

  get enabled() {
    return this.#enabledAt !== NEVER;
  }

  get hz() {
    return this.runningFor >= this.#crystalTicks ? CRYSTAL_HZ : 0;
  }

  /** What STATUS says, which only counts: 256 periods for each step of DELAY. */
  get saysStable() {
    return this.enabled && (this.#wasStable || this.runningFor >= this.#delayTicks);
  }

  get #delayTicks() {
    const steps = (this.#startup & 0x3fff) * (this.#startup & (1 << 20) ? 4 : 1);
    return (steps * 256 * 1e9) / CRYSTAL_HZ / TICK_NS;
  }

  /** To be called by whoever is about to use the clock. */
  use(who) {
    if (this.hz > 0) return;
    const { violations } = this.rp2040;
    if (!this.saysStable) {
      violations.note('2.16.3', `${who} is given the crystal oscillator before STATUS says that it is stable`);
    } else {
      violations.note('2.16.3', `${who} is given a crystal oscillator that is not stable yet: STARTUP waits for ` +
        `${ms(this.#delayTicks)} ms, this crystal needs ${ms(this.#crystalTicks)} ms`);
    }
  }

  readUint32(offset) {
    this.onChange();
    if (offset === XOSC_CTRL) return this.#ctrl;
    if (offset === XOSC_STARTUP) return this.#startup;
    return ((this.saysStable ? STABLE : 0) | (this.enabled ? ENABLED : 0)) >>> 0;
  }

  writeUint32(offset, value) {
    if (offset === XOSC_STARTUP) {
      this.#wasStable = this.saysStable;
      this.#startup = value;
    } else if (offset === XOSC_CTRL) {
      this.#writeCtrl(value);
    } else if (offset === XOSC_STATUS) {
      this.rp2040.violations.note('2.16.7', 'XOSC STATUS is written: BADWRITE is not modelled');
    }
    this.onChange();
  }

  #writeCtrl(value) {
    const enable = value >>> 12;
    if (![XOSC_ENABLE, XOSC_DISABLE].includes(enable) || (value & 0xfff) !== XOSC_RANGE) {
      this.rp2040.violations.note('2.16.7', `XOSC CTRL = 0x${value.toString(16)}: neither ENABLE nor DISABLE of 1 to 15 MHz`);
    }
    this.#ctrl = value;
    if (enable === XOSC_DISABLE) {
      this.#enabledAt = NEVER;
      this.#wasStable = false;
    } else if (!this.enabled) {
      this.#enabledAt = this.#time.cycle;
    }
  }
}

const PLL_CS = 0x0;
const PLL_PWR = 0x4;
const PLL_FBDIV = 0x8;
const PLL_PRIM = 0xc;
const LOCK = 0x80000000;
const PD = 1 << 0;
const POSTDIVPD = 1 << 3;
const VCOPD = 1 << 5;
const LOCK_TICKS = 100_000 / TICK_NS; // the datasheet has no figure: 100 us is much longer than chips take

export class Pll extends BasePeripheral {
  #time;
  #reference;
  #lockedAt = NEVER;

  /** @param {CrystalOscillator} reference */
  constructor(chip, name, time, reference) {
    super(chip, name);
    this.#time = time;
    this.#reference = reference;
    this.onChange = () => {};
    this.reset();
  }

  reset() {
    this.cs = 1;
    this.pwr = PD | 1 << 2 | POSTDIVPD | VCOPD;
    this.fbdiv = 0;
    this.prim = 0x77000;
    this.#lockedAt = NEVER;
    this.onChange();
  }

  /** As a program leaves it that has waited for the lock. */
  assumeLocked([fbdiv, first, second]) {
    Object.assign(this, { fbdiv, pwr: 1 << 2, prim: (first << 16) | (second << 12) });
    this.#lockedAt = this.#time.cycle;
    this.onChange();
  }

  get locked() {
    return this.#time.cycle >= this.#lockedAt && this.#reference.hz > 0;
  }

  get hz() {
    if (!this.locked || this.pwr & POSTDIVPD) return 0;
    return this.#vcoHz / (((this.prim >> 16) & 7) * ((this.prim >> 12) & 7));
  }

  get #vcoHz() {
    return (CRYSTAL_HZ / (this.cs & 0x3f)) * this.fbdiv;
  }

  readUint32(offset) {
    this.onChange();
    if (offset === PLL_CS) return (this.cs | (this.locked ? LOCK : 0)) >>> 0;
    return { [PLL_PWR]: this.pwr, [PLL_FBDIV]: this.fbdiv, [PLL_PRIM]: this.prim }[offset] ?? 0;
  }

  writeUint32(offset, value) {
    const ran = this.#powered;
    if (offset === PLL_CS) this.cs = value & 0x13f;
    if (offset === PLL_PWR) this.pwr = value & 0x2d;
    if (offset === PLL_FBDIV) this.fbdiv = value & 0xfff;
    if (offset === PLL_PRIM) this.#writePrim(value);
    if (ran && (offset === PLL_CS || offset === PLL_FBDIV)) {
      this.rp2040.violations.note('2.18.4', `${this.name}: its dividers are changed while it runs`);
    }
    if (!this.#powered) this.#lockedAt = NEVER;
    else if (!ran) this.#start();
    this.onChange();
  }

  get #powered() {
    return (this.pwr & (PD | VCOPD)) === 0;
  }

  #writePrim(value) {
    this.prim = value & 0x77000;
    const [first, second] = [(value >> 16) & 7, (value >> 12) & 7];
    if (first === 0 || second === 0) this.rp2040.violations.note('2.18.4', `${this.name}: a post divider of 0`);
    if (first < second) this.rp2040.violations.note('2.18.2.1', `${this.name}: POSTDIV1 is to be the larger of the two`);
    if (!(this.pwr & POSTDIVPD)) this.rp2040.violations.note('2.18.2', `${this.name}: PRIM is changed while its output is on`);
  }

  /** Locks after its time, if its ranges are kept (2.18.4, "General constraints"); never otherwise. */
  #start() {
    const { violations } = this.rp2040;
    const reference = this.cs & 0x3f ? CRYSTAL_HZ / (this.cs & 0x3f) : 0;
    const fault = reference < 5e6 ? `a reference of ${reference / 1e6} MHz; 5 at least`
      : this.fbdiv < 16 || this.fbdiv > 320 ? `a feedback divider of ${this.fbdiv}; 16 to 320`
      : this.#vcoHz < 750e6 || this.#vcoHz > 1600e6 ? `a VCO of ${this.#vcoHz / 1e6} MHz; 750 to 1600` : null;
    this.#reference.use(this.name);
    if (fault) violations.note('2.18.4', `${this.name}: ${fault}: it does not lock`);
    this.#lockedAt = fault ? NEVER : this.#time.cycle + LOCK_TICKS;
  }
}

function ms(ticks) {
  return Math.round((ticks * TICK_NS) / 1e4) / 100;
}
