// SPDX-License-Identifier: MIT
// The flash chip on its own pins: commands bit-serial on one line, as far as a boot and a program that only reads need them
// (Winbond W25Q16JV datasheet, 8.2). It keeps what it holds, and its state, when the RP2040 is reset.

const READ_DATA = 0x03; // 8.2.11; without a dummy byte, and up to 50 MHz (9.6, fR)
const READ_STATUS = 0x05; // 8.2.4
const READ_UNIQUE_ID = 0x4b; // 8.2.26
const READ_JEDEC_ID = 0x9f; // 8.2.27
const ADDRESS_BYTES = 3;
const UNIQUE_ID_DUMMIES = 4;
const JEDEC_ID = [0xef, 0x40, 0x15];
const NOBODY_DRIVES = 0xff; // the pads are pulled up
const SCK_HZ_MAX = { [READ_DATA]: 50e6 };
const SCK_HZ_MAX_OTHER = 133e6;
const BYTES = 2 << 20;

export class FlashChip {
  #bytes;
  #uniqueId;
  #received = [];
  #selected = false;

  /**
   * @param {Uint8Array} bytes its contents, all ones where nothing is programmed
   * @param {Uint8Array} uniqueId of eight bytes
   */
  constructor(bytes, uniqueId) {
    this.#bytes = bytes;
    this.#uniqueId = uniqueId;
  }

  /** Chip select falls (true) or rises. */
  select(selected) {
    if (selected && !this.#selected) this.#received = [];
    this.#selected = selected;
  }

  /**
   * One byte goes in and one comes out at the same time.
   * @returns {{out: number, tooFast: boolean}} tooFast: beyond what this command stands, so `out` could be anything
   */
  exchange(byte, sck_hz) {
    if (!this.#selected) return { out: NOBODY_DRIVES, tooFast: false };
    const place = this.#received.length;
    this.#received.push(byte);
    const [command] = this.#received;
    return { out: place === 0 ? NOBODY_DRIVES : this.#answer(command, place - 1),
             tooFast: sck_hz > (SCK_HZ_MAX[command] ?? SCK_HZ_MAX_OTHER) };
  }

  #answer(command, place) {
    if (command === READ_DATA) {
      if (place < ADDRESS_BYTES) return NOBODY_DRIVES;
      const [, high, middle, low] = this.#received;
      return this.#bytes[(((high << 16) | (middle << 8) | low) + place - ADDRESS_BYTES) % BYTES];
    }
    if (command === READ_STATUS) return 0; // not busy
    if (command === READ_JEDEC_ID) return JEDEC_ID[place % JEDEC_ID.length];
    if (command === READ_UNIQUE_ID) return this.#uniqueId[place - UNIQUE_ID_DUMMIES] ?? NOBODY_DRIVES;
    return NOBODY_DRIVES;
  }
}
