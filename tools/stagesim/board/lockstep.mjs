// SPDX-License-Identifier: MIT
// Time itself: processor, PIO, DMA and timers advance together, cycle by cycle, and where nothing can happen time
// jumps to the next cycle in which something does.
import { runInstruction } from './processor.mjs';

const CYCLE_NS = 8;

/**
 * In one cycle first the timers and DMA transfers that fall due act, then the PIO machines; the processor's
 * instruction acts before both in the first of its cycles. What one part does to another is seen from the next step
 * of the other on, the same with and without jumps.
 */
export class Lockstep {
  #chip;
  #pads;
  #time;
  #naive;

  /**
   * @param {import('rp2040js').RP2040} chip
   * @param {import('./pads.mjs').Pads} pads
   * @param {{cycle: number}} time since the chip's reset, shared with all parts
   * @param {boolean} naive steps every cycle
   */
  constructor(chip, pads, time, naive) {
    this.#chip = chip;
    this.#pads = pads;
    this.#time = time;
    this.#naive = naive;
    /** Cycles in which the processor was not asleep. */
    this.awakeCycles = 0;
    correctClock(chip.clock);
  }

  /** Runs until `end`, or at most one instruction past it. Stops early when `stop()` becomes true. */
  run(end, stop) {
    const { core } = this.#chip;
    const time = this.#time;
    while (time.cycle < end && !stop()) {
      if (core.waiting) {
        this.#advance(end, true);
      } else {
        const cycles = runInstruction(core);
        this.awakeCycles += cycles;
        this.#advance(time.cycle + cycles, false);
      }
    }
  }

  /** True if, as far as PIO and DMA go, the chip does nothing by itself but count. */
  get quiet() {
    const { pio, dma } = this.#chip;
    return pio[0].quiet && pio[1].quiet && !dma.channels.some((channel) => channel.transferAlarm.scheduled);
  }

  /** Cycle of the next alarm of the chip's clock, Infinity without one. */
  get nextAlarmCycle() {
    const { nextAlarm } = this.#chip.clock;
    return nextAlarm === null ? Infinity : Math.ceil(nextAlarm.nanos / CYCLE_NS);
  }

  #advance(target, untilAwake) {
    const { core, clock, pio } = this.#chip;
    const time = this.#time;
    while (time.cycle < target) {
      clock.tick(time.cycle * CYCLE_NS - clock.nanosCounter);
      if (untilAwake && !core.waiting) return;
      if (pio[0].due <= time.cycle) pio[0].step(time.cycle);
      if (pio[1].due <= time.cycle) pio[1].step(time.cycle);
      if (pio[0].pinsChanged || pio[1].pinsChanged) this.#pads.update(time.cycle + 1);
      time.cycle = this.#naive ? time.cycle + 1 : this.#nextCycle(target);
      clock.nanosCounter = Math.max(clock.nanosCounter, Math.min(time.cycle * CYCLE_NS, this.#alarmNanos()));
      if (untilAwake && !core.waiting) return;
    }
  }

  /** The next cycle in which something may happen, but not past `target`. */
  #nextCycle(target) {
    const { pio } = this.#chip;
    const next = Math.min(pio[0].due, pio[1].due, this.nextAlarmCycle, target);
    return Math.max(next, this.#time.cycle + 1);
  }

  #alarmNanos() {
    const { nextAlarm } = this.#chip.clock;
    return nextAlarm === null ? Infinity : nextAlarm.nanos;
  }
}

/** Stock leaves an alarm marked as scheduled once it has rung. */
function correctClock(clock) {
  clock.tick = (delta_ns) => {
    const end_ns = clock.nanosCounter + delta_ns;
    while (clock.nextAlarm !== null && clock.nextAlarm.nanos <= end_ns) {
      const alarm = clock.nextAlarm;
      clock.nextAlarm = alarm.next;
      alarm.scheduled = false;
      clock.nanosCounter = alarm.nanos;
      alarm.callback();
    }
    clock.nanosCounter = end_ns;
  };
}
