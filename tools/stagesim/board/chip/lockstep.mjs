// SPDX-License-Identifier: MIT
// Time itself: processor, PIO, DMA and timers advance together, cycle by cycle, and where nothing can happen time
// jumps to the next cycle in which something does.
import { BusFault } from './bus.mjs';
import { HandlerTimes } from './handler_times.mjs';
import { runInstruction, takeBusFault } from './processor.mjs';

const CYCLE_NS = 8;

/**
 * In one cycle first the timers and DMA transfers that fall due act, then the processor's instruction if one begins,
 * then the PIO machines: an order, the same with and without jumps, for what hardware does at once.
 */
export class Lockstep {
  #chip;
  #pads;
  #time;
  #naive;
  #clocks;
  #rom = null; // the boot ROM while it runs, in place of instructions
  #romUntil = 0;
  #stopped = false;

  /**
   * @param {import('rp2040js').RP2040} chip
   * @param {import('./pads.mjs').Pads} pads
   * @param {{cycle: number}} time since the chip's reset, shared with all parts
   * @param {import('./clocks.mjs').Clocks} clocks
   * @param {boolean} naive steps every cycle
   */
  constructor(chip, pads, time, clocks, naive) {
    this.#chip = chip;
    this.#pads = pads;
    this.#time = time;
    this.#clocks = clocks;
    this.#naive = naive;
    /** Cycles in which the processor was not asleep. */
    this.awakeCycles = 0;
    this.handlerTimes = new HandlerTimes(chip.core, time);
    correctClock(chip.clock);
  }

  /** Lets `rom` run until its end, which leaves the processor where it is to go on. It yields cycles of clk_sys. */
  begin(rom) {
    this.#rom = rom;
    this.#romUntil = this.#time.cycle;
  }

  /** Makes run() return at the end of this cycle. */
  stop() {
    this.#stopped = true;
  }

  /** Runs until `end`, or at most one instruction past it, or until stop() is called from within. */
  run(end) {
    this.#stopped = false;
    while (this.#time.cycle < end && !this.#stopped) {
      try {
        this.#runUntilFault(end);
      } catch (error) {
        if (!(error instanceof BusFault)) throw error;
        takeBusFault(this.#chip.core);
        this.#advance(this.#time.cycle + 1, false);
      }
    }
  }

  #runUntilFault(end) {
    const { core } = this.#chip;
    const time = this.#time;
    while (time.cycle < end && !this.#stopped) {
      if (this.#rom !== null) {
        this.#runRom(end);
      } else if (core.waiting || !this.#clocks.running) {
        this.#advance(end, true);
      } else {
        const cycles = this.#clocks.ticks(runInstruction(core));
        this.awakeCycles += cycles;
        this.handlerTimes.pass(cycles);
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

  #runRom(end) {
    if (this.#time.cycle >= this.#romUntil) {
      const { value: cycles, done } = this.#rom.next();
      if (done) {
        this.#rom = null;
        return;
      }
      this.#romUntil = this.#time.cycle + (cycles === Infinity ? Infinity : this.#clocks.ticks(cycles));
    }
    const until = Math.min(end, this.#romUntil);
    if (this.#romUntil !== Infinity) this.awakeCycles += until - this.#time.cycle;
    this.#advance(until, false);
  }

  #advance(target, untilAwake) {
    const { core, clock } = this.#chip;
    const [pio0, pio1] = this.#chip.pio;
    const time = this.#time;
    while (time.cycle < target && !this.#stopped) {
      if (pio0.due <= time.cycle) pio0.step(time.cycle);
      if (pio1.due <= time.cycle) pio1.step(time.cycle);
      if (pio0.pinsChanged || pio1.pinsChanged) this.#pads.update(time.cycle + 1);
      const next = this.#naive ? 0 : Math.min(pio0.due, pio1.due, this.nextAlarmCycle, target);
      time.cycle = Math.max(next, time.cycle + 1);
      clock.tick(time.cycle * CYCLE_NS - clock.nanosCounter);
      if (untilAwake && !core.waiting && this.#clocks.running) return;
    }
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
