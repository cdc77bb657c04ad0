// SPDX-License-Identifier: MIT
// The USB controller's registers as tables: which bits can be written, which clear by a 1, which clear themselves, which only
// read (RP2040 datasheet 4.1.4, its register text).

export const Register = Object.freeze({
  ADDR_ENDP: 0x00, MAIN_CTRL: 0x40, SOF_WR: 0x44, SOF_RD: 0x48, SIE_CTRL: 0x4c, SIE_STATUS: 0x50, INT_EP_CTRL: 0x54,
  BUFF_STATUS: 0x58, BUFF_CPU_SHOULD_HANDLE: 0x5c, EP_ABORT: 0x60, EP_ABORT_DONE: 0x64, EP_STALL_ARM: 0x68, NAK_POLL: 0x6c,
  EP_STATUS_STALL_NAK: 0x70, USB_MUXING: 0x74, USB_PWR: 0x78, USBPHY_DIRECT: 0x7c, USBPHY_DIRECT_OVERRIDE: 0x80,
  USBPHY_TRIM: 0x84, INTR: 0x8c, INTE: 0x90, INTF: 0x94, INTS: 0x98,
});

/** SIE_STATUS. */
export const Sie = Object.freeze({
  SEQ_ERROR: 0x80000000 | 0, ACK_REC: 1 << 30, STALL_REC: 1 << 29, RX_TIMEOUT: 1 << 27, RX_OVERFLOW: 1 << 26,
  BIT_STUFF_ERROR: 1 << 25, CRC_ERROR: 1 << 24, BUS_RESET: 1 << 19, TRANS_COMPLETE: 1 << 18, SETUP: 1 << 17,
  CONNECTED: 1 << 16, RESUME: 1 << 11, SPEED: 3 << 8, SUSPENDED: 1 << 4, LINE_STATE_LSB: 2, VBUS: 1 << 0,
});

/** INTR, INTE, INTF and INTS. */
export const Interrupt = Object.freeze({
  EP_STALL_NAK: 1 << 19, ABORT_DONE: 1 << 18, SOF: 1 << 17, SETUP: 1 << 16, RESUME: 1 << 15, SUSPEND: 1 << 14,
  CONN: 1 << 13, BUS_RESET: 1 << 12, VBUS: 1 << 11, STALL: 1 << 10, CRC: 1 << 9, BIT_STUFF: 1 << 8, RX_OVERFLOW: 1 << 7,
  RX_TIMEOUT: 1 << 6, SEQ_ERROR: 1 << 5, BUFF_STATUS: 1 << 4, TRANS_COMPLETE: 1 << 3,
});

/** Interrupts that are up as long as a bit of SIE_STATUS is. */
export const LEVEL_INTERRUPTS = [
  [Sie.SETUP, Interrupt.SETUP], [Sie.RESUME, Interrupt.RESUME], [Sie.BUS_RESET, Interrupt.BUS_RESET],
  [Sie.VBUS, Interrupt.VBUS], [Sie.STALL_REC, Interrupt.STALL], [Sie.CRC_ERROR, Interrupt.CRC],
  [Sie.BIT_STUFF_ERROR, Interrupt.BIT_STUFF], [Sie.RX_OVERFLOW, Interrupt.RX_OVERFLOW],
  [Sie.RX_TIMEOUT, Interrupt.RX_TIMEOUT], [Sie.SEQ_ERROR, Interrupt.SEQ_ERROR],
  [Sie.TRANS_COMPLETE, Interrupt.TRANS_COMPLETE],
];

const ALL = 0xffffffff;
const INTERRUPTS = 0x000fffff;
/**
 * By offset: `rw` can be written, `wc` clears by a 1, `sc` clears itself, `told` is read only but a 1 tells the controller that
 * a change was seen, `reset` is not 0. All other bits are read only or reserved.
 */
