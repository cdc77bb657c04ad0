// SPDX-License-Identifier: MIT
// The watchdog and the tick that it and the timer count (RP2040 datasheet 4.7). REASON and the scratch registers outlive every
// reset but one by power or by the RUN pin (4.7.6).
import { BasePeripheral } from 'rp2040js';

const CTRL = 0x00;
const LOAD = 0x04;
const REASON = 0x08;
const SCRATCH0 = 0x0c;
const SCRATCH7 = 0x28;
const TICK = 0x2c;
const TRIGGER = 0x80000000;
const ENABLE = 1 << 30;
const CTRL_RESET = 0x07000000; // pauses for debuggers, of which there are none
const TICK_RUNNING = 1 << 10;
const TICK_ENABLE = 1 << 9;
const COUNTS_A_TICK = 2; // erratum RP2040-E1
const REASON_TIMER = 1;
const REASON_FORCE = 2;
const PSM_PAGE = 0x40010;
const PSM_WDSEL = 0x8;
const RESETS_PAGE = 0x4000c;
const RESETS_WDSEL = 0x4;
// What must be selected for the chip to start anew: everything after the oscillators (2.13.5).
const PSM_ALL_BUT_OSCILLATORS = 0x1fffc;

export class Watchdog extends BasePeripheral {
  #clock;
  #clocks;
  #ctrl = CTRL_RESET;
  #count = 0; // at the time #since
  #since_ns = 0;
  #tick = TICK_ENABLE; // CYCLES is 0: no tick
  #alarm;
  #onReset;

  /**
   * @param {import('./clocks.mjs').Clocks} clocks
   * @param {{reason: number, scratch: Uint32Array, onReset: () => void}} start what the chip's last life has left
   */
  constructor(chip, clocks, { reason, scratch, onReset }) {
    super(chip, 'WATCHDOG');
    this.#clock = chip.clock;
    this.#clocks = clocks;
    this.reason = reason;
    this.scratch = scratch.slice();
    this.#onReset = onReset;
    this.#alarm = chip.clock.createAlarm(() => this.#bite(REASON_TIMER));
    clocks.onRefChange = () => this.#reckon(() => {});
  }

  /** Of the tick generator: what the timer counts, 0 while it does not run. */
  get tickHz() {
    const cycles = this.#tick & 0x1ff;
    return this.#tick & TICK_ENABLE && cycles > 0 ? this.#clocks.refHz / cycles : 0;
  }

  get #running() {
    return (this.#ctrl & ENABLE) !== 0 && this.#countHz > 0;
  }

  #countHz = 0; // as it was at #since

  get #countNow() {
    if (!this.#running) return this.#count;
    return Math.max(0, this.#count - ((this.#clock.nanos - this.#since_ns) * this.#countHz) / 1e9);
  }

  /** Changes something that the count depends on. */
  #reckon(change) {
    this.#count = this.#countNow;
    this.#since_ns = this.#clock.nanos;
    change();
    this.#countHz = COUNTS_A_TICK * this.tickHz;
    if (this.#alarm.scheduled) this.#alarm.cancel();
    if (this.#running) this.#alarm.schedule((this.#count * 1e9) / this.#countHz);
  }

  #bite(reason) {
    const psm = this.rp2040.peripherals[PSM_PAGE].readUint32(PSM_WDSEL);
    const resets = this.rp2040.peripherals[RESETS_PAGE].readUint32(RESETS_WDSEL);
    if ((psm & PSM_ALL_BUT_OSCILLATORS) !== PSM_ALL_BUT_OSCILLATORS) {
      this.rp2040.violations.note('4.7.6', `the watchdog fires while PSM_WDSEL is 0x${psm.toString(16)} and RESETS_WDSEL ` +
        `0x${resets.toString(16)}: that does not start the whole chip anew`);
    }
    this.reason = reason;
    this.#ctrl = CTRL_RESET;
    if (this.#alarm.scheduled) this.#alarm.cancel();
    this.#onReset();
  }

  readUint32(offset) {
    if (offset === CTRL) return (this.#ctrl | Math.ceil(this.#countNow / COUNTS_A_TICK)) >>> 0;
    if (offset === REASON) return this.reason;
    if (offset >= SCRATCH0 && offset <= SCRATCH7) return this.scratch[(offset - SCRATCH0) >> 2];
    if (offset === TICK) return this.#tick | (this.tickHz > 0 ? TICK_RUNNING : 0);
    return 0; // LOAD is write only
  }

  writeUint32(offset, value) {
    if (offset >= SCRATCH0 && offset <= SCRATCH7) this.scratch[(offset - SCRATCH0) >> 2] = value;
    if (offset === LOAD) this.#reckon(() => { this.#count = value & 0xffffff; });
    if (offset === TICK) this.#writeTick(value);
    if (offset !== CTRL) return;
    if ((value & TRIGGER) !== 0) {
      this.#bite(REASON_FORCE);
      return;
    }
    this.#reckon(() => { this.#ctrl = value & 0x47000000; });
    if (this.#ctrl & ENABLE && !this.#running) {
      this.rp2040.violations.note('4.7.2', 'the watchdog is enabled and its tick does not run: it never fires');
    }
  }

  #writeTick(value) {
    this.#reckon(() => { this.#tick = value & (TICK_ENABLE | 0x1ff); });
  }
}
