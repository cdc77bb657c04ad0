// SPDX-License-Identifier: MIT
// A block whose registers only keep what is written: nothing that a program here can notice hangs on them.
import { BasePeripheral } from 'rp2040js';

export class StoredRegisters extends BasePeripheral {
  #atReset;
  #values;

  /** @param {Record<number, number>} atReset value by offset, of those that are not 0 after a reset */
  constructor(chip, name, atReset = {}) {
    super(chip, name);
    this.#atReset = atReset;
    this.reset();
  }

  reset() {
    this.#values = new Map(Object.entries(this.#atReset).map(([offset, value]) => [Number(offset), value]));
  }

  readUint32(offset) {
    return this.#values.get(offset) ?? 0;
  }

  writeUint32(offset, value) {
    this.#values.set(offset, value >>> 0);
  }
}
