// SPDX-License-Identifier: MIT
// The pads of GPIO 0..29: who drives each, and what the inputs see of it after the synchroniser
// (RP2040 datasheet 2.19). An output pad reads itself back, as real pads do.
import { IoBank, PadsBank } from './io_bank.mjs';

const GPIO_COUNT = 30;
const OVERRIDES = [null, 'invert', 'low', 'high'];
const FUNCTION_SIO = 5;
const FUNCTION_PIO0 = 6;
const FUNCTION_PIO1 = 7;
const SYNCHRONISER_CYCLES = 2; // two flip-flops (datasheet 3.5.6.3)

/**
 * Edges carry the cycle from which a pad has its new level: one after the cycle in which an instruction or a bus write
 * changed the output register.
 */
export class Pads {
  #time;
  #chip;
  #sources = { sio: 0, pio0: 0, pio1: 0 };
  #overrides = { invert: 0, low: 0, high: 0, enable: 0, disable: 0, turn: 0 };
  #enabledInputs = 0;
  #inputOverrides = { invert: 0, low: 0, high: 0 };
  #pulledUp = 0;
  #kept = 0; // pulled up and down: the pad keeps its level (2.19.4)
  #externalMask = 0;
  #externalLevels = 0;
  #shortedMask = 0;
  #shortedLevels = 0;
  // The last levels of the inputs, newest first: from which cycle on, and what. An edge a cycle at most, so that
  // three entries reach behind the synchroniser.
  #history = [{ from: 0, inputs: 0 }, { from: -1, inputs: 0 }, { from: -2, inputs: 0 }, { from: -3, inputs: 0 }];

  constructor(time) {
    this.#time = time;
    this.levels = 0;
    this.driven = 0;
    /** Called with (cycle, levels, driven) on each change. */
    this.onChange = () => {};
  }

