// SPDX-License-Identifier: MIT
// A chip on the test bench whose USB controller is on the bus, and the addresses that a program uses.

export const RAM = 0x50100000;
export const [ADDR_ENDP, MAIN_CTRL, SOF_RD, SIE_CTRL, SIE_STATUS, BUFF_STATUS, EP_ABORT, EP_ABORT_DONE, STALL_ARM, MUXING,
              PHY_DIRECT, PHY_OVERRIDE, INTR, INTE, INTS] =
  [0x00, 0x40, 0x48, 0x4c, 0x50, 0x58, 0x60, 0x64, 0x68, 0x74, 0x7c, 0x80, 0x8c, 0x90, 0x98].map((offset) => 0x50110000 + offset);
export const EP0_IN = RAM + 0x80;
export const EP0_OUT = RAM + 0x84;
export const EP1_OUT = RAM + 0x8c;
export const EP2_IN = RAM + 0x90;
export const [FULL, DATA1, STALL, AVAILABLE] = [1 << 15, 1 << 13, 1 << 11, 1 << 10];
export const CONNECTED = 1 << 16;
export const SUSPENDED = 1 << 4;
export const CYCLES_PER_US = 125;

/** Powered, on, pulled up, connected. @returns the controller */
export function attachUsb(b) {
  const usb = b.chip.usbCtrl;
  usb.setPowered(true);
  b.write(MUXING, 9);
  b.write(MAIN_CTRL, 1);
  b.write(SIE_CTRL, (1 << 29) | (1 << 16));
  b.run(801 * CYCLES_PER_US);
  b.write(SIE_STATUS, CONNECTED);
  return usb;
}

/** Hands a buffer over as the datasheet asks (4.1.2.5.1). */
export function give(b, control, fields, available = AVAILABLE) {
  b.write(control, fields);
  b.run(12);
  b.write(control, fields | available);
}
