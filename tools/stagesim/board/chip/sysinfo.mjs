// SPDX-License-Identifier: MIT
// SYSINFO: which stepping the chip is (RP2040 datasheet 2.20): B0 and B1 say revision 1, B2 says 2.
import { BasePeripheral } from 'rp2040js';

const CHIP_ID = 0x00;
const PLATFORM = 0x04;
const PART = 0x0002927; // part 2, manufacturer 0x927
const ASIC = 2;

/** The steppings that a board can have. */
export const STEPPINGS = Object.freeze(['b0', 'b1', 'b2']);

/** Of SYSINFO.CHIP_ID. */
export const revisionOf = (stepping) => (stepping === 'b2' ? 2 : 1);

export class SysInfo extends BasePeripheral {
  #revision;

  constructor(chip, revision) {
    super(chip, 'SYSINFO');
    this.#revision = revision;
  }

  readUint32(offset) {
    if (offset === CHIP_ID) return ((this.#revision << 28) | PART) >>> 0;
    return offset === PLATFORM ? ASIC : 0; // GITREF, which nobody asks for
  }

  writeUint32() {
    this.rp2040.violations.note('2.20', 'SYSINFO was written, which only reads');
  }
}
