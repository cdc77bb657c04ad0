// SPDX-License-Identifier: MIT
// The clock generators (RP2040 datasheet 2.15): clk_ref and clk_sys with their glitchless multiplexers, clk_peri and clk_usb.
// How long a cycle of the processor lasts comes from here.
import { BasePeripheral } from 'rp2040js';

export const TICK_HZ = 125_000_000;

const REF_CTRL = 0x30;
const REF_DIV = 0x34;
const REF_SELECTED = 0x38;
const SYS_CTRL = 0x3c;
const SYS_DIV = 0x40;
const SYS_SELECTED = 0x44;
const PERI_CTRL = 0x48;
const USB_CTRL = 0x54;
const USB_DIV = 0x58;
const ENABLE = 1 << 11;
const KILL = 1 << 10;
const RESET_VALUES = { [REF_DIV]: 0x100, [SYS_DIV]: 0x100, [USB_DIV]: 0x100, 0xa0: 0xffffffff, 0xa4: 0x7fff };
const USB_HZ = 48_000_000;

// Sources by their number in SRC or AUXSRC (2.15.7). What is not here, GPIN0 and GPIN1, has no clock.
const REF_SOURCES = ['rosc', 'aux', 'xosc'];
const REF_AUX = ['pllUsb'];
const SYS_AUX = ['pllSys', 'pllUsb', 'rosc', 'xosc'];
const PERI_AUX = ['sys', 'pllSys', 'pllUsb', 'rosc', 'xosc'];
const USB_AUX = ['pllUsb', 'pllSys', 'rosc', 'xosc'];

export class Clocks extends BasePeripheral {
  #registers = new Map();
  #sources;
  #selected = { ref: 0, sys: 0 }; // of the glitchless multiplexers, which follow SRC only to a clock that runs
  #sysHz = 0;
  #fraction = 0; // of a tick, that cycles so far have left over

  /**
   * @param {{rosc: {hz: number}, xosc: import('./oscillators.mjs').CrystalOscillator, pllSys: import('./oscillators.mjs').Pll,
   *   pllUsb: import('./oscillators.mjs').Pll}} sources
   */
  constructor(chip, sources) {
    super(chip, 'CLOCKS');
    this.#sources = sources;
    this.#registers = new Map(Object.entries(RESET_VALUES).map(([offset, value]) => [Number(offset), value]));
    for (const source of [sources.xosc, sources.pllSys, sources.pllUsb]) source.onChange = () => this.update();
    /** Called with clk_ref's frequency when it has changed. */
    this.onRefChange = () => {};
    this.update();
  }

  /** False once clk_sys has lost its source: the processor stops for good. */
  get running() {
    return this.#sysHz > 0;
  }

  get sysHz() {
    return this.#sysHz;
  }

