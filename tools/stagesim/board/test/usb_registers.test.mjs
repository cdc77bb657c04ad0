// SPDX-License-Identifier: MIT
// The USB controller against its register text (RP2040 datasheet 4.1.4 and 4.1.2.5, appendix B), and what it does not forgive.
import assert from 'node:assert/strict';
import { beforeEach, describe, test } from 'node:test';
import { Handshake } from '../chip/usb_controller.mjs';
import { UsbHost } from '../usb/usb_host.mjs';
import { Bench } from './bench.mjs';
import { ADDR_ENDP, AVAILABLE, BUFF_STATUS, CONNECTED, CYCLES_PER_US, DATA1, EP0_IN, EP1_OUT, EP2_IN, EP_ABORT, EP_ABORT_DONE, FULL,
         INTE, INTR, INTS, MAIN_CTRL, MUXING, PHY_DIRECT, PHY_OVERRIDE, RAM, SIE_CTRL, SIE_STATUS, SOF_RD, STALL, STALL_ARM, SUSPENDED,
         attachUsb, give } from './usb_bench.mjs';

const REGS = 0x50110000;
const [SET, CLEAR] = [0x2000, 0x3000];
const DEV_SUSPEND = 1 << 14;
const DEV_CONN_DIS = 1 << 13;
const RX_TIMEOUT = 1 << 27;
const RESUME = 1 << 11;
const GPIO15_CTRL = 0x4001407c;

let b;
let usb;

function build(options) {
  b = new Bench(options);
  usb = attachUsb(b);
  b.write(RAM + 0x0c, 0xa8000180 | 0); // endpoint 1 OUT: enabled, an interrupt for each buffer, bulk, at 0x180
  b.write(RAM + 0x10, 0xa80001c0 | 0); // endpoint 2 IN, at 0x1c0
}

beforeEach(() => build());

const violations = () => b.violations.list;
const forgiven = () => assert.deepEqual(violations(), []);
const blamed = (pattern) => {
  assert.equal(violations().length, 1, violations().join('\n'));
  assert.match(violations()[0], pattern);
};

describe('the register text', () => {
  test('reset values are 0 but for NAK_POLL and USBPHY_TRIM', () => {
    const chip = new Bench();
    for (let offset = 0; offset <= 0x98; offset += 4) {
      if (offset === 0x88) continue; // no register
      const expected = { 0x6c: 0x00100010, 0x84: 0x1f1f }[offset] ?? 0;
      assert.equal(chip.read(REGS + offset), expected, `offset ${offset.toString(16)}`);
    }
    assert.deepEqual(chip.violations.list, []);
  });

  test('writes keep to the writable bits, by every alias', () => {
    b.write(REGS + 0x6c, 0x03ff03ff);
    b.write(REGS + 0x6c + CLEAR, 0x000000ff);
    assert.equal(b.read(REGS + 0x6c), 0x03ff0300);
    b.write(ADDR_ENDP + SET, 0x7f);
    assert.equal(b.read(ADDR_ENDP), 0x7f);
    forgiven();
  });

  for (const [what, address, value] of [
    ['reserved bits', MAIN_CTRL, 0x11], ['read-only bits', SIE_STATUS, 1 << 2], ['a read-only register', SOF_RD, 1],
    ['INTR', INTR, 1 << 14], ['the reserved bits of the address', ADDR_ENDP, 0x80], ['bits of the PHY\'s status', PHY_DIRECT, 1 << 16],
  ]) {
    test(`a 1 written to ${what} is a violation and does nothing`, () => {
      const before = b.read(address);
      b.write(address, before | value);
      assert.equal(b.read(address), before);
      blamed(/4\.1\.4: USBCTRL .* are reserved or read only/);
    });
  }

  test('an offset without a register is a violation, to read and to write', () => {
    b.read(REGS + 0x88);
    b.write(REGS + 0x9c, 0);
    assert.equal(violations().length, 2);
  });

  test('self-clearing bits read 0', () => {
    b.write(SIE_CTRL + SET, 1 << 12);
    assert.equal((b.read(SIE_CTRL) >> 12) & 1, 0);
    forgiven();
  });

  test('bits that clear by a 1 are not for the alias that sets', () => {
    give(b, EP2_IN, FULL | 1);
    usb.in(2);
    b.write(BUFF_STATUS + SET, 1 << 4);
    blamed(/BUFF_STATUS.*alias/);
  });
});

