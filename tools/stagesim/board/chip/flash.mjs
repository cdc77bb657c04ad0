// SPDX-License-Identifier: MIT
// The flash chip's command port, as far as a program asks who it is: SSI byte by byte with the chip select held by
// hand (RP2040 datasheet 2.19.6.2 and 4.10; W25Q16JV datasheet 8.2.26 and 8.2.5). Reading flash by address is apart.
import { BasePeripheral } from 'rp2040js';

const SSI_PAGE = 0x18000;
const IO_QSPI_PAGE = 0x40018;
const SR = 0x28;
const DR0 = 0x60;
const SR_READY = 0x0e; // transmit not full, transmit empty, receive not empty
const SS_CTRL = 0x0c;
const OUTOVER_LOW = 2;

const READ_UNIQUE_ID = 0x4b;
const UNIQUE_ID_DUMMIES = 4;

/** @param {Uint8Array} uniqueId of eight bytes */
export function attachFlash(chip, uniqueId) {
  const flash = new FlashCommands(uniqueId);
  chip.peripherals[SSI_PAGE] = new CommandPort(chip, flash);
  chip.peripherals[IO_QSPI_PAGE] = new QspiPins(chip, flash);
}

/** A command and the bytes that follow it, from chip select low to high. */
class FlashCommands {
  #received = [];

  constructor(uniqueId) {
    this.uniqueId = uniqueId;
  }

  select() {
    this.#received = [];
  }

  /** One byte goes in and one comes out at the same time. */
  exchange(byte) {
    const place = this.#received.length;
    this.#received.push(byte);
    if (this.#received[0] === READ_UNIQUE_ID) return this.uniqueId[place - 1 - UNIQUE_ID_DUMMIES] ?? 0;
    return 0; // also the answer to "read status": not busy
  }
}

class CommandPort extends BasePeripheral {
  #registers = new Map();
  #answer = 0;

  constructor(chip, flash) {
    super(chip, 'SSI');
    this.flash = flash;
  }

  readUint32(offset) {
    if (offset === SR) return SR_READY;
    return offset === DR0 ? this.#answer : this.#registers.get(offset) ?? 0;
  }

  writeUint32(offset, value) {
    if (offset === DR0) this.#answer = this.flash.exchange(value & 0xff);
    else this.#registers.set(offset, value);
  }
}

class QspiPins extends BasePeripheral {
  #registers = new Map();

  constructor(chip, flash) {
    super(chip, 'IO_QSPI');
    this.flash = flash;
  }

  readUint32(offset) {
    return this.#registers.get(offset) ?? 0;
  }

  writeUint32(offset, value) {
    this.#registers.set(offset, value);
    if (offset === SS_CTRL && ((value >> 8) & 3) === OUTOVER_LOW) this.flash.select();
  }
}
