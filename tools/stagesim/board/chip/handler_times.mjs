// SPDX-License-Identifier: MIT
// How long exception handlers keep the processor, and how long the program keeps them out: counted in its cycles, of which
// there are none for flash or a contended bus here.

const FIRST_INTERRUPT = 16; // exception number of interrupt 0 (ARMv6-M B1.5.2)

export class HandlerTimes {
  #core;
  #entered = []; // cycles at the entry of each handler that is active, the last one running
  #cycles = 0;
  #held = 0; // cycles since PRIMASK was set
  #raised = new Array(32).fill(0); // cycle in which each interrupt became pending

  constructor(core, time) {
    this.#core = core;
    /**
     * Exception number -> {count, wait, longest}: cycles from the interrupt to the entry of its handler, and from there to
     * its end, entry and whatever interrupted it included.
     */
    this.handlers = new Map();
    /** The longest stretch of cycles under PRIMASK, sleep apart. */
    this.longestHeld = 0;
    const enter = core.exceptionEntry;
    core.exceptionEntry = (number) => {
      this.#entered.push(this.#cycles);
      if (number >= FIRST_INTERRUPT) this.#times(number).wait =
        Math.max(this.#times(number).wait, time.cycle - this.#raised[number - FIRST_INTERRUPT]);
      enter.call(core, number);
    };
    const leave = core.exceptionReturn;
    core.exceptionReturn = (value) => {
      this.#note(core.IPSR, this.#cycles - this.#entered.pop());
      leave.call(core, value);
    };
    const set = core.setInterrupt;
    core.setInterrupt = (number, active) => {
      if (active && !(core.pendingInterrupts & (1 << number))) this.#raised[number] = time.cycle;
      set.call(core, number, active);
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
    const times = this.#times(number);
    times.count++;
    times.longest = Math.max(times.longest, cycles);
  }

  #times(number) {
    if (!this.handlers.has(number)) this.handlers.set(number, { count: 0, wait: 0, longest: 0 });
    return this.handlers.get(number);
  }
}
