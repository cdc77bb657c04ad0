// SPDX-License-Identifier: MIT
// The SSI, which talks to the flash chip (RP2040 datasheet 4.10): frames of 8 bits both ways through its FIFOs, and reads by
// address ("EEPROM read" with the XIP command, 4.10.8 and 2.6.3). Serial frames on one line only; everything else is noted.
import { BasePeripheral } from 'rp2040js';

const CTRLR0 = 0x00;
const CTRLR1 = 0x04;
const SSIENR = 0x08;
const SER = 0x10;
const BAUDR = 0x14;
const TXFLR = 0x20;
const RXFLR = 0x24;
const SR = 0x28;
const DR0 = 0x60;
const SPI_CTRLR0 = 0xf4;
const FIFO_FRAMES = 16;
const SR_TX_NOT_FULL = 1 << 1;
const SR_TX_EMPTY = 1 << 2;
const SR_RX_NOT_EMPTY = 1 << 3;
const TMOD_BOTH_WAYS = 0;
const TMOD_EEPROM_READ = 3;
const FIELDS = { polarity: [6, 3], tmod: [8, 3], bits: [16, 31], lines: [21, 3] }; // of CTRLR0: place, mask
const RESET_VALUES = { [CTRLR0]: 0, [SPI_CTRLR0]: 0x03000000 };

export class Ssi extends BasePeripheral {
  #registers;
  #received = []; // frames with the tick at which each is there
  #time;
  #pins;
  #clocks;
  #busyUntil = 0;

  /**
   * @param {{cycle: number}} time
   * @param {import('./clocks.mjs').Clocks} clocks
   * @param {import('./qspi_pins.mjs').QspiPins} pins with the flash chip at their other end
   */
  constructor(chip, time, clocks, pins) {
    super(chip, 'XIP_SSI');
    this.#time = time;
    this.#clocks = clocks;
    this.#pins = pins;
    this.#registers = new Map(Object.entries(RESET_VALUES).map(([offset, value]) => [Number(offset), value]));
  }

  #register(offset) {
    return this.#registers.get(offset) ?? 0;
  }

  #field(name) {
    const [place, mask] = FIELDS[name];
    return (this.#register(CTRLR0) >> place) & mask;
  }

  get #sck_hz() {
    return this.#clocks.sysHz / this.#register(BAUDR);
  }

  readUint32(offset) {
    const there = this.#received.filter(({ tick }) => tick <= this.#time.cycle).length;
    if (offset === RXFLR) return there;
    if (offset === TXFLR) return this.#received.length - there;
    if (offset === SR) {
      const left = this.#received.length - there;
      return (left > 0 ? 1 : 0) | (left < FIFO_FRAMES ? SR_TX_NOT_FULL : 0) | (left === 0 ? SR_TX_EMPTY : 0) |
        (there > 0 ? SR_RX_NOT_EMPTY : 0);
    }
    if (offset !== DR0) return this.#register(offset);
    if (there > 0) return this.#received.shift().byte;
    this.#note('4.10.5', 'SSI DR0 is read while nothing has been received');
    return 0;
  }

  writeUint32(offset, value) {
    if (offset === DR0) {
      this.#send(value & 0xff);
      return;
    }
    if (this.#register(SSIENR) && offset !== SSIENR && offset !== SER) {
      this.#note('4.10.13', `SSI + 0x${offset.toString(16)} is written while the SSI is enabled: ignored`);
      return;
    }
    if (offset === BAUDR && (value < 2 || value % 2 === 1)) {
      this.#note('4.10.13', `SSI BAUDR = ${value}: an even number, 2 at least`);
    }
    this.#registers.set(offset, value);
    if (offset === SSIENR && value === 0) this.#received = []; // disabling empties the FIFOs
  }

  #note(section, text) {
    this.rp2040.violations.note(section, text);
  }

  #send(byte) {
    if (!this.#register(SSIENR) || !this.#register(SER)) {
      this.#note('4.10.13', 'SSI DR0 is written while the SSI is disabled or selects nobody');
      return;
    }
    if (this.#field('tmod') !== TMOD_BOTH_WAYS || this.#field('bits') !== 7 || this.#field('lines') !== 0) {
      this.#note('4.10.8', 'SSI frames by program are modelled as 8 bits both ways on one line');
      return;
    }
    if (this.#received.length >= FIFO_FRAMES) {
      this.#note('4.10.5', 'SSI FIFOs overflow');
      return;
    }
    const begin = Math.max(this.#busyUntil, this.#time.cycle);
    this.#busyUntil = begin + this.#clocks.ticks(8 * this.#register(BAUDR));
    this.#received.push({ byte: this.#exchange(byte), tick: this.#busyUntil });
  }

  #exchange(byte) {
    const { out, tooFast } = this.#pins.exchange(byte, this.#sck_hz);
    if (tooFast) this.#note('4.10.4', `the flash chip is clocked at ${Math.round(this.#sck_hz / 1e5) / 10} MHz: too fast for this command`);
    return this.#field('polarity') === 0 || this.#field('polarity') === 3 ? out : (out << 1) & 0xff; // a bit late
  }

  /** What a read by address finds is set up as, if it works: 32-bit frames, one a read, command 03h and 24 address bits. */
  get #readsByAddress() {
    const control = this.#register(SPI_CTRLR0);
    return this.#register(SSIENR) === 1 && this.#register(SER) === 1 && this.#field('tmod') === TMOD_EEPROM_READ &&
      this.#field('bits') === 31 && this.#field('lines') === 0 && this.#register(CTRLR1) === 0 &&
      control >>> 24 === 0x03 && ((control >> 11) & 0x1f) === 0 && ((control >> 8) & 3) === 2 && ((control >> 2) & 0xf) === 6 &&
      (control & 3) === 0;
  }

  /** A word of flash by address. @returns {{word: number, cycles: number}} cycles of clk_sys that it takes */
  readByAddress(address) {
    if (!this.#readsByAddress || this.#pins.heldByProgram) {
      this.#note('2.6.3', `flash is read by address at 0x${address.toString(16)} while the SSI is not set up for it`);
      return { word: 0xffffffff, cycles: 8 };
    }
    this.#pins.select(true);
    const header = [this.#register(SPI_CTRLR0) >>> 24, (address >> 16) & 0xff, (address >> 8) & 0xff, address & 0xff];
    for (const byte of header) this.#exchange(byte);
    let word = 0;
    for (let n = 0; n < 4; n++) word += this.#exchange(0) * 2 ** (8 * n); // the bus sees flash's bytes in their order
    this.#pins.select(false);
    const FRAME_CYCLES = 8; // from bus to pins and back
    return { word, cycles: 64 * this.#register(BAUDR) + FRAME_CYCLES };
  }
}
