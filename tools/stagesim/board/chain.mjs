// SPDX-License-Identifier: MIT
// The lamp drivers on the shift chain: a shift register of all their channels and the latch behind it, as in
// constant-current drivers of the TLC5926 class (data shifts in on CLK's rising edge, LATCH copies it).

export class Chain {
  #shift;
  #oldest = 0;

  /** @param {number} bits of the whole chain, a multiple of 4 */
  constructor(bits) {
    this.#shift = new Uint8Array(bits);
    /** The latched pattern as hex digits, chain bit 0 first; bit b is the b-th that was shifted out. */
    this.pattern = '0'.repeat(bits / 4);
  }

  /** CLK rises: `level` comes in, the oldest bit falls off the far end. */
  clock(level) {
    this.#shift[this.#oldest] = level;
    this.#oldest = (this.#oldest + 1) % this.#shift.length;
  }

  /** LATCH rises: the outputs take what is in the register. */
  latch() {
    const bits = this.#shift;
    let pattern = '';
    let at = this.#oldest;
    for (let digit = 0; digit < bits.length / 4; digit++) {
      let value = 0;
      for (let n = 0; n < 4; n++) {
        value = value * 2 + bits[at];
        at = at + 1 === bits.length ? 0 : at + 1;
      }
      pattern += value.toString(16);
    }
    this.pattern = pattern;
  }

  get bits() {
    return this.#shift.length;
  }
}
