// SPDX-License-Identifier: MIT
// Writes the board's signals as a value change dump (IEEE 1364-2005, 18.2): times in ns, all multiples of 8.
import { closeSync, openSync, writeSync } from 'node:fs';

const TICK_NS = 8;
const BUFFER_CHARS = 1 << 16;

export class VcdWriter {
  #file;
  #path;
  #text = '';
  #levels = 0;
  #tick = 0;
  #signals;

  /**
   * @param {import('./pins.mjs').BoardPins} pins
   * @throws {Error} naming the file if it cannot be written
   */
  constructor(path, pins) {
    this.#path = path;
    this.#signals = Object.entries(pins.outputs).map(([name, gpio], n) => ({ name, gpio, id: String.fromCharCode(33 + n) }));
    try {
      this.#file = openSync(path, 'w');
    } catch (error) {
      throw new Error(`${path}: cannot write the trace (${error.code})`);
    }
    const names = this.#signals.map(({ name, id }) => `$var wire 1 ${id} ${name} $end\n`).join('');
    const zeros = this.#signals.map(({ id }) => `0${id}\n`).join('');
    this.#write(`$timescale 1 ns $end\n$scope module board $end\n${names}$upscope $end\n$enddefinitions $end\n` +
      `#0\n$dumpvars\n${zeros}$end\n`);
  }

  /** @param {number} levels of all GPIOs from `tick` on; ticks never go back */
  edge(tick, levels) {
    const changed = levels ^ this.#levels;
    if (tick !== this.#tick) this.#write(`#${tick * TICK_NS}\n`);
    this.#tick = tick;
    this.#levels = levels;
    for (const { gpio, id } of this.#signals) {
      if ((changed >> gpio) & 1) this.#write(`${(levels >> gpio) & 1}${id}\n`);
    }
  }

  close(tick) {
    if (tick > this.#tick) this.#write(`#${tick * TICK_NS}\n`);
    this.#flush();
    closeSync(this.#file);
  }

  #write(text) {
    this.#text += text;
    if (this.#text.length > BUFFER_CHARS) this.#flush();
  }

  #flush() {
    try {
      writeSync(this.#file, this.#text);
    } catch (error) {
      throw new Error(`${this.#path}: the trace is incomplete (${error.code})`);
    }
    this.#text = '';
  }
}
