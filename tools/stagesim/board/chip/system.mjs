// SPDX-License-Identifier: MIT
// The small blocks around the core that rp2040js lacks or gets wrong: the reset cause and the ring oscillator.
import { BasePeripheral } from 'rp2040js';

const WATCHDOG = 0x40058;
const XOSC = 0x40024;

/** Why a chip starts, and what it finds in the registers that outlive the reset. */
export const Cause = Object.freeze({ POWER: 'power', RUN_PIN: 'run pin', WATCHDOG: 'watchdog' });

/** What a watchdog reset leaves for the next start: REASON and SCRATCH0..7 (RP2040 datasheet 4.7.6), and the crystal on. */
export function watchdogLegacy(chip) {
  const { reason, scratch } = chip.peripherals[WATCHDOG];
  return { reason, scratch: scratch.slice(), crystalTicks: Math.max(0, chip.peripherals[XOSC].runningFor) };
}

/** VREG_AND_CHIP_RESET: only CHIP_RESET's cause bits (datasheet 2.12.7), and the regulator's settings as stored. */
export class ChipReset extends BasePeripheral {
  #registers = [0x000000b1, 0x00000009, 0];

  constructor(chip, cause) {
    super(chip, 'VREG_AND_CHIP_RESET');
    if (cause === Cause.POWER) this.#registers[2] = 1 << 8; // HAD_POR
    if (cause === Cause.RUN_PIN) this.#registers[2] = 1 << 16; // HAD_RUN
  }

  readUint32(offset) {
    return this.#registers[offset >> 2] ?? super.readUint32(offset);
  }

  writeUint32(offset, value) {
    if (offset === 8) return; // causes are read only
    if (offset < 8) this.#registers[offset >> 2] = value;
    else super.writeUint32(offset, value);
  }
}

/** ROSC: runs at what it comes out of reset with; RANDOMBIT comes from a seeded generator so that runs repeat. */
export class RingOscillator extends BasePeripheral {
  #state;

  constructor(chip, seed, hz) {
    super(chip, 'ROSC');
    this.hz = hz;
    this.#state = (Math.imul(seed, 0x9e3779b9) ^ 0x85ebca6b) >>> 0 || 1;
  }

  readUint32(offset) {
    if (offset === 0x18) return 0x80001000; // STATUS: STABLE, ENABLED
    return this.#randomBit();
  }

  writeUint32() {} // STATUS.BADWRITE, which is never set

  /** Marsaglia's xorshift32. */
  #randomBit() {
    let s = this.#state;
    s ^= s << 13;
    s ^= s >>> 17;
    s ^= s << 5;
    this.#state = s >>> 0;
    return this.#state >>> 31;
  }
}
