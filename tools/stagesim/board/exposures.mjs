// SPDX-License-Identifier: MIT
// From the board's edges to exposures: while a trigger is high its camera exposes, and sees the latched pattern
// whenever LIGHT_EN is high.
import { Chain } from './chain.mjs';

/**
 * @typedef {{on: number, off: number, bits: string}} Segment ticks, and the pattern as hex digits
 * @typedef {{type: 'exposure', n: number, trigger: number, rise: number, fall: number, segments: Segment[]}} Exposure
 */

export class ExposureRecorder {
  #chain;
  #levels = 0;
  #count = 0;
  #litSince = 0; // tick from which LIGHT_EN has been high with this pattern
  #outputs;
  #triggers;
  #open;
  #activeLow;
  #emit;

  /**
   * @param {(exposure: Exposure) => void} emit called when a trigger ends
   * @param {import('./pins.mjs').BoardPins} pins
   * @param {number[]} activeLow triggers whose camera exposes while the pin is low
   */
  constructor(chainBits, emit, pins, activeLow = []) {
    this.#outputs = pins.outputs;
    this.#triggers = pins.triggers;
    this.#open = pins.triggers.map(() => null);
    this.#activeLow = activeLow.reduce((mask, trigger) => mask | (1 << pins.triggers[trigger]), 0);
    this.#levels = this.#activeLow; // all pads are low; what is active from the start has no begin, and is no exposure
    this.#chain = new Chain(chainBits);
    this.#emit = emit;
  }

  /** The tick at which the oldest exposure still under way began, Infinity when none is. */
  get openSince() {
    return Math.min(...this.#open.map((exposure) => exposure?.rise ?? Infinity));
  }

  /** @param {number} pads levels of all GPIOs from `tick` on */
  edge(tick, pads) {
    const levels = pads ^ this.#activeLow;
    const before = this.#levels;
    const rose = levels & ~before;
    const changed = levels ^ before;
    this.#levels = levels;
    const light = 1 << this.#outputs.LIGHT_EN;
    const latched = (rose >> this.#outputs.LATCH) & 1;
    if ((changed & light || latched) && before & light) this.#endStretch(tick);
    if (latched) this.#chain.latch();
    // The register takes DATA as it was before the edge: a change in the same tick comes too late (setup time).
    if ((rose >> this.#outputs.CLK) & 1) this.#chain.clock((before >> this.#outputs.DATA) & 1);
    if ((rose & light) !== 0 || latched) this.#litSince = tick;
    this.#triggers.forEach((gpio, trigger) => {
      if ((changed >> gpio) & 1) this.#triggerEdge(tick, trigger, (levels >> gpio) & 1);
    });
  }

  #triggerEdge(tick, trigger, high) {
    if (high) {
      this.#open[trigger] = { type: 'exposure', n: 0, trigger, rise: tick, fall: 0, segments: [] };
      return;
    }
    const exposure = this.#open[trigger];
    if (exposure === null) return;
    this.#open[trigger] = null;
    if (this.#levels & (1 << this.#outputs.LIGHT_EN)) addSegment(exposure, this.#litSince, tick, this.#chain.pattern);
    exposure.fall = tick;
    exposure.n = this.#count++;
    this.#emit(exposure);
  }

  #endStretch(tick) {
    for (const exposure of this.#open) {
      if (exposure !== null) addSegment(exposure, this.#litSince, tick, this.#chain.pattern);
    }
  }
}

function addSegment(exposure, litSince, off, bits) {
  const on = Math.max(litSince, exposure.rise);
  if (off <= on) return;
  const last = exposure.segments.at(-1);
  if (last !== undefined && last.off === on && last.bits === bits) last.off = off;
  else exposure.segments.push({ on, off, bits });
}
