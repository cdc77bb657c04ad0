// SPDX-License-Identifier: MIT
// The boot ROM: from the end of reset to boot2 in flash, as RP2040 datasheet 2.8.1 describes it, by the same bus accesses as any
// program; and the table of functions, of which one is there: the restart into the USB loader (2.8.3). That loader itself is
// not: the board has left the bus.

const RESETS = 0x4000c000;
const RESETS_DONE = 0x4000c008;
const CLR = 0x3000;
const SET = 0x2000;
const IO_QSPI_RESET = 1 << 6;
const PADS_BANK0_RESET = 1 << 8;
const PADS_QSPI_RESET = 1 << 9;
const TIMER_RESET = 1 << 21;
const PADS_BANK0 = 0x4001c000;
const PAD_INPUT = 1 << 6;
const ADC_PINS = [26, 27, 28, 29];
const IO_QSPI = 0x40018000;
const QSPI_PINS = 6;
const SSI = 0x18000000;
const SSI_CTRLR0 = SSI;
const SSI_SSIENR = SSI + 0x08;
const SSI_SER = SSI + 0x10;
const SSI_BAUDR = SSI + 0x14;
const SSI_SR = SSI + 0x28;
const SSI_RECEIVED = 1 << 3;
const SSI_DR0 = SSI + 0x60;
const SSI_8_BITS = 7 << 16;
const SSI_CLOCK_MODE = 6; // place of SCPH and SCPOL
const SS_CTRL = IO_QSPI + 0x0c;
const SS_AUTO = 0;
const SS_LOW = 2 << 8;
const SS_HIGH = 3 << 8;
const BOOT_BAUD = 6; // flash at a sixth of the ring oscillator
const READ_DATA = 0x03;

const BOOT2_BYTES = 256;
const BOOT2_AT = 0x20041f00; // the last of SRAM5
const ATTEMPTS = 128;
// "Each attempt takes around 4 ms total with a 6.5 MHz boot clock", as the published boot ROM's source says: 26 000 cycles, of
// which the transfer takes the others.
const CRC_CYCLES = 10_000;
const STRAP_CYCLES = 600; // the wait for the pull-up of the flash's chip select, and nine readings of it
const POLL_CYCLES = 8;

const WATCHDOG = 0x40058000;
const CTRL = WATCHDOG;
const LOAD = WATCHDOG + 0x04;
const SCRATCH = WATCHDOG + 0x0c;
const ENABLE = 1 << 30;
const RESTART_US = 10_000;
// The boot ROM jumps to scratch register 7 after a watchdog reset when register 4 holds this (datasheet 2.8.1.1).
const JUMP_MAGIC = 0xb007c0d3;
const SRAM_END = 0x20042000;

const TABLE = 0x40;
const LOOKUP = 0x20;
const USB_BOOT = 0x36;
const THUMB = 1;
const CODE = [
  0x8802, // lookup(r0 table, r1 code): ldrh r2, [r0]
  0x2a00, // cmp r2, #0
  0xd005, // beq none
  0x428a, // cmp r2, r1
  0xd001, // beq found
  0x3004, // adds r0, #4
  0xe7f8, // b lookup
  0x8840, // found: ldrh r0, [r0, #2]
  0x4770, // bx lr
  0x2000, // none: movs r0, #0
  0x4770, // bx lr
  0xbe00, // usb_boot: bkpt, which leaveForUsbBoot answers
  0xe7fe, // b .
];

/** Puts the functions into the chip's ROM. Call it after the processor's breakpoints have been given a meaning. */
export function attachBootRom(chip) {
  const bytes = new Uint8Array(chip.bootrom.buffer);
  const halfwords = new DataView(bytes.buffer);
  halfwords.setUint16(0x14, TABLE, true);
  halfwords.setUint16(0x18, LOOKUP | THUMB, true);
  CODE.forEach((opcode, n) => halfwords.setUint16(LOOKUP + 2 * n, opcode, true));
  bytes.set(Buffer.from('UB'), TABLE);
  halfwords.setUint16(TABLE + 2, USB_BOOT | THUMB, true);

  const breakOutside = chip.onBreak;
  chip.onBreak = (code) => {
    // rp2040js has moved on to the next instruction by now.
    if (chip.core.PC === USB_BOOT || chip.core.PC === USB_BOOT + 2) leaveForUsbBoot(chip);
    else breakOutside(code);
  };
}

/** A watchdog restart in 10 ms that is to end in the USB boot loader. */
function leaveForUsbBoot(chip) {
  const { registers } = chip.core;
  const entry = USB_BOOT | THUMB;
  chip.writeUint32(CTRL, 0);
  [registers[0], registers[1]].forEach((argument, n) => chip.writeUint32(SCRATCH + 4 * n, argument >>> 0));
  [JUMP_MAGIC, (entry ^ -JUMP_MAGIC) >>> 0, SRAM_END, entry].forEach((word, n) => {
    chip.writeUint32(SCRATCH + 4 * (4 + n), word);
  });
  chip.writeUint32(LOAD, RESTART_US);
  chip.writeUint32(CTRL, ENABLE);
}

