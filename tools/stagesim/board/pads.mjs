// SPDX-License-Identifier: MIT
// The pads of GPIO 0..29: who drives each, and what the inputs see of it after the synchroniser
// (RP2040 datasheet 2.19). An output pad reads itself back, as real pads do.

const GPIO_COUNT = 30;
const FUNCTION_SIO = 5;
const FUNCTION_PIO0 = 6;
const FUNCTION_PIO1 = 7;
const PAD_RESET = 0x56; // datasheet 2.19.6.3: input enabled, pulled down, Schmitt trigger, 4 mA
const SYNCHRONISER_CYCLES = 2; // two flip-flops (datasheet 3.5.6.3)

/**
 * Edges carry the cycle from which a pad has its new level: one after the cycle in which an instruction or a bus write
 * changed the output register.
 */
export class Pads {
  #time;
  #chip;
  #sources = { sio: 0, pio0: 0, pio1: 0 };
  #overrides = { invert: 0, low: 0, high: 0, enable: 0, disable: 0 };
  #enabledInputs = 0;
  #pulledUp = 0;
  #externalMask = 0;
  #externalLevels = 0;
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
      pin.padValue = PAD_RESET;
      pin.checkForUpdates = () => {
        this.#configure();
        this.update(this.#time.cycle + 1);
      };
      const { index } = pin;
      Object.defineProperty(pin, 'inputValue', { get: () => this.seen(index, this.#time.cycle, 0) });
      Object.defineProperty(pin, 'rawInputValue', { get: () => ((this.levels >> index) & 1) === 1, set: () => {} });
    }
    Object.defineProperty(chip, 'gpioValues', { get: () => this.seenAll(this.#time.cycle, 0) });
    this.#configure();
  }

  /** Drives a pad from outside the chip; null lets go of it. An output of the chip wins. */
  drive(gpio, level) {
    const bit = 1 << gpio;
    this.#externalMask = level === null ? this.#externalMask & ~bit : this.#externalMask | bit;
    this.#externalLevels = level ? this.#externalLevels | bit : this.#externalLevels & ~bit;
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

  /** True if the synchroniser holds no change of `gpio` that is yet to be seen in `cycle`. */
  settled(gpio, cycle) {
    const change = this.#history[0].inputs ^ this.#inputsAt(cycle - SYNCHRONISER_CYCLES);
    return ((change >> gpio) & 1) === 0;
  }

  #inputsAt(cycle) {
    const history = this.#history;
    let n = 0;
    while (n < history.length - 1 && history[n].from > cycle) n++;
    return history[n].inputs;
  }

  /** Works out the pads' levels from `cycle` on. Call after anything that drives them has changed. */
  update(cycle) {
    const { pio, sio } = this.#chip;
    const { sio: bySio, pio0, pio1 } = this.#sources;
    pio[0].pinsChanged = false;
    pio[1].pinsChanged = false;
    let out = (pio[0].pinValues & pio0) | (pio[1].pinValues & pio1) | (sio.gpioValue & bySio);
    let driven = (pio[0].pinDirections & pio0) | (pio[1].pinDirections & pio1) | (sio.gpioOutputEnable & bySio);
    const { invert, low, high, enable, disable } = this.#overrides;
    out = ((out ^ invert) & ~low) | high;
    driven = (driven | enable) & ~disable;
    const idle = (this.#externalLevels & this.#externalMask) | (this.#pulledUp & ~this.#externalMask);
    const levels = (out & driven) | (idle & ~driven);
    const inputs = levels & this.#enabledInputs;
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
      const oldest = this.#history.pop();
      oldest.from = cycle;
      oldest.inputs = inputs;
      this.#history.unshift(oldest);
    }
    for (const pio of this.#chip.pio) {
      if (changed & pio.syncBypass) pio.inputsChanged(changed & pio.syncBypass, cycle);
      if (changed & ~pio.syncBypass) pio.inputsChanged(changed & ~pio.syncBypass, cycle + SYNCHRONISER_CYCLES);
    }
    for (const pin of this.#chip.gpio) {
      if (pin.irqEnableMask && (changed >> pin.index) & 1) pin.setInputValue(((inputs >> pin.index) & 1) === 1);
    }
  }

  /** Reads IO_BANK0 and PADS_BANK0 anew: function select, overrides, input enable, pull-ups. */
  #configure() {
    const sources = { sio: 0, pio0: 0, pio1: 0 };
    const overrides = { invert: 0, low: 0, high: 0, enable: 0, disable: 0 };
    let enabledInputs = 0;
    let pulledUp = 0;
    for (let n = 0; n < GPIO_COUNT; n++) {
      const bit = 1 << n;
      const pin = this.#chip.gpio[n];
      if (pin.functionSelect === FUNCTION_SIO) sources.sio |= bit;
      if (pin.functionSelect === FUNCTION_PIO0) sources.pio0 |= bit;
      if (pin.functionSelect === FUNCTION_PIO1) sources.pio1 |= bit;
      const outKind = [null, 'invert', 'low', 'high'][pin.outputOverride];
      if (outKind) overrides[outKind] |= bit;
      if (pin.outputEnableOverride === 1) throw new Error(`GPIO ${n}: an inverted output enable is not modelled`);
      if (pin.outputEnableOverride === 2 || pin.outputDisable) overrides.disable |= bit;
      if (pin.outputEnableOverride === 3) overrides.enable |= bit;
      if (pin.inputEnable) enabledInputs |= bit;
      if (pin.pullupEnabled) pulledUp |= bit;
    }
    this.#sources = sources;
    this.#overrides = overrides;
    this.#enabledInputs = enabledInputs;
    this.#pulledUp = pulledUp;
  }
}