  get refHz() {
    const source = REF_SOURCES[this.#selected.ref];
    const hz = source === 'aux' ? this.#auxHz(REF_CTRL, REF_AUX) : this.#hzOf(source);
    return hz / ((this.#register(REF_DIV) >> 8) & 3 || 4);
  }

  get periHz() {
    return this.#register(PERI_CTRL) & ENABLE ? this.#auxHz(PERI_CTRL, PERI_AUX) : 0;
  }

  get usbHz() {
    return this.#register(USB_CTRL) & ENABLE ? this.#auxHz(USB_CTRL, USB_AUX) / ((this.#register(USB_DIV) >> 8) & 3 || 4) : 0;
  }

  /** Whole ticks of 125 MHz for so many cycles of clk_sys; what is left over counts the next time. */
  ticks(cycles) {
    if (this.#sysHz === TICK_HZ) return cycles;
    const exact = (cycles * TICK_HZ) / this.#sysHz + this.#fraction;
    const whole = Math.floor(exact);
    this.#fraction = exact - whole;
    return whole;
  }

  #register(offset) {
    return this.#registers.get(offset) ?? 0;
  }

  #hzOf(source) {
    if (source === 'sys') return this.#sysHz;
    return source === undefined ? 0 : this.#sources[source].hz;
  }

  #auxHz(ctrl, names) {
    if (this.#register(ctrl) & KILL) return 0;
    return this.#hzOf(names[(this.#register(ctrl) >> 5) & 7]);
  }

  /** As a program leaves it that runs from its PLLs and the crystal. */
  assumeRunning() {
    for (const [offset, value] of [[REF_CTRL, 2], [SYS_CTRL, 1], [PERI_CTRL, ENABLE], [USB_CTRL, ENABLE]]) {
      this.#registers.set(offset, value);
    }
    this.update();
  }

  /** Works out anew what runs. To be called whenever a source may have come or gone. */
  update() {
    const refBefore = this.refHz;
    const { ref, sys } = this.#selected;
    const refWanted = this.#register(REF_CTRL) & 3;
    if (refWanted !== ref && (refWanted === 1 ? this.#auxHz(REF_CTRL, REF_AUX) : this.#hzOf(REF_SOURCES[refWanted])) > 0) {
      this.#selected.ref = refWanted;
    }
    const sysWanted = this.#register(SYS_CTRL) & 1;
    if (sysWanted !== sys && (sysWanted ? this.#auxHz(SYS_CTRL, SYS_AUX) : this.refHz) > 0) this.#selected.sys = sysWanted;
    const ran = this.#sysHz > 0;
    const divisor = (this.#register(SYS_DIV) >>> 0) / 256 || 65536;
    this.#sysHz = (this.#selected.sys ? this.#auxHz(SYS_CTRL, SYS_AUX) : this.refHz) / divisor;
    if (ran && !this.running) this.rp2040.violations.note('2.15.3.2', 'clk_sys has lost its source: the chip stops');
    this.rp2040.clkSys = this.#sysHz; // for rp2040js' parts, as they ask
    this.rp2040.clkPeri = this.periHz;
    if (this.refHz !== refBefore) this.onRefChange(this.refHz);
  }

  readUint32(offset) {
    this.update();
    if (offset === REF_SELECTED) return 1 << this.#selected.ref;
    if (offset === SYS_SELECTED) return 1 << this.#selected.sys;
    return this.#register(offset) >>> 0;
  }

  writeUint32(offset, value) {
    const before = this.#register(offset);
    this.#registers.set(offset, value);
    if (offset === REF_CTRL) this.#checkRef(before, value);
    if (offset === SYS_CTRL) this.#checkSys(before, value);
    if (offset === PERI_CTRL || offset === USB_CTRL) this.#checkAux(offset, before, value);
    this.update();
  }

  #note(section, text) {
    this.rp2040.violations.note(section, text);
  }

  #checkRef(before, value) {
    if ((value & 3) === 3) this.#note('2.15.7', 'CLK_REF_CTRL SRC 3 is no source');
    if ((value & 3) === 2) this.#sources.xosc.use('clk_ref');
    if ((before & 3) === 1 && (before ^ value) & 0x60) this.#note('2.15.3.2', 'clk_ref runs from AUXSRC while that changes: a glitch');
  }

  #checkSys(before, value) {
    if (before & 1 && (before ^ value) & 0xe0) this.#note('2.15.3.2', 'clk_sys runs from AUXSRC while that changes: a glitch');
    if (!(value & 1)) return;
    const hz = this.#auxHz(SYS_CTRL, SYS_AUX);
    if (hz !== TICK_HZ) this.#note('2.15.3.2', `clk_sys is switched to a clock of ${hz / 1e6} MHz; the program reckons with 125`);
  }

  #checkAux(offset, before, value) {
    const name = offset === PERI_CTRL ? 'clk_peri' : 'clk_usb';
    if (before & value & ENABLE && (before ^ value) & 0xe0) this.#note('2.15.3.1', `${name} changes its source while it is enabled`);
    if (!(value & ENABLE)) return;
    const hz = offset === PERI_CTRL ? this.periHz : this.usbHz;
    if (hz === 0) this.#note('2.15.3.1', `${name} is enabled and its source does not run`);
    else if (offset === USB_CTRL && hz !== USB_HZ) this.#note('2.15.1', `clk_usb is ${hz / 1e6} MHz; USB needs 48`);
  }
}