  /** Puts these pads between the chip's outputs and inputs, in place of rp2040js' pins that see only the test bench. */
  attach(chip) {
    this.#chip = chip;
    for (const pin of chip.gpio) {
      pin.checkForUpdates = () => this.configure();
      const { index } = pin;
      Object.defineProperty(pin, 'inputValue', { get: () => this.seen(index, this.#time.cycle, 0) });
      Object.defineProperty(pin, 'rawInputValue', { get: () => ((this.levels >> index) & 1) === 1, set: () => {} });
    }
    Object.defineProperty(chip, 'gpioValues', { get: () => this.seenAll(this.#time.cycle, 0) });
    this.ioBank = new IoBank(chip, this);
    this.padsBank = new PadsBank(chip, this);
    this.padsBank.reset();
    this.ioBank.reset();
  }

  /** The control registers have changed. */
  configure() {
    this.#configure();
    this.update(this.#time.cycle + 1);
  }

  /** Levels of the inputs that are enabled, overridden, before the synchroniser. */
  get inputs() {
    return this.#history[0].inputs;
  }

  /** GPIOx_STATUS (2.19.6.1): what the peripheral gives and the pad gets, and what the pad gives and the peripheral gets. */
  status(gpio) {
    const bit = (bits, place) => (((bits >> gpio) & 1) << place);
    const { out, driven } = this.#peripherals();
    const [toPad, enabled] = this.#override(out, driven);
    const irq = ((this.ioBank.readUint32(0x120 + 4 * (gpio >> 3)) >>> (4 * (gpio & 7))) & 0xf) !== 0;
    return bit(out, 8) | bit(toPad, 9) | bit(driven, 12) | bit(enabled, 13) | bit(this.levels & this.#enabledInputs, 17) |
      bit(this.inputs, 19) | (irq ? (1 << 24) | (1 << 26) : 0);
  }

  #peripherals() {
    const { pio: [pio0, pio1], sio } = this.#chip;
    const sources = this.#sources;
    return {
      out: (pio0.pinValues & sources.pio0) | (pio1.pinValues & sources.pio1) | (sio.gpioValue & sources.sio),
      driven: (pio0.pinDirections & sources.pio0) | (pio1.pinDirections & sources.pio1) | (sio.gpioOutputEnable & sources.sio),
    };
  }

  #override(out, driven) {
    const { invert, low, high, turn, enable, disable } = this.#overrides;
    return [((out ^ invert) & ~low) | high, ((driven ^ turn) | enable) & ~disable];
  }

  /** Drives a pad from outside the chip; null lets go of it. An output of the chip wins. */
  drive(gpio, level) {
    const bit = 1 << gpio;
    this.#externalMask = level === null ? this.#externalMask & ~bit : this.#externalMask | bit;
    this.#externalLevels = level ? this.#externalLevels | bit : this.#externalLevels & ~bit;
    this.update(this.#time.cycle);
  }

  /** Shorts a pad to a level, stronger than any output of the chip; null takes the short away. */
  short(gpio, level) {
    const bit = 1 << gpio;
    this.#shortedMask = level === null ? this.#shortedMask & ~bit : this.#shortedMask | bit;
    this.#shortedLevels = level ? this.#shortedLevels | bit : this.#shortedLevels & ~bit;
    this.update(this.#time.cycle);
  }

  /** Whether a machine or the processor sees `gpio` high in `cycle`. */
  seen(gpio, cycle, bypass) {
    return ((this.seenAll(cycle, bypass) >> gpio) & 1) === 1;
  }

  /** All inputs as seen in `cycle`; pins in `bypass` skip the synchroniser (PIO INPUT_SYNC_BYPASS). */
  seenAll(cycle, bypass) {
    const synchronised = this.#inputsAt(cycle - SYNCHRONISER_CYCLES);
    if (bypass === 0) return synchronised;
    return (synchronised & ~bypass) | (this.#inputsAt(cycle) & bypass);
  }

  /** True if the synchroniser holds no change of `gpio` that is yet to be seen after `cycle`. */
  settled(gpio, cycle) {
    const seen = this.#inputsAt(cycle - SYNCHRONISER_CYCLES);
    return this.#history.every(({ from, inputs }) =>
      from <= cycle - SYNCHRONISER_CYCLES || (((inputs ^ seen) >> gpio) & 1) === 0);
  }

  #inputsAt(cycle) {
    const history = this.#history;
    let n = 0;
    while (n < history.length - 1 && history[n].from > cycle) n++;
    return history[n].inputs;
  }

  /** Works out the pads' levels from `cycle` on. Call after anything that drives them has changed. */
  update(cycle) {
    const { pio: [pio0, pio1], sio } = this.#chip;
    const sources = this.#sources;
    const made = this.#overrides;
    pio0.pinsChanged = false;
    pio1.pinsChanged = false;
    // As status() has it, without objects: this runs at every edge.
    let out = (pio0.pinValues & sources.pio0) | (pio1.pinValues & sources.pio1) | (sio.gpioValue & sources.sio);
    let driven = (pio0.pinDirections & sources.pio0) | (pio1.pinDirections & sources.pio1) |
      (sio.gpioOutputEnable & sources.sio);
    out = ((out ^ made.invert) & ~made.low) | made.high;
    driven = ((driven ^ made.turn) | made.enable) & ~made.disable;
    const free = (this.#pulledUp & ~this.#kept) | (this.levels & this.#kept);
    const idle = (this.#externalLevels & this.#externalMask) | (free & ~this.#externalMask);
    const unshorted = (out & driven) | (idle & ~driven);
    const levels = (unshorted & ~this.#shortedMask) | this.#shortedLevels;
    driven |= this.#shortedMask;
    const { invert, low, high } = this.#inputOverrides;
    const inputs = (((levels & this.#enabledInputs) ^ invert) & ~low) | high;
    if (inputs !== this.#history[0].inputs) this.#inputsChange(cycle, inputs);
    if (levels === this.levels && driven === this.driven) return;
    this.levels = levels;
    this.driven = driven;
    this.onChange(cycle, levels, driven);
  }

  #inputsChange(cycle, inputs) {
    const changed = inputs ^ this.#history[0].inputs;
    if (this.#history[0].from === cycle) {
      this.#history[0].inputs = inputs; // a second change in one cycle
    } else {
      const history = this.#history;
      const oldest = history[3];
      history[3] = history[2];
      history[2] = history[1];
      history[1] = history[0];
      history[0] = oldest;
      oldest.from = cycle;
      oldest.inputs = inputs;
    }
    for (const pio of this.#chip.pio) {
      const early = changed & pio.syncBypass;
      if (early) pio.inputsChanged(early, cycle);
      if (early !== changed) pio.inputsChanged(changed & ~early, cycle + SYNCHRONISER_CYCLES);
    }
    this.ioBank.inputsChanged(changed & inputs, changed & ~inputs);
  }

  /** Reads IO_BANK0 and PADS_BANK0 anew: function select, overrides, input enable, pull-ups. */
  #configure() {
    const sources = { sio: 0, pio0: 0, pio1: 0 };
    const overrides = { invert: 0, low: 0, high: 0, enable: 0, disable: 0, turn: 0 };
    const inputOverrides = { invert: 0, low: 0, high: 0 };
    let enabledInputs = 0;
    let pulledUp = 0;
    let kept = 0;
    for (let n = 0; n < GPIO_COUNT; n++) {
      const bit = 1 << n;
      const pin = this.#chip.gpio[n];
      if (pin.functionSelect === FUNCTION_SIO) sources.sio |= bit;
      if (pin.functionSelect === FUNCTION_PIO0) sources.pio0 |= bit;
      if (pin.functionSelect === FUNCTION_PIO1) sources.pio1 |= bit;
      const outKind = OVERRIDES[pin.outputOverride];
      if (outKind) overrides[outKind] |= bit;
      if (pin.outputEnableOverride === 1) overrides.turn |= bit;
      if (pin.outputEnableOverride === 2 || pin.outputDisable) overrides.disable |= bit;
      if (pin.outputEnableOverride === 3) overrides.enable |= bit;
      if (pin.inputEnable) enabledInputs |= bit;
      const inKind = OVERRIDES[pin.inputOverride];
      if (inKind) inputOverrides[inKind] |= bit;
      if (pin.pullupEnabled) pulledUp |= bit;
      if (pin.pullupEnabled && pin.pulldownEnabled) kept |= bit;
    }
    this.#sources = sources;
    this.#overrides = overrides;
    this.#enabledInputs = enabledInputs;
    this.#inputOverrides = inputOverrides;
    this.#pulledUp = pulledUp;
    this.#kept = kept;
  }
}
