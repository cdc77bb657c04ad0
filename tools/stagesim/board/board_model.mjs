// SPDX-License-Identifier: MIT
// The board over its whole life: a chip from each reset to the next, ticks that go on across resets, the cable, and
// faults that are due.
import { CanBoard } from './can/can_board.mjs';
import { buildChip } from './chip/chip.mjs';
import { FlashChip } from './chip/flash_chip.mjs';
import { hangProgram, lockUp } from './chip/processor.mjs';
import { Cause, watchdogLegacy } from './chip/system.mjs';
import { UsbHost } from './usb/usb_host.mjs';

const TICK_NS = 8;
const TICKS_PER_US = 125;

export class Board {
  #flash;
  #options;
  #epoch = 0; // tick of the chip's cycle 0
  #parts;
  #levels = 0;
  #boots = 0;
  #triggers = 0;
  #triggerMask;
  #injections;
  #resetCause = null; // of a reset that is due
  #can = null;
  #inputs; // levels from outside, by GPIO
  #boot; // ticks since the last reset at which what was reached first, and why it began
  #oscillators = new Map(); // ticks of half a period, by GPIO
  #shorts = new Map(); // levels of shorted pads, by GPIO

  /**
   * @param {object} image from readImage
   * @param {object} options
   * @param {import('./pins.mjs').BoardPins} options.pins
   * @param {boolean} options.naive
   * @param {string} options.stepping of the chip
   * @param {boolean} options.busyHub other devices' packets never leave the USB bus idle
   * @param {number} options.seed
   * @param {Uint8Array} options.uniqueId of the flash chip
   * @param {number} options.roscHz of the ring oscillator, from which it boots
   * @param {number} options.crystal_ms that the crystal takes to swing
   * @param {number} options.sioOut what SIO's GPIO_OUT holds at the start
   * @param {object[]} options.injections from parseInjection
   * @param {import('./can/can_bus.mjs').CanBus | null} options.canBus joins the board's CAN controller to it
   * @param {import('./can/lamp_nodes.mjs').LampNodes | null} [options.lampNodes] that injections make fail
   * @param {import('./chip/violations.mjs').Violations} options.violations
   * @param {(text: string) => void} options.log
   * @param {(tick: number, levels: number) => void} options.onEdge a pin of the board has changed; undriven pins are 0
   * @param {(cause: string) => void} options.onReset
   * @param {() => void} options.onUnplug by a fault
   */
  constructor(image, options) {
    this.#flash = new FlashChip(image.flash, options.uniqueId);
    this.#options = options;
    this.#inputs = new Map(Object.values(options.pins.stopInputs).map((gpio) => [gpio, true]));
    this.#triggerMask = options.pins.triggers.reduce((mask, gpio) => mask | (1 << gpio), 0);
    this.#injections = options.injections.map((injection) => ({ ...injection }));
    if (options.canBus) {
      if (options.pins.can === null) throw new Error(`board "${options.pins.name}" has no CAN controller`);
      const drive = (gpio, level) => this.drive(gpio, level);
      this.#can = new CanBoard(options.canBus, options.pins.can, { drive, violations: options.violations });
    }
    this.#start(Cause.POWER, { reason: 0, scratch: new Uint32Array(8), crystalTicks: 0 });
  }

  get pins() {
    return this.#options.pins;
  }

  /** The lamp nodes on its bus. */
  get lampNodes() {
    return this.#options.lampNodes;
  }

  get chip() {
    return this.#parts.chip;
  }

  get tick() {
    return this.#epoch + this.#parts.time.cycle;
  }

  /** Since the chip's last reset. */
  get cycle() {
    return this.#parts.time.cycle;
  }

  /** Cycles in which the processor was awake, since the last reset. */
  get awakeCycles() {
    return this.#parts.lockstep.awakeCycles;
  }

  /** The longest times of handlers since the last reset, in cycles: by exception number, and of the program under PRIMASK. */
  get handlerTimes() {
    const { handlers, longestHeld } = this.#parts.lockstep.handlerTimes;
    return { handlers: Object.fromEntries(handlers), held: longestHeld };
  }

