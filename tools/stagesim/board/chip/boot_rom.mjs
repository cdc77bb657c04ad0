// SPDX-License-Identifier: MIT
// What firmware can see of the boot ROM: the table of functions and the search in it (RP2040 datasheet 2.8.3), and the
// one function that restarts the chip as a USB boot loader. That loader itself is not here: the board has left the bus.

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

/** Whether a chip that starts with these scratch registers goes to the USB boot loader, not to the image in flash. */
export function startsUsbBoot(scratch) {
  return scratch[4] === JUMP_MAGIC && scratch[7] === (USB_BOOT | THUMB);
}