describe('suspend and connection', () => {
  test('SUSPENDED only reads: writing it clears the interrupt of its change, and leaves the level', () => {
    b.write(INTE, DEV_SUSPEND);
    usb.suspend();
    assert.equal(b.read(INTS), DEV_SUSPEND);
    b.write(SIE_STATUS + CLEAR, SUSPENDED);
    assert.equal(b.read(INTS), 0);
    assert.equal(b.read(SIE_STATUS) & SUSPENDED, SUSPENDED);
    forgiven();
  });

  test('leaving a suspension by a bus reset raises the interrupt, too, with SUSPENDED reading 0', () => {
    usb.suspend();
    b.write(SIE_STATUS + CLEAR, SUSPENDED);
    usb.beginReset();
    assert.equal(b.read(INTR) & DEV_SUSPEND, DEV_SUSPEND);
    assert.equal(b.read(SIE_STATUS) & SUSPENDED, 0);
  });

  test('a resume of the host ends it with RESUME, a start of frame without', () => {
    usb.suspend();
    usb.resume();
    assert.equal(b.read(SIE_STATUS) & (SUSPENDED | RESUME), RESUME);
    b.write(SIE_STATUS, RESUME | SUSPENDED);
    usb.suspend();
    b.write(SIE_STATUS, SUSPENDED);
    usb.startOfFrame(5);
    assert.equal(b.read(SIE_STATUS) & (SUSPENDED | RESUME), 0);
    assert.equal(b.read(INTR) & DEV_SUSPEND, DEV_SUSPEND);
  });

  test('a bus reset leaves address and buffers to the program, and disconnects until 800 us of idle bus', () => {
    b.write(ADDR_ENDP, 9);
    give(b, EP1_OUT, 64);
    usb.beginReset();
    assert.equal((b.read(SIE_STATUS) >> 2) & 3, 0);
    b.run(10_000 * CYCLES_PER_US);
    usb.endReset();
    assert.equal((b.read(SIE_STATUS) >> 2) & 3, 1);
    b.run(799 * CYCLES_PER_US);
    assert.equal(usb.setup(new Uint8Array(8)), Handshake.SILENT);
    b.run(2 * CYCLES_PER_US);
    assert.equal(b.read(SIE_STATUS) & CONNECTED, CONNECTED);
    assert.equal(b.read(INTR) & DEV_CONN_DIS, DEV_CONN_DIS);
    assert.equal(b.read(ADDR_ENDP), 9);
    assert.equal(usb.out(1, Uint8Array.of(1), false).handshake, Handshake.ACK);
  });

  test('reading SOF_RD clears the interrupt of a start of frame', () => {
    usb.startOfFrame(77);
    assert.equal(b.read(INTR) & (1 << 17), 1 << 17);
    assert.equal(b.read(SOF_RD), 77);
    assert.equal(b.read(INTR) & (1 << 17), 0);
  });

  test('a reset puts every register back and leaves the bus, and keeps the memory', () => {
    b.write(INTE, DEV_SUSPEND);
    usb.suspend();
    usb.reset();
    assert.equal(usb.attached, false);
    for (const register of [MAIN_CTRL, SIE_CTRL, INTE]) assert.equal(b.read(register), 0);
    assert.equal(b.read(SIE_STATUS) & ~1, 0, 'but for VBUS, which is there');
    assert.equal(b.read(RAM + 0x0c), 0xa8000180);
  });

  test('RESETS resets the controller', () => {
    b.write(0x4000c000 + CLEAR, 1 << 24);
    assert.equal(usb.attached, true);
    b.write(0x4000c000 + SET, 1 << 24);
    assert.equal(usb.attached, false);
  });
});

describe('buffers in two clock domains', () => {
  test('AVAILABLE in the same write as other fields is a violation, and the controller sees the old ones', () => {
    b.write(EP2_IN, FULL | AVAILABLE | 4);
    blamed(/4\.1\.2\.5\.1: USB: AVAILABLE was set in the same write/);
    assert.equal(usb.in(2).handshake, Handshake.NAK);
  });

  test('AVAILABLE less than a cycle of clk_usb after other fields is one, too', () => {
    b.write(EP2_IN, FULL | 4);
    b.run(1);
    b.write(EP2_IN, FULL | AVAILABLE | 4);
    blamed(/less than a cycle of clk_usb/);
    build();
    b.write(EP2_IN, FULL | 4);
    b.run(3);
    b.write(EP2_IN, FULL | AVAILABLE | 4);
    forgiven();
    assert.equal(usb.in(2).handshake, Handshake.ACK);
  });

  test('what the controller owns is not the program\'s: neither control, nor memory, nor the endpoint', () => {
    give(b, EP2_IN, FULL | 4);
    b.write(EP2_IN, FULL | DATA1 | 4);
    blamed(/buffer control was written while the controller owns/);
    build();
    give(b, EP2_IN, FULL | 4);
    b.write(RAM + 0x1c4, 1);
    blamed(/wrote to a buffer that the controller owns/);
    build();
    give(b, EP2_IN, FULL | 4);
    b.write(RAM + 0x10, 0xa8000200 | 0);
    blamed(/endpoint control was changed/);
  });

  test('EP_ABORT takes a buffer back: NAK meanwhile, and the program may write once EP_ABORT_DONE says so', () => {
    give(b, EP2_IN, FULL | 4);
    b.write(EP_ABORT + SET, 1 << 4);
    assert.equal(usb.in(2).handshake, Handshake.NAK);
    assert.equal(b.read(EP_ABORT_DONE), 1 << 4);
    b.write(EP2_IN, 0);
    b.write(EP_ABORT + CLEAR, 1 << 4);
    b.write(EP_ABORT_DONE + CLEAR, 1 << 4);
    assert.equal(b.read(EP_ABORT_DONE), 0);
    assert.equal(usb.in(2).handshake, Handshake.NAK);
    forgiven();
  });

  test('on B0 and B1 EP_ABORT is a violation, and writing the control is how a buffer is taken back', () => {
    build({ stepping: 'b1' });
    assert.equal(b.read(0x40000000) >>> 28, 1);
    give(b, EP2_IN, FULL | 4);
    b.write(EP2_IN, 0);
    forgiven();
    b.write(EP_ABORT, 1 << 4);
    blamed(/RP2040-E2/);
  });

  test('a setup packet keeps the buffers of endpoint 0 and ends its stall', () => {
    give(b, EP0_IN, FULL | DATA1 | 2);
    assert.equal(usb.setup(new Uint8Array(8)), Handshake.ACK);
    assert.equal(usb.in(0).handshake, Handshake.ACK);
    b.write(EP0_IN, STALL);
    b.write(STALL_ARM, 1);
    assert.equal(usb.in(0).handshake, Handshake.STALL);
    usb.setup(new Uint8Array(8));
    assert.equal(b.read(STALL_ARM), 0);
  });

  test('an OUT into a buffer that still says FULL is not taken', () => {
    give(b, EP1_OUT, FULL | 64);
    assert.equal(usb.out(1, Uint8Array.of(1), false).handshake, Handshake.NAK);
  });
});