/**
 * The boot, step by step; yields how many cycles of clk_sys each step takes. Ends with the processor at boot2's first
 * instruction, or goes on for ever where the USB loader would run.
 * @param {import('rp2040js').RP2040} chip
 * @param {(reason: string) => void} onLoader
 */
export function* bootRom(chip, onLoader) {
  yield* release(chip, PADS_BANK0_RESET);
  for (const pin of ADC_PINS) chip.writeUint32(PADS_BANK0 + 4 + 4 * pin + CLR, PAD_INPUT);
  if (jumpsToLoader(chip)) {
    onLoader('as the firmware asked');
    yield Infinity;
  }
  yield* release(chip, IO_QSPI_RESET | PADS_QSPI_RESET | TIMER_RESET);
  yield STRAP_CYCLES;
  yield* connectFlash(chip);
  for (let attempt = 0; attempt < ATTEMPTS; attempt++) {
    const boot2 = yield* readBoot2(chip, attempt & 3);
    yield CRC_CYCLES;
    if (!isBoot2(boot2)) continue;
    boot2.forEach((byte, n) => chip.writeUint8(BOOT2_AT + n, byte));
    const { core } = chip;
    core.SP = BOOT2_AT;
    core.LR = 0; // nobody to return to
    core.PC = BOOT2_AT;
    core.waiting = false;
    return;
  }
  onLoader(`after ${ATTEMPTS} attempts to find a boot2 with its CRC in the first ${BOOT2_BYTES} bytes of flash`);
  yield Infinity;
}

/** Whether the scratch registers hold the jump that was left for after this reset; they are used up. */
function jumpsToLoader(chip) {
  const [magic, check, , entry] = [4, 5, 6, 7].map((n) => chip.readUint32(SCRATCH + 4 * n) >>> 0);
  if (magic !== JUMP_MAGIC || check !== (entry ^ -JUMP_MAGIC) >>> 0) return false;
  chip.writeUint32(SCRATCH + 4 * 4, 0);
  if (entry !== (USB_BOOT | THUMB)) throw new Error('the watchdog scratch registers ask for a jump into a program: not modelled');
  return true;
}

function* release(chip, blocks) {
  chip.writeUint32(RESETS + CLR, blocks);
  while ((chip.readUint32(RESETS_DONE) & blocks) !== blocks) yield POLL_CYCLES;
}

function* connectFlash(chip) {
  chip.writeUint32(RESETS + SET, IO_QSPI_RESET | PADS_QSPI_RESET);
  yield* release(chip, IO_QSPI_RESET | PADS_QSPI_RESET);
  for (let n = 0; n < QSPI_PINS; n++) chip.writeUint32(IO_QSPI + 8 * n + 4, 0);
  chip.writeUint32(SSI_SSIENR, 0);
  chip.writeUint32(SSI_BAUDR, BOOT_BAUD);
  chip.writeUint32(SSI_CTRLR0, SSI_8_BITS);
  chip.writeUint32(SSI_SER, 1);
  chip.writeUint32(SSI_SSIENR, 1);
}

function* readBoot2(chip, clockMode) {
  chip.writeUint32(SSI_SSIENR, 0);
  chip.writeUint32(SSI_CTRLR0, SSI_8_BITS | (clockMode << SSI_CLOCK_MODE));
  chip.writeUint32(SSI_SSIENR, 1);
  chip.writeUint32(SS_CTRL, SS_LOW);
  const bytes = new Uint8Array(BOOT2_BYTES);
  const header = [READ_DATA, 0, 0, 0];
  for (let n = 0; n < header.length + BOOT2_BYTES; n++) {
    chip.writeUint32(SSI_DR0, header[n] ?? 0);
    while (!(chip.readUint32(SSI_SR) & SSI_RECEIVED)) yield POLL_CYCLES;
    const byte = chip.readUint32(SSI_DR0);
    if (n >= header.length) bytes[n - header.length] = byte;
  }
  chip.writeUint32(SS_CTRL, SS_HIGH);
  chip.writeUint32(SS_CTRL, SS_AUTO);
  return bytes;
}

/** The CRC in the last four of its bytes is that of the others (datasheet 2.8.1.3.1). */
export function isBoot2(bytes) {
  const stated = new DataView(bytes.buffer, bytes.byteOffset).getUint32(BOOT2_BYTES - 4, true);
  return stated === crc32Mpeg2(bytes.subarray(0, BOOT2_BYTES - 4));
}

/** CRC-32/MPEG-2: polynomial 0x04c11db7, from all ones, not reflected, not inverted. */
export function crc32Mpeg2(bytes) {
  let crc = 0xffffffff;
  for (const byte of bytes) {
    crc ^= byte << 24;
    for (let bit = 0; bit < 8; bit++) crc = crc & 0x80000000 ? (crc << 1) ^ 0x04c11db7 : crc << 1;
  }
  return crc >>> 0;
}
