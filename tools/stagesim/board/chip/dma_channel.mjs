// SPDX-License-Identifier: MIT
// One DMA channel: its registers under four names, its transfers a cycle each (RP2040 datasheet 2.5.1 to 2.5.7).
import { BusFault } from './bus.mjs';

export const CYCLE_NS = 8;
const ABORT_CYCLES = 4; // until an abort is over: in-flight transfers retire (2.5.5.3)

const EN = 1 << 0;
const INCR_READ = 1 << 4;
const INCR_WRITE = 1 << 5;
const RING_WRITES = 1 << 10;
const IRQ_QUIET = 1 << 21;
const BSWAP = 1 << 22;
const SNIFF_EN = 1 << 23;
const BUSY = 1 << 24;
const WRITE_ERROR = 1 << 29;
const READ_ERROR = 1 << 30;
const AHB_ERROR = 0x80000000;
const SETTINGS = 0xffffff;
const TREQ_PERMANENT = 63;
const TREQ_TIMER0 = 59;
const DREQS = 40; // 0..39 are connected (2.5.3.1)
const CHANNELS = 12;

// What stands at the four words of each alias; the last of each is a trigger (2.5.7).
const READ = 0, WRITE = 1, COUNT = 2, CTRL = 3;
const REGISTERS = [READ, WRITE, COUNT, CTRL, CTRL, READ, WRITE, COUNT, CTRL, COUNT, READ, WRITE, CTRL, WRITE, COUNT, READ];

export class DmaChannel {
  /** @param {import('./dma.mjs').Dma} dma */
  constructor(dma, index) {
    this.dma = dma;
    this.index = index;
    this.starved = false; // by an injected fault
    this.transferAlarm = dma.rp2040.clock.createAlarm(() => this.#transfer());
    this.abortAlarm = dma.rp2040.clock.createAlarm(() => this.#endAbort());
    this.reset();
  }

  reset() {
    this.transferAlarm.cancel();
    this.abortAlarm.cancel();
    this.readAddr = 0;
    this.writeAddr = 0;
    this.count = 0;
    this.reload = 0;
    this.busy = false;
    this.aborting = false;
    this.errors = 0;
    this.wasInFlight = false;
    this.#configure(this.index << 11);
  }

  get enabled() {
    return (this.ctrl & EN) !== 0;
  }

  get active() {
    return this.enabled && this.busy && !this.aborting;
  }

  // Registers

  read(word) {
    switch (REGISTERS[word]) {
      case READ:
        return this.readAddr;
      case WRITE:
        return this.writeAddr;
      case COUNT:
        return this.count >>> 0;
      default:
        return (this.ctrl | (this.busy ? BUSY : 0) | this.errors | (this.errors ? AHB_ERROR : 0)) >>> 0;
    }
  }

  /** @param {number} raw the word on the bus, for bits that are cleared by writing ones, whatever the alias of 2.1.2 */
  write(word, value, raw) {
    switch (REGISTERS[word]) {
      case READ:
        this.#mayChange('READ_ADDR');
        this.readAddr = value >>> 0;
        break;
      case WRITE:
        this.#mayChange('WRITE_ADDR');
        this.writeAddr = value >>> 0;
        break;
      case COUNT:
        this.reload = value >>> 0; // taken at the next trigger, even if one is under way
        break;
      default:
        this.#writeCtrl(value, raw);
    }
    if (word % 4 !== 3) return;
    if (value !== 0) this.trigger();
    else if (this.ctrl & IRQ_QUIET) this.dma.raise(this.index); // a null trigger (2.5.2.3)
  }

  #mayChange(name) {
    if (this.busy) this.#note('2.5.1', `${name} is written while BUSY: what the transfers under way do is not defined`);
  }

  #writeCtrl(value, raw) {
    this.errors &= ~(raw & (READ_ERROR | WRITE_ERROR));
    if (this.busy && value & EN && ((value ^ this.ctrl) & SETTINGS & ~EN) !== 0) {
      this.#note('2.5.7', 'CTRL is changed while BUSY in more than EN: what the transfers under way do is not defined');
    }
    if (this.busy && !(value & EN) && ((value >> 11) & 0xf) !== this.index && this.chainTo !== ((value >> 11) & 0xf)) {
      this.#note('2.5.2.2', `CTRL stops it and says CHAIN_TO ${(value >> 11) & 0xf}: what is still in flight may start that channel`);
    }
    this.#configure(value & SETTINGS);
    if (this.active) this.schedule();
    else this.transferAlarm.cancel(); // paused: BUSY stays
  }

