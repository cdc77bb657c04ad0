// SPDX-License-Identifier: MIT
// Reading flash by address, with its cache (RP2040 datasheet 2.6.3). The processor waits for each word that the cache does not
// hold. Which words that are is modelled loosely: a word once read stays, until the cache is flushed.

import { StoredRegisters } from './stored_registers.mjs';

const FLASH_BYTES = 0x1000000;

export class Xip {
  #chip;
  #ssi;
  #cache = new Map();

  /** @param {import('./ssi.mjs').Ssi} ssi */
  constructor(chip, ssi) {
    this.#chip = chip;
    this.#ssi = ssi;
  }

  read(address) {
    const at = address % FLASH_BYTES;
    const cached = this.#cache.get(at);
    if (cached !== undefined) return cached;
    const { word, cycles } = this.#ssi.readByAddress(at);
    this.#chip.core.extraCycles += cycles;
    this.#cache.set(at, word);
    return word;
  }

  flush() {
    this.#cache.clear();
  }
}

/** XIP_CTRL (2.6.3.6): its cache is on after reset; FLUSH empties it. */
export class XipControl extends StoredRegisters {
  #xip;

  constructor(chip, xip) {
    super(chip, 'XIP_CTRL', { 0x0: 0x3, 0x8: 0x2 }); // EN and ERR_BADWRITE; STAT: FIFO empty
    this.#xip = xip;
  }

  writeUint32(offset, value) {
    if (offset === 0x4) this.#xip.flush();
    else super.writeUint32(offset, value);
  }
}
