// SPDX-License-Identifier: MIT
// A chip on the test bench: PIO programs go in by register writes, edges come out as [cycle, levels].
import { assumeBooted, buildChip } from '../chip/chip.mjs';
import { FlashChip } from '../chip/flash_chip.mjs';
import { Cause } from '../chip/system.mjs';
import { Violations } from '../chip/violations.mjs';

export const PIO0 = 0x50200000;
export const PIO1 = 0x50300000;
const SRAM = 0x20000000;
const BRANCH_TO_SELF = 0xe7fe;

export class Bench {
  constructor({ naive = false, onWatchdog = () => {}, stepping } = {}) {
    const start = { cause: Cause.POWER, reason: 0, scratch: new Uint32Array(8), crystalTicks: 0, seed: 1, onWatchdog, onLoader: () => {} };
    const flash = new FlashChip(new Uint8Array(256), new Uint8Array(8));
    this.violations = new Violations(() => {});
    Object.assign(this, buildChip({ naive, start, flash, stepping, violations: this.violations }));
    assumeBooted(this);
    this.edges = [];
    this.pads.onChange = (cycle, levels) => this.edges.push([cycle, levels]);
    this.processor([BRANCH_TO_SELF]);
  }

  /** Puts Thumb instructions at the start of SRAM and the processor on the first of them. */
  processor(halfwords) {
    halfwords.forEach((halfword, n) => this.chip.writeUint16(SRAM + 0x100 + 2 * n, halfword));
    this.chip.core.PC = SRAM + 0x100;
    this.chip.core.SP = SRAM + 0x40000;
    this.chip.core.VTOR = SRAM;
  }

  run(cycles) {
    const end = this.time.cycle + cycles;
    this.lockstep.run(end);
  }

  write(address, value) {
    this.chip.writeUint32(address, value >>> 0);
  }

  read(address) {
    return this.chip.readUint32(address) >>> 0;
  }

  /** Gives `pins` to PIO block 0 or 1 (function 6 or 7), as outputs of machine 0 where `outputs` has their bit. */
  givePins(block, pins, outputs = 0) {
    for (let n = 0; n < 30; n++) {
      if ((pins >> n) & 1) this.write(0x40014004 + 8 * n, 6 + block);
    }
    this.chip.pio[block].pinDirections |= outputs;
    this.pads.update(this.time.cycle + 1);
    this.edges.length = 0;
  }

  load(block, program, at = 0) {
    program.forEach((opcode, n) => this.write((block ? PIO1 : PIO0) + 0x48 + 4 * (at + n), opcode));
  }

  /** Registers of a machine: clkdiv, execctrl, shiftctrl, pinctrl, as far as given. */
  configure(block, machine, { clkdiv, execctrl, shiftctrl, pinctrl }) {
    const base = (block ? PIO1 : PIO0) + 0xc8 + 0x18 * machine;
    if (clkdiv !== undefined) this.write(base, clkdiv);
    if (execctrl !== undefined) this.write(base + 0x04, execctrl);
    if (shiftctrl !== undefined) this.write(base + 0x08, shiftctrl);
    if (pinctrl !== undefined) this.write(base + 0x14, pinctrl);
  }

  force(block, machine, opcode) {
    this.write((block ? PIO1 : PIO0) + 0xd8 + 0x18 * machine, opcode);
  }

  enable(block, machines) {
    this.write(block ? PIO1 : PIO0, machines | (machines << 8));
  }

  push(block, machine, word) {
    this.write((block ? PIO1 : PIO0) + 0x10 + 4 * machine, word);
  }
}

/** Edges of one pin: [cycle, level]. */
export function edgesOf(edges, pin) {
  const found = [];
  let last = 0;
  for (const [cycle, levels] of edges) {
    const level = (levels >> pin) & 1;
    if (level !== last) found.push([cycle, level]);
    last = level;
  }
  return found;
}

export const wrap = (top, bottom = 0) => (top << 12) | (bottom << 7);
export const pinctrl = ({ side = 0, sideBase = 0, set = 0, setBase = 0, out = 0, outBase = 0, inBase = 0 }) =>
  ((side << 29) | (set << 26) | (out << 20) | (inBase << 15) | (sideBase << 10) | (setBase << 5) | outBase) >>> 0;