  #configure(ctrl) {
    this.ctrl = ctrl;
    this.treq = (ctrl >> 15) & 0x3f;
    this.chainTo = (ctrl >> 11) & 0xf;
    const ringBits = (ctrl >> 6) & 0xf;
    this.ringMask = ringBits === 0 ? 0xffffffff : (1 << ringBits) - 1;
    this.size = [1, 2, 4, 1][(ctrl >> 2) & 3];
    if (!(ctrl & EN)) return;
    if (((ctrl >> 2) & 3) === 3) this.#note('2.5.7', 'DATA_SIZE 3 is reserved');
    if (this.chainTo >= CHANNELS) this.#note('2.5.7', `CHAIN_TO ${this.chainTo}: there are ${CHANNELS} channels`);
    if (this.treq >= DREQS && this.treq < TREQ_TIMER0) this.#note('2.5.3.1', `TREQ_SEL ${this.treq}: nothing requests there`);
    if (ctrl & SNIFF_EN) this.#note('2.5.5.2', 'the sniffer is not modelled');
  }

  // Sequences

  /** By a trigger register, MULTI_CHAN_TRIGGER or another channel's completion. Ignored without EN (2.5.7). */
  trigger() {
    if (!this.enabled) return;
    if (this.busy) {
      this.#note('2.5.2', 'triggered while BUSY: the trigger is lost');
      return;
    }
    this.busy = true;
    this.count = this.reload;
    if (this.count === 0) {
      this.#note('2.5.1.2', 'started with TRANS_COUNT 0: nothing is transferred');
      this.#complete();
    } else {
      this.schedule();
    }
  }

  /** Lets the next transfer come, if it is requested. */
  schedule() {
    if (this.starved || this.transferAlarm.scheduled) return;
    const cycles = this.treq === TREQ_PERMANENT || this.dma.dreq[this.treq] ? 1 : this.dma.timerCycles(this.treq - TREQ_TIMER0);
    if (cycles > 0) this.transferAlarm.schedule(cycles * CYCLE_NS);
  }

  #transfer() {
    if (!this.active) return;
    if (this.treq < DREQS && !this.dma.dreq[this.treq]) return; // withdrawn meanwhile
    const { ctrl, size, ringMask } = this;
    if (this.readAddr % size !== 0) return this.#halt(READ_ERROR, 'READ_ADDR');
    if (this.writeAddr % size !== 0) return this.#halt(WRITE_ERROR, 'WRITE_ADDR');
    const error = this.#move(size);
    if (error !== 0) return this.#stop(error); // the bus has told of it
    if (ctrl & INCR_READ) this.readAddr = advance(this.readAddr, size, ctrl & RING_WRITES ? 0xffffffff : ringMask);
    if (ctrl & INCR_WRITE) this.writeAddr = advance(this.writeAddr, size, ctrl & RING_WRITES ? ringMask : 0xffffffff);
    if (--this.count === 0) this.#complete();
    else this.schedule();
  }

  /** @returns {number} the flag of the error that the bus has answered with, 0 without one */
  #move(size) {
    let error = READ_ERROR;
    try {
      const value = this.#fetch(size);
      error = WRITE_ERROR;
      this.#store(size, value);
      return 0;
    } catch (fault) {
      if (!(fault instanceof BusFault)) throw fault;
      return error;
    }
  }

  #fetch(size) {
    const { rp2040 } = this.dma;
    if (size === 4) return this.ctrl & BSWAP ? swapBytes(rp2040.readUint32(this.readAddr)) : rp2040.readUint32(this.readAddr);
    if (size === 1) return rp2040.readUint8(this.readAddr);
    const half = rp2040.readUint16(this.readAddr);
    return this.ctrl & BSWAP ? ((half & 0xff) << 8) | (half >> 8) : half;
  }

  #store(size, value) {
    const { rp2040 } = this.dma;
    if (size === 4) rp2040.writeUint32(this.writeAddr, value);
    else if (size === 2) rp2040.writeUint16(this.writeAddr, value);
    else rp2040.writeUint8(this.writeAddr, value);
  }

  /** A bus error ends the sequence, sets its flag and always raises the interrupt (2.5.7, AHB_ERROR). Nothing is chained. */
  #halt(error, name) {
    this.#note('2.5.1', `${name} is not aligned to DATA_SIZE: a bus error, the channel halts`);
    this.#stop(error);
  }

  #stop(error) {
    this.errors |= error;
    this.busy = false;
    this.dma.raise(this.index);
  }

  /** What CTRL says now counts, not what it said at the trigger (2.5.2.2). */
  #complete() {
    this.busy = false;
    if (!(this.ctrl & IRQ_QUIET)) this.dma.raise(this.index);
    if (this.chainTo !== this.index) this.dma.channels[this.chainTo]?.trigger();
  }

  /** CHAN_ABORT: BUSY until what is in flight has retired; no chain (2.5.5.3). */
  abort() {
    if (this.aborting) return;
    this.aborting = true;
    this.wasInFlight = this.transferAlarm.scheduled;
    this.transferAlarm.cancel();
    this.abortAlarm.schedule(ABORT_CYCLES * CYCLE_NS);
  }

  /** What was in flight raises a completion interrupt after all: erratum RP2040-E13. */
  #endAbort() {
    this.aborting = false;
    if (this.busy && this.wasInFlight && !(this.ctrl & IRQ_QUIET)) this.dma.raise(this.index);
    this.busy = false;
    this.count = 0;
  }

  #note(section, text) {
    this.dma.note(section, `DMA channel ${this.index}: ${text}`);
  }
}

/** The address of the next transfer: in a ring only the lower bits change. */
function advance(address, size, mask) {
  return ((address & ~mask) | ((address + size) & mask)) >>> 0;
}

function swapBytes(word) {
  return ((word << 24) | ((word & 0xff00) << 8) | ((word >>> 8) & 0xff00) | (word >>> 24)) >>> 0;
}