describe('errata', () => {
  const frame = (number) => usb.startOfFrame(number);

  test('RP2040-E15: a bus error on a bulk IN armed in the last 200 us of a frame locks up until a reset', () => {
    frame(1);
    b.run(810 * CYCLES_PER_US);
    give(b, EP2_IN, FULL | 4);
    assert.equal(usb.in(2, true).handshake, Handshake.LOST);
    assert.equal(usb.in(2).handshake, Handshake.SILENT);
    assert.equal(usb.setup(new Uint8Array(8)), Handshake.SILENT);
    usb.beginReset();
    usb.endReset();
    b.run(900 * CYCLES_PER_US);
    assert.equal(usb.setup(new Uint8Array(8)), Handshake.SILENT, 'a bus reset is not enough');
    usb.reset();
    attachUsb(b);
    assert.equal(usb.setup(new Uint8Array(8)), Handshake.ACK);
  });

  test('a bus error on one that was armed earlier is flagged, and the packet offered again', () => {
    frame(1);
    b.run(790 * CYCLES_PER_US);
    give(b, EP2_IN, FULL | 4);
    b.run(300 * CYCLES_PER_US);
    frame(2);
    assert.equal(usb.in(2, true).handshake, Handshake.LOST);
    assert.equal(b.read(SIE_STATUS) & RX_TIMEOUT, RX_TIMEOUT | 0);
    assert.equal(b.read(BUFF_STATUS), 0);
    assert.equal(usb.in(2).packet.length, 4);
  });

  for (const stepping of ['b1', 'b2']) {
    test(`RP2040-E5: behind a busy hub ${stepping} ${stepping === 'b1' ? 'stays' : 'does not stay'} in reset`, () => {
      build({ stepping });
      usb.busyHub = true;
      usb.beginReset();
      usb.endReset();
      b.run(5000 * CYCLES_PER_US);
      assert.equal(usb.setup(new Uint8Array(8)), stepping === 'b1' ? Handshake.SILENT : Handshake.ACK);
    });
  }

  test('RP2040-E5: GPIO 15 forced high as D+ gives B1 its idle bus, while the PHY keeps the pull-up', () => {
    build({ stepping: 'b1' });
    usb.busyHub = true;
    usb.beginReset();
    usb.endReset();
    b.write(GPIO15_CTRL, (3 << 16) | (2 << 12) | 8);
    b.write(PHY_DIRECT, 2);
    b.write(PHY_OVERRIDE, 4);
    b.write(MUXING, 0xc);
    assert.equal(usb.attached, true);
    b.run(801 * CYCLES_PER_US);
    assert.equal(b.read(SIE_STATUS) & CONNECTED, CONNECTED);
    assert.equal(usb.setup(new Uint8Array(8)), Handshake.SILENT, 'away from the PHY');
    b.write(MUXING, 9);
    b.write(PHY_OVERRIDE, 0);
    b.write(GPIO15_CTRL, 31);
    assert.equal(usb.setup(new Uint8Array(8)), Handshake.ACK);
    forgiven();
  });
});

describe('the host', () => {
  test('tries a transaction that is not answered three times', () => {
    const told = [];
    const host = new UsbHost(b.chip.clock, usb, () => {});
    host.plug();
    b.run(130_000 * CYCLES_PER_US);
    assert.equal(b.read(SIE_STATUS) & (1 << 17), 1 << 17, 'it has asked for the descriptor');
    usb.lockUp();
    host.submit({ type: 'control', endpoint: 0, setup: new Uint8Array(8), timeout_us: 0, done: (status) => told.push(status) });
    b.run(400_000 * CYCLES_PER_US);
    assert.deepEqual(told, [-2]);
  });
});
