// SPDX-License-Identifier: MIT
// The small blocks around the core that rp2040js lacks or gets wrong: resets, the reset cause, the ring oscillator's
// random bit, the watchdog as a reset.
import { BasePeripheral } from 'rp2040js';

const RESETS = 0x4000c;
const BUSCTRL = 0x40030;
const WATCHDOG = 0x40058;
const ROSC = 0x40060;
const VREG_AND_CHIP_RESET = 0x40064;

/** Why a chip starts, and what it finds in the registers that outlive the reset. */
export const Cause = Object.freeze({ POWER: 'power', RUN_PIN: 'run pin', WATCHDOG: 'watchdog' });

/**
 * @param {import('rp2040js').RP2040} chip
 * @param {{cause: string, reason: number, scratch: Uint32Array, seed: number, onWatchdog: () => void}} start
 */
export function correctSystem(chip, start) {
  chip.peripherals[VREG_AND_CHIP_RESET] = new ChipReset(chip, start.cause);
  chip.peripherals[ROSC] = new RingOscillator(chip, start.seed);
  chip.peripherals[BUSCTRL].writeUint32 = () => {}; // priorities: nobody contends for the bus here
  correctResets(chip.peripherals[RESETS]);

  const watchdog = chip.peripherals[WATCHDOG];
  watchdog.reason = start.reason;
  watchdog.scratchData.set(start.scratch);
  watchdog.onWatchdogTrigger = () => {
    watchdog.timer.enable = false; // it bites once
    watchdog.alarm.enable = false;
    start.onWatchdog();
  };
}

/** What a watchdog reset leaves for the next start (RP2040 datasheet 4.7.6: REASON and SCRATCH0..7). */
export function watchdogLegacy(chip) {
  const { reason, scratchData } = chip.peripherals[WATCHDOG];
  return { reason, scratch: scratchData.slice() };
}

/** Blocks are held in reset until the program lets them go (datasheet 2.14.3). */
function correctResets(resets) {
  resets.reset = 0x01ffffff;
  Object.defineProperty(resets, 'reset_done', { get: () => ~resets.reset & 0x01ffffff, set: () => {} });
}

/** VREG_AND_CHIP_RESET: only CHIP_RESET's cause bits (datasheet 2.12.7), and the regulator's settings as stored. */
class ChipReset extends BasePeripheral {
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

/** ROSC: settings are stored, STATUS is stable, RANDOMBIT comes from a seeded generator so that runs repeat. */
class RingOscillator extends BasePeripheral {
  #registers = new Map([[0x00, 0x00000aa0]]);
  #state;

  constructor(chip, seed) {
    super(chip, 'ROSC');
    this.#state = (Math.imul(seed, 0x9e3779b9) ^ 0x85ebca6b) >>> 0 || 1;
  }

  readUint32(offset) {
    if (offset === 0x18) return 0x80001000; // STATUS: STABLE, ENABLED
    if (offset === 0x1c) return this.#randomBit();
    return this.#registers.get(offset) ?? 0;
  }

  writeUint32(offset, value) {
    this.#registers.set(offset, value);
  }

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
