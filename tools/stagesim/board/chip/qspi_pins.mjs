// SPDX-License-Identifier: MIT
// The six pins of the flash chip (RP2040 datasheet 2.19.6.2 and 2.19.6.4): whether they reach it, and chip select held by hand.
import { StoredRegisters } from './stored_registers.mjs';

const PIN_COUNT = 6;
const SS_CTRL = 0x0c;
const FUNCTION_XIP = 0;
const FUNCTION_NONE = 0x1f;
const OVERRIDE_LOW = 2;
const OVERRIDE_HIGH = 3;
const IO_RESET = Object.fromEntries(Array.from({ length: PIN_COUNT }, (_, n) => [8 * n + 4, FUNCTION_NONE]));
const PADS_RESET = { 0x4: 0x56, 0x8: 0x52, 0xc: 0x52, 0x10: 0x52, 0x14: 0x52, 0x18: 0x5a };

export class QspiPins extends StoredRegisters {
  #flash;

  /** @param {import('./flash_chip.mjs').FlashChip} flash */
  constructor(chip, flash) {
    super(chip, 'IO_QSPI', IO_RESET);
    this.#flash = flash;
    this.pads = new StoredRegisters(chip, 'PADS_QSPI', PADS_RESET);
  }

  /** Chip select is forced by the program. */
  get heldByProgram() {
    return this.#override !== 0;
  }

  get #override() {
    return (this.readUint32(SS_CTRL) >> 8) & 3;
  }

  get #connected() {
    for (let n = 0; n < PIN_COUNT; n++) if ((this.readUint32(8 * n + 4) & 0x1f) !== FUNCTION_XIP) return false;
    return true;
  }

  select(selected) {
    if (this.#connected) this.#flash.select(selected);
  }

  /** As FlashChip.exchange. Unless the program holds chip select, it falls and rises with each transfer of the SSI. */
  exchange(byte, sck_hz) {
    if (!this.#connected) return { out: 0xff, tooFast: false };
    return this.#flash.exchange(byte, sck_hz);
  }

  writeUint32(offset, value) {
    super.writeUint32(offset, value);
    if (offset !== SS_CTRL) return;
    if (this.#override === OVERRIDE_LOW) this.select(true);
    if (this.#override === OVERRIDE_HIGH || this.#override === 0) this.select(false);
  }
}