const TABLE = new Map([
  [Register.ADDR_ENDP, { name: 'ADDR_ENDP', rw: 0x000f007f }],
  ...Array.from({ length: 15 }, (_, n) => [4 * (n + 1), { name: `ADDR_ENDP${n + 1}`, rw: 0x060f007f }]),
  [Register.MAIN_CTRL, { name: 'MAIN_CTRL', rw: 0x80000003 }],
  [Register.SOF_WR, { name: 'SOF_WR', sc: 0x7ff }],
  [Register.SOF_RD, { name: 'SOF_RD' }],
  [Register.SIE_CTRL, { name: 'SIE_CTRL', rw: 0xff078f4e, sc: 0x00003011 }],
  [Register.SIE_STATUS, { name: 'SIE_STATUS', wc: 0xff0e0800, told: Sie.CONNECTED | Sie.SPEED | Sie.SUSPENDED }],
  [Register.INT_EP_CTRL, { name: 'INT_EP_CTRL', rw: 0xfffe }],
  [Register.BUFF_STATUS, { name: 'BUFF_STATUS', wc: ALL }],
  [Register.BUFF_CPU_SHOULD_HANDLE, { name: 'BUFF_CPU_SHOULD_HANDLE' }],
  [Register.EP_ABORT, { name: 'EP_ABORT', rw: ALL }],
  [Register.EP_ABORT_DONE, { name: 'EP_ABORT_DONE', wc: ALL }],
  [Register.EP_STALL_ARM, { name: 'EP_STALL_ARM', rw: 3 }],
  [Register.NAK_POLL, { name: 'NAK_POLL', rw: 0x03ff03ff, reset: 0x00100010 }],
  [Register.EP_STATUS_STALL_NAK, { name: 'EP_STATUS_STALL_NAK', wc: ALL }],
  [Register.USB_MUXING, { name: 'USB_MUXING', rw: 0xf }],
  [Register.USB_PWR, { name: 'USB_PWR', rw: 0x3f }],
  [Register.USBPHY_DIRECT, { name: 'USBPHY_DIRECT', rw: 0x0000ff77 }],
  [Register.USBPHY_DIRECT_OVERRIDE, { name: 'USBPHY_DIRECT_OVERRIDE', rw: 0x00009fff }],
  [Register.USBPHY_TRIM, { name: 'USBPHY_TRIM', rw: 0x00001f1f, reset: 0x00001f1f }],
  [Register.INTR, { name: 'INTR' }],
  [Register.INTE, { name: 'INTE', rw: INTERRUPTS }],
  [Register.INTF, { name: 'INTF', rw: INTERRUPTS }],
  [Register.INTS, { name: 'INTS' }],
]);

/** Of the two address bits that select an alias (datasheet 2.1.2). */
export const Alias = Object.freeze({ NORMAL: 0, XOR: 1, SET: 2, CLEAR: 3 });

/** Name -> [offset, bits that may be written], for the table of all blocks. */
export const USB_REGISTERS = Object.fromEntries([...TABLE].map(([offset, { name, rw = 0, wc = 0, sc = 0, told = 0 }]) =>
  [name, [offset, (rw | wc | sc | told) >>> 0]]));

/** The storage of the writable bits, and what a write does by the table; the bus has seen to it that there is such a register. */
export class UsbRegisters {
  #values = new Map();
  #note;

  /** @param {(text: string) => void} note told of what the register text does not allow */
  constructor(note) {
    this.#note = note;
  }

  reset() {
    this.#values.clear();
  }

  get(offset) {
    return this.#values.get(offset) ?? TABLE.get(offset)?.reset ?? 0;
  }

  set(offset, value) {
    this.#values.set(offset, value >>> 0);
  }

  /** @returns {{cleared: number, told: number, once: number}} the 1s written to bits that clear by it, tell, or clear themselves */
  write(offset, ones, alias) {
    const { name, rw = 0, wc = 0, sc = 0, told = 0 } = TABLE.get(offset);
    if (ones & wc && (alias === Alias.XOR || alias === Alias.SET)) {
      this.#note(`${name}, whose bits clear by a 1, written through the alias that sets or flips`);
    }
    const old = this.get(offset);
    const after = { [Alias.NORMAL]: ones, [Alias.XOR]: old ^ ones, [Alias.SET]: old | ones, [Alias.CLEAR]: old & ~ones }[alias];
    if (rw !== 0) this.set(offset, after & rw);
    return { cleared: ones & wc, told: ones & told, once: alias === Alias.CLEAR ? 0 : ones & sc };
  }
}
