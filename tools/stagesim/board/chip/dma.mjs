// SPDX-License-Identifier: MIT
// The DMA block: twelve channels, their interrupts, pacing timers and requests (RP2040 datasheet 2.5). Takes the place of
// rp2040js' own, whose transfers take no time.
import { BasePeripheral } from 'rp2040js';
import { DmaChannel } from './dma_channel.mjs';

const CHANNELS = 12;
const ALL = (1 << CHANNELS) - 1;
const CHANNEL_BYTES = 0x40;
const INTR = 0x400;
const INTS1 = 0x41c;
const TIMER0 = 0x420;
const MULTI_CHAN_TRIGGER = 0x430;
const CHAN_ABORT = 0x444;
const N_CHANNELS = 0x448;
const DEBUG = 0x800; // DBG_CTDREQ and DBG_TCR of each channel
const FIRST_INTERRUPT = 11; // DMA_IRQ_0 (2.3.2)

/**
 * A channel moves one word a cycle at most while its request is up (2.5.3); reads and writes of one transfer are in the same
 * cycle. Channels do not contend with each other or with the processor for the bus, and a request is the peripheral's level,
 * not a count of credits (2.5.3.2): that part of the timing cannot be measured here.
 */
export class Dma extends BasePeripheral {
  /** @param {import('rp2040js').RP2040} chip */
  constructor(chip) {
    super(chip, 'DMA');
    /** Which requests are up, by number (2.5.3.1). */
    this.dreq = chip.dma.dreq.slice();
    this.channels = Array.from({ length: CHANNELS }, (_, index) => new DmaChannel(this, index));
    this.reset();
  }

  /** As after the block's reset; requests are the peripherals'. */
  reset() {
    for (const channel of this.channels) channel.reset();
    this.raised = 0;
    this.lines = [{ enable: 0, force: 0 }, { enable: 0, force: 0 }];
    this.timers = [0, 0, 0, 0];
    this.#updateInterrupts();
  }

  // Requests

  setDREQ(number) {
    if (this.dreq[number]) return;
    this.dreq[number] = true;
    for (const channel of this.channels) {
      if (channel.treq === number && channel.active) channel.schedule();
    }
  }

  clearDREQ(number) {
    this.dreq[number] = false;
  }

  /** Cycles between requests of a pacing timer: Y / X (2.5.3.3); 0 if there is none, or it does not run. */
  timerCycles(number) {
    const register = this.timers[number];
    if (register === undefined) return 0;
    const x = register >>> 16;
    const y = register & 0xffff;
    return x === 0 ? 0 : Math.max(1, Math.round(y / x));
  }

  // Interrupts

  raise(index) {
    this.raised |= 1 << index;
    this.#updateInterrupts();
  }

  #status({ enable, force }) {
    return (this.raised & enable) | force;
  }

  #updateInterrupts() {
    this.lines.forEach((line, n) => this.rp2040.setInterrupt(FIRST_INTERRUPT + n, this.#status(line) !== 0));
  }

  note(section, text) {
    this.rp2040.violations.note(section, text);
  }

  // Bus

  readUint32(offset) {
    if (offset < CHANNELS * CHANNEL_BYTES) return this.channels[offset >> 6].read((offset & 0x3f) >> 2);
    if (offset >= INTR && offset <= INTS1) return this.#readInterrupts(offset - INTR);
    if (offset >= TIMER0 && offset < MULTI_CHAN_TRIGGER) return this.timers[(offset - TIMER0) >> 2];
    if (offset >= DEBUG && offset < DEBUG + CHANNELS * CHANNEL_BYTES) {
      const channel = this.channels[(offset - DEBUG) >> 6];
      if ((offset & 0x3f) === 0) return this.dreq[channel.treq] ? 1 : 0;
      if ((offset & 0x3f) === 4) return channel.reload;
    }
    switch (offset) {
      case MULTI_CHAN_TRIGGER: // self-clearing
        return 0;
      case CHAN_ABORT:
        return this.channels.reduce((bits, { aborting, index }) => bits | (aborting ? 1 << index : 0), 0);
      case N_CHANNELS:
        return CHANNELS;
      default:
        return 0;
    }
  }

  #readInterrupts(place) {
    if (place === 0) return this.raised;
    const line = this.lines[place >> 4];
    return [undefined, line.enable, line.force, this.#status(line)][(place >> 2) & 3] ?? 0;
  }

  writeUint32(offset, value) {
    if (offset < CHANNELS * CHANNEL_BYTES) {
      this.channels[offset >> 6].write((offset & 0x3f) >> 2, value >>> 0, this.rawWriteValue);
    } else if (offset >= INTR && offset <= INTS1) {
      this.#writeInterrupts(offset - INTR, value & ALL);
    } else if (offset >= TIMER0 && offset < MULTI_CHAN_TRIGGER) {
      if (value >>> 16 > (value & 0xffff)) this.note('2.5.3.3', 'a pacing timer of more than a request a cycle: X / Y is at most 1');
      this.timers[(offset - TIMER0) >> 2] = value >>> 0;
    } else {
      this.#writeGlobal(offset, value);
    }
  }

  /** INTR, INTS0 and INTS1 clear what is written as one; INTE and INTF are stored (2.5.7). */
  #writeInterrupts(place, value) {
    const line = this.lines[place >> 4];
    const register = (place >> 2) & 3;
    if (register === 1) line.enable = value;
    else if (register === 2) line.force = value;
    else this.raised &= ~this.rawWriteValue;
    this.#updateInterrupts();
  }

  #writeGlobal(offset, value) {
    if (offset === MULTI_CHAN_TRIGGER || offset === CHAN_ABORT) {
      if (value & ~ALL) this.note('2.5.7', `DMA: there are ${CHANNELS} channels`);
      for (const channel of this.channels) {
        if (!((value >> channel.index) & 1)) continue;
        if (offset === CHAN_ABORT) channel.abort();
        else channel.trigger();
      }
    }
  }
}

/** Stops one channel's transfers, or all, as a bus that is never granted would. */
export function starveDma(chip, number = null) {
  for (const channel of number === null ? chip.dma.channels : [chip.dma.channels[number]]) {
    channel.starved = true;
    channel.transferAlarm.cancel();
  }
}
