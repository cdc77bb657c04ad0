// SPDX-License-Identifier: MIT
// The clock divider of one PIO state machine: which system cycles are its ticks (RP2040 datasheet 3.5.5).

/**
 * Tick k falls in cycle epoch + floor(k * D / 256), with D = 256 * INT + FRAC: the first-order divider's fractional
 * remainder carries from tick to tick, so that ticks lie at most one cycle off the ideal grid.
 * The divider runs whether or not its machine is enabled; only a restart or a new divisor moves the grid.
 */
export class PioClock {
  #epoch = 0;
  #divisor256 = 256;

  /** The SMx_CLKDIV register: INT in bits 31:16 (0 means 65536), FRAC in bits 15:8. */
  register = 0x00010000;

  /** Sets SMx_CLKDIV. The hardware keeps its phase, which a program cannot know; here the grid starts anew. */
  setRegister(value, cycle) {
    this.register = (value & 0xffffff00) >>> 0;
    const integer = this.register >>> 16 || 65536;
    const fraction = integer === 65536 ? 0 : (this.register >>> 8) & 0xff;
    this.#divisor256 = integer * 256 + fraction;
    this.#epoch = cycle;
  }

  restart(cycle) {
    this.#epoch = cycle;
  }

  /** The cycle of tick `tick`. */
  cycleOf(tick) {
    if (this.#divisor256 === 256) return this.#epoch + tick;
    return this.#epoch + Math.floor((tick * this.#divisor256) / 256);
  }

  /** The first tick that falls in `cycle` or later. */
  tickFrom(cycle) {
    if (this.#divisor256 === 256) return cycle - this.#epoch;
    return Math.ceil(((cycle - this.#epoch) * 256) / this.#divisor256);
  }
}
