// SPDX-License-Identifier: MIT
// How long exception handlers keep the processor, and how long the program keeps them out: counted in its cycles, of which
// there are none for flash or a contended bus here.

export class HandlerTimes {
  #core;
  #entered = []; // cycles at the entry of each handler that is active, the last one running
  #cycles = 0;
  #held = 0; // cycles since PRIMASK was set

  constructor(core) {
    this.#core = core;
    /** Exception number -> {count, longest} of its handler in cycles, entry and whatever interrupted it included. */
    this.handlers = new Map();
    /** The longest stretch of cycles under PRIMASK, sleep apart. */
    this.longestHeld = 0;
    const enter = core.exceptionEntry;
    core.exceptionEntry = (number) => {
      this.#entered.push(this.#cycles);
      enter.call(core, number);
    };
    const leave = core.exceptionReturn;
    core.exceptionReturn = (value) => {
      this.#note(core.IPSR, this.#cycles - this.#entered.pop());
      leave.call(core, value);
    };
  }

  /** The processor has run an instruction of so many cycles. */
  pass(cycles) {
    this.#cycles += cycles;
    if (this.#core.PM) {
      this.#held += cycles;
      if (this.#held > this.longestHeld) this.longestHeld = this.#held;
    } else {
      this.#held = 0;
    }
  }

  #note(number, cycles) {
    const times = this.handlers.get(number) ?? { count: 0, longest: 0 };
    this.handlers.set(number, { count: times.count + 1, longest: Math.max(times.longest, cycles) });
  }
}
