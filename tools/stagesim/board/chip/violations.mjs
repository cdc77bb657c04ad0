// SPDX-License-Identifier: MIT
// What the program did that a chip does not forgive, or that its datasheet does not define: kept, with the section that says
// so, until somebody asks. A run with one is no evidence of anything, so the board's process ends with an error.

export class Violations {
  #found = new Map(); // text -> times
  #log;

  /** @param {(text: string) => void} log told of each once */
  constructor(log) {
    this.#log = log;
  }

  /**
   * @param {string} section of the RP2040 datasheet, or of another document with its name
   * @param {string} text what was done, and what a chip makes of it
   */
  note(section, text) {
    const whole = `${/^[\d.]+$/.test(section) ? `RP2040 datasheet ${section}` : section}: ${text}`;
    const times = this.#found.get(whole) ?? 0;
    this.#found.set(whole, times + 1);
    if (times === 0) this.#log(`violation: ${whole}`);
  }

  /** Each text once. */
  get list() {
    return [...this.#found.keys()];
  }
}
