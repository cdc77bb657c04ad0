// SPDX-License-Identifier: MIT
// Corrections to rp2040js' DMA: a transfer takes a cycle, pacing timers keep their rate, an abort ends.

const CHAN_ABORT = 0x444;
const TREQ_TIMER0 = 59;
const TREQ_PERMANENT = 63;
const CYCLE_NS = 8;

/**
 * A channel moves one word a cycle at most while its request is up (RP2040 datasheet 2.5.3). Channels do not contend
 * with each other or with the processor for the bus: that part of the timing cannot be measured here.
 * @param {import('rp2040js').RP2040} chip
 */
export function correctDma(chip) {
  const { dma } = chip;
  for (const channel of dma.channels) {
    channel.starved = false;
    channel.scheduleTransfer = () => {
      if (channel.starved) return;
      const requested = channel.treqValue === TREQ_PERMANENT || dma.dreq[channel.treqValue];
      const cycles = requested ? 1 : timerCycles(dma, channel.treqValue);
      if (cycles > 0) channel.transferAlarm.schedule(cycles * CYCLE_NS);
    };
  }

  // CHAN_ABORT reads as the channels whose abort is still under way; here an abort is instant.
  const read = dma.readUint32;
  dma.readUint32 = (offset) => (offset === CHAN_ABORT ? 0 : read.call(dma, offset));
}

/** Stops one channel's transfers, or all, as a bus that is never granted would. */
export function starveDma(chip, number = null) {
  for (const channel of number === null ? chip.dma.channels : [chip.dma.channels[number]]) {
    channel.starved = true;
    channel.transferAlarm.cancel();
  }
}

/** Cycles between requests of pacing timer TREQ 59..62: Y / X (datasheet 2.5.3.2); 0 if it does not run. */
function timerCycles(dma, treq) {
  const register = [dma.timer0, dma.timer1, dma.timer2, dma.timer3][treq - TREQ_TIMER0];
  if (register === undefined) return 0;
  const x = register >>> 16;
  const y = register & 0xffff;
  return x === 0 ? 0 : Math.max(1, Math.round(y / x));
}
