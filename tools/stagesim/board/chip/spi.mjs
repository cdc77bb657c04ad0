// SPDX-License-Identifier: MIT
// An SPI block, ARM PL022 as a master (RP2040 datasheet 4.4; ARM DDI 0194H). Takes the place of rp2040js' own, which forgives
// settings while it runs.
import { BasePeripheral } from 'rp2040js';

const CR0 = 0x00;
const CR1 = 0x04;
const DR = 0x08;
const SR = 0x0c;
const CPSR = 0x10;
const IMSC = 0x14;
const RIS = 0x18;
const MIS = 0x1c;
const ICR = 0x20;
const DMACR = 0x24;
const DEPTH = 8;
const SLAVE = 1 << 2;
const ENABLE = 1 << 1;
const LOOPBACK = 1 << 0;
const ROR = 1 << 0; // overrun; RX time-outs do not come here
const RX_HALF = 1 << 2;
const TX_HALF = 1 << 3;
const FIRST_INTERRUPT = 18; // SPI0_IRQ (2.3.2)
const FIRST_DREQ = 16; // TX of block 0 (2.5.3.1)

export class Spi extends BasePeripheral {
  /** @param {import('rp2040js').RP2040} chip */
  constructor(chip, index) {
    super(chip, `SPI${index}`);
    this.index = index;
    this.alarm = chip.clock.createAlarm(() => this.completeTransmit(this.control1 & LOOPBACK ? this.sending : 0));
    /** Begins a frame; whoever is connected calls completeTransmit with what came back. By itself: nobody, lines low. */
    this.onTransmit = () => this.alarm.schedule((this.dataBits * 1e9) / this.clockFrequency);
    this.reset();
  }

  reset() {
    this.alarm.cancel();
    this.control0 = 0;
    this.control1 = 0;
    this.prescale = 0;
    this.mask = 0;
    this.overrun = 0;
    this.dmaControl = 0;
    this.tx = [];
    this.rx = [];
    this.sending = null;
    this.#changed();
  }

  get dataBits() {
    return (this.control0 & 0xf) + 1;
  }

  /** clk_peri / (CPSDVSR (1 + SCR)), 4.4.3. */
  get clockFrequency() {
    return this.rp2040.clkPeri / (this.prescale * (1 + ((this.control0 >> 8) & 0xff)));
  }

  #note(section, text) {
    this.rp2040.violations.note(section, `SPI ${this.index}: ${text}`);
  }

  // Frames

  #send() {
    if (!(this.control1 & ENABLE) || this.sending !== null || this.tx.length === 0 || !this.#canRun()) return;
    this.sending = this.tx.shift();
    this.onTransmit(this.sending);
    this.#changed();
  }

  #canRun() {
    if (!(this.rp2040.clkPeri > 0)) this.#note('2.15.3', 'is to send without clk_peri: nothing moves');
    else if (this.prescale < 2) this.#note('4.4.4', 'CPSDVSR is 2 to 254: nothing moves');
    else if (this.control1 & SLAVE) this.#note('4.4', 'a slave is not modelled');
    else return true;
    return false;
  }

  completeTransmit(received) {
    if (this.sending === null) return; // the block was reset meanwhile
    this.sending = null;
    if (this.rx.length < DEPTH) this.rx.push(received & ((1 << this.dataBits) - 1));
    else this.overrun = ROR;
    this.#changed();
    this.#send();
  }

  get #raw() {
    return this.overrun | (this.rx.length >= DEPTH / 2 ? RX_HALF : 0) | (this.tx.length <= DEPTH / 2 ? TX_HALF : 0);
  }

  #changed() {
    const { dma } = this.rp2040;
    const tx = FIRST_DREQ + 2 * this.index;
    if (this.dmaControl & 2 && this.tx.length < DEPTH) dma.setDREQ(tx);
    else dma.clearDREQ(tx);
    if (this.dmaControl & 1 && this.rx.length > 0) dma.setDREQ(tx + 1);
    else dma.clearDREQ(tx + 1);
    this.rp2040.setInterrupt(FIRST_INTERRUPT + this.index, (this.#raw & this.mask) !== 0);
  }

  // Bus

  readUint32(offset) {
    switch (offset) {
      case CR0:
        return this.control0;
      case CR1:
        return this.control1;
      case DR:
        return this.#receive();
      case SR:
        return (this.sending !== null || this.tx.length > 0 ? 16 : 0) | (this.rx.length === DEPTH ? 8 : 0) |
          (this.rx.length > 0 ? 4 : 0) | (this.tx.length < DEPTH ? 2 : 0) | (this.tx.length === 0 ? 1 : 0);
      case CPSR:
        return this.prescale;
      case IMSC:
        return this.mask;
      case RIS:
        return this.#raw;
      case MIS:
        return this.#raw & this.mask;
      case DMACR:
        return this.dmaControl;
      default:
        return 0;
    }
  }

  #receive() {
    if (this.rx.length === 0) this.#note('4.4.4', 'DR is read while nothing was received: what comes is not defined');
    const word = this.rx.shift() ?? 0;
    this.#changed();
    return word;
  }

  writeUint32(offset, value) {
    switch (offset) {
      case CR0:
        this.#mustBeOff('CR0');
        if ((value & 0xf) < 3) this.#note('4.4.4', 'DSS 0 to 2 is reserved: frames have 4 to 16 bits');
        if ((value >> 4) & 3) this.#note('4.4.4', 'frame formats other than Motorola SPI are not modelled');
        this.control0 = value & 0xffff;
        break;
      case CR1:
        this.#writeControl1(value);
        break;
      case DR:
        if (this.tx.length === DEPTH) this.#note('4.4.4', 'DR is written while the FIFO is full: the word is lost');
        else this.tx.push(value & ((1 << this.dataBits) - 1));
        break;
      case CPSR:
        this.#mustBeOff('CPSR');
        if (value & 1 || value < 2 || value > 254) this.#note('4.4.4', `CPSDVSR is even, 2 to 254, not ${value}`);
        this.prescale = value & 0xfe;
        break;
      case IMSC:
        this.mask = value & 0xf;
        break;
      case ICR:
        if (value & ROR) this.overrun = 0;
        break;
      case DMACR:
        this.dmaControl = value & 3;
        break;
    }
    this.#send();
    this.#changed();
  }

  #mustBeOff(name) {
    if (this.control1 & ENABLE) this.#note('4.4.3', `${name} is written while SSE is set: the frame under way is not defined`);
  }

  #writeControl1(value) {
    if (this.control1 & ENABLE && (value ^ this.control1) & SLAVE) this.#note('4.4.4', 'MS is changed while SSE is set');
    if (this.control1 & ENABLE && !(value & ENABLE) && this.sending !== null) {
      this.#note('4.4.3', 'SSE is cleared in the middle of a frame');
    }
    this.control1 = value & 0xf;
  }
}
