// SPDX-License-Identifier: MIT
// Corrections to rp2040js' SIO (RP2040 datasheet 2.3.1): the divider takes its time, its results are whole numbers, and what
// is not there is told.

const DIVIDER_CYCLES = 8; // 2.3.1.5
const DIV_QUOTIENT = 0x70;
const DIV_REMAINDER = 0x74;
const DIV_CSR = 0x78;

/**
 * @param {import('rp2040js').RP2040} chip
 * @param {{cycle: number}} time
 */
export function correctSio(chip, time) {
  const { sio } = chip;
  const note = (section, text) => chip.violations.note(section, `SIO: ${text}`);
  let dividedFrom = -DIVIDER_CYCLES;

  sio.updateHardwareDivider = (signed) => {
    const a = signed ? sio.divDividend | 0 : sio.divDividend >>> 0;
    const b = signed ? sio.divDivisor | 0 : sio.divDivisor >>> 0;
    // By zero: all ones, or one with the sign turned, and the dividend remains (2.3.1.5).
    sio.divQuotient = (b === 0 ? (signed && a < 0 ? 1 : -1) : Math.trunc(a / b)) >>> 0;
    sio.divRemainder = (b === 0 ? a : a % b) >>> 0;
    sio.divCSR = 3;
    dividedFrom = time.cycle;
  };

  const read = sio.readUint32;
  sio.readUint32 = (offset) => {
    if (offset >= DIV_QUOTIENT && offset <= DIV_CSR) {
      const ready = time.cycle - dividedFrom >= DIVIDER_CYCLES;
      if (offset === DIV_CSR) return (sio.divCSR & 2) | (ready ? 1 : 0);
      if (!ready) note('2.3.1.5', 'the divider is read before its eight cycles: no result yet');
      if (offset === DIV_REMAINDER) return sio.divRemainder;
    }
    return read.call(sio, offset);
  };
}