  /**
   * Of the last boot, in microseconds after the reset: `driven`, from when on the firmware drives every output, and
   * `attached`, when it appeared on USB; null for what has not come.
   */
  get boot() {
    const us = (cycle) => (cycle === null ? null : Math.round(cycle / TICKS_PER_US));
    return { cause: this.#boot.cause, boots: this.#boots, driven_us: us(this.#boot.driven), attached_us: us(this.#boot.attached) };
  }

  /** Of each output of the board, how strongly its pad drives, in mA (datasheet 2.19.6.3, DRIVE). */
  get padDrives() {
    const drive_mA = (gpio) => [2, 4, 8, 12][(this.chip.gpio[gpio].padValue >> 4) & 3];
    return Object.fromEntries(Object.entries(this.pins.outputs).map(([signal, gpio]) => [signal, drive_mA(gpio)]));
  }

  /** The CAN controller's bit timing as it is set, null without one. */
  get canTiming() {
    return this.#can?.bitTiming ?? null;
  }

  /** True if PIO and DMA do nothing by themselves and the bus is idle. */
  get quiet() {
    return this.#parts.lockstep.quiet && !this.usbHost.active && !this.#can?.bus.busy;
  }

  get nextAlarmTick() {
    return this.#epoch + this.#parts.lockstep.nextAlarmCycle;
  }

  /** Runs until `end`, at most some cycles past it. */
  run(end) {
    while (this.tick < end) {
      this.#injectDue();
      const faults = this.#injections.map(({ tick }) => tick);
      const until = Math.min(end, ...faults) - this.#epoch;
      this.#parts.lockstep.run(until);
      if (this.#boot.attached === null && this.chip.usbCtrl.attached) this.#boot.attached = this.cycle;
      if (this.#resetCause !== null) this.reset(this.#resetCause);
    }
  }

  /** Starts the chip anew. What the watchdog keeps is kept if it was the cause, or lost with the power. */
  reset(cause) {
    const kept = watchdogLegacy(this.chip);
    if (cause === Cause.RUN_PIN) Object.assign(kept, { reason: 0, scratch: new Uint32Array(8), crystalTicks: 0 }); // 4.7.1
    if (cause === Cause.WATCHDOG && kept.reason === 0) kept.reason = 1; // TIMER
    this.#resetCause = null;
    this.#options.log(`reset at tick ${this.tick}: ${cause}`);
    this.#edge(this.tick, 0);
    this.usbHost.unplug(); // transfers end; the new chip is plugged in when a client connects again
    this.#epoch = this.tick;
    this.#start(cause, kept);
    this.#options.onReset(cause);
  }

  /** The main program never goes on, as if it had gone astray; handlers run, and so does the rest of the chip. */
  hang() {
    const { core } = this.chip;
    while (core.IPSR !== 0) this.#parts.lockstep.run(this.#parts.time.cycle + 1);
    hangProgram(this.chip);
  }

  /** The processor stops for good, in a handler that never ends; the rest of the chip goes on. */
  lockUp() {
    lockUp(this.chip);
  }

  /** Drives an input of the board from outside, until it is driven otherwise. */
  drive(gpio, level) {
    this.#inputs.set(gpio, level); // and again after a reset
    this.#parts.pads.drive(gpio, level);
  }

  /** Something outside makes an input change every `ticks`, for ever. */
  oscillate(gpio, ticks) {
    this.#oscillators.set(gpio, Math.max(1, ticks));
    this.#startOscillator(gpio);
  }

  #startOscillator(gpio) {
    const { clock } = this.chip;
    const change = clock.createAlarm(() => {
      this.drive(gpio, !this.#inputs.get(gpio));
      change.schedule(this.#oscillators.get(gpio) * TICK_NS);
    });
    change.schedule(this.#oscillators.get(gpio) * TICK_NS);
  }

  /** Shorts a pad of the board to a level, whatever drives it; null takes the short away. */
  short(gpio, level) {
    this.#shorts.set(gpio, level); // and again after a reset
    this.#parts.pads.short(gpio, level);
  }

  unplug() {
    this.usbHost.unplug();
    this.#options.onUnplug();
  }

  #start(cause, kept) {
    const seed = this.#options.seed * 0x10000 + this.#boots++;
    const onWatchdog = () => {
      this.#resetCause = Cause.WATCHDOG;
      this.#parts.lockstep.stop();
    };
    const onLoader = (why) =>
      this.#options.log(`in the USB boot loader, which is not emulated, ${why}; a reset starts the boot ROM again`);
    const { naive, violations, roscHz, crystal_ms, stepping } = this.#options;
    const start = { cause, ...kept, seed, onWatchdog, onLoader };
    this.#parts = buildChip({ naive, start, flash: this.#flash, roscHz, crystal_ms, stepping, violations });
    this.#parts.pads.onChange = (cycle, levels, driven) => {
      this.#can?.pinsChanged(levels, driven);
      if (this.#boot.driven === null && (driven & this.pins.mask) === this.pins.mask) this.#boot.driven = cycle;
      this.#edge(this.#epoch + cycle, levels & driven & this.pins.mask);
    };
    this.#boot = { cause, driven: null, attached: null };
    if (cause === Cause.POWER) this.chip.sio.gpioValue = this.#options.sioOut ?? 0;
    for (const [gpio, level] of this.#inputs) this.#parts.pads.drive(gpio, level);
    this.chip.usbCtrl.busyHub = this.#options.busyHub ?? false;
    for (const gpio of this.#oscillators.keys()) this.#startOscillator(gpio);
    for (const [gpio, level] of this.#shorts) this.#parts.pads.short(gpio, level);
    this.usbHost = new UsbHost(this.chip.clock, this.chip.usbCtrl, this.#options.log);
    this.#can?.attach(this.chip);
  }

  #edge(tick, levels) {
    if (levels === this.#levels) return;
    if (levels & ~this.#levels & this.#triggerMask) {
      this.#triggers++;
      for (const injection of this.#injections) {
        if (injection.trigger !== this.#triggers) continue;
        injection.tick = tick + injection.delay;
        this.#parts.lockstep.stop(); // for run() to look when it is due
      }
    }
    this.#levels = levels;
    this.#options.onEdge(tick, levels);
  }

  #injectDue() {
    const due = this.#injections.filter(({ tick }) => tick <= this.tick);
    this.#injections = this.#injections.filter((injection) => !due.includes(injection));
    for (const { name, inject } of due) {
      this.#options.log(`injected at tick ${this.tick}: ${name}`);
      inject(this);
    }
  }
}
