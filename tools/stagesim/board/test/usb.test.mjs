// SPDX-License-Identifier: MIT
// The USB controller as a program sees it, with transactions as a host would send them.
import assert from 'node:assert/strict';
import { beforeEach, describe, test } from 'node:test';
import { Handshake } from '../chip/usb_controller.mjs';
import { UsbHost } from '../usb/usb_host.mjs';
import { BulkInTransfer, BulkOutTransfer, ControlTransfer, Status } from '../usb/usb_transfer.mjs';
import { Bench } from './bench.mjs';

import { AVAILABLE, BUFF_STATUS, DATA1, EP0_IN, EP1_OUT, EP2_IN, FULL, INTE, INTR, INTS, RAM, SIE_CTRL, SIE_STATUS, STALL, STALL_ARM,
         attachUsb, give } from './usb_bench.mjs';

describe('the controller', () => {
  let b;
  let usb;

  beforeEach(() => {
    b = new Bench();
    usb = attachUsb(b);
    b.write(RAM + 0x0c, 0xa0000180 | 0); // endpoint 1 OUT: enabled, interrupt for each buffer, at 0x180
    b.write(RAM + 0x10, 0xa00001c0 | 0); // endpoint 2 IN, at 0x1c0
  });

  test('answers NAK until the program hands over a buffer, and reports it done only after the host has it', () => {
    assert.equal(usb.in(2).handshake, Handshake.NAK);
    b.write(RAM + 0x1c0, 0x64636261);
    give(b, EP2_IN, FULL | 4);
    assert.equal(b.read(BUFF_STATUS), 0);
    const { handshake, packet, data1 } = usb.in(2);
    assert.deepEqual([handshake, Buffer.from(packet).toString(), data1], [Handshake.ACK, 'abcd', false]);
    assert.equal(b.read(BUFF_STATUS), 1 << 4);
    assert.equal(b.read(EP2_IN) & (FULL | AVAILABLE), 0);
    assert.equal(usb.in(2).handshake, Handshake.NAK);
    b.write(BUFF_STATUS, 1 << 4);
    assert.equal(b.read(BUFF_STATUS), 0);
  });

  test('takes an OUT packet with its length, and drops one with the wrong toggle with an error flag', () => {
    give(b, EP1_OUT, 64);
    assert.equal(usb.out(1, Uint8Array.of(9), true).handshake, Handshake.ACK);
    assert.equal(b.read(SIE_STATUS) >>> 31, 1);
    assert.equal(b.read(BUFF_STATUS), 0);
    usb.out(1, Uint8Array.of(5, 6, 7), false);
    assert.equal(b.read(EP1_OUT) & 0x3ff, 3);
    assert.equal(b.read(EP1_OUT) & (FULL | AVAILABLE), FULL);
    assert.equal(b.read(RAM + 0x180) & 0xffffff, 0x070605);
    assert.equal(b.read(BUFF_STATUS), 1 << 3);
  });

  test('two buffers take turns', () => {
    b.write(RAM + 0x0c, 0xe0000180 | 0);
    give(b, EP1_OUT, ((DATA1 | 64) << 16) | 64, (AVAILABLE << 16) | AVAILABLE);
    usb.out(1, Uint8Array.of(1), false);
    usb.out(1, Uint8Array.of(2, 2), true);
    assert.equal(usb.out(1, Uint8Array.of(3), false).handshake, Handshake.NAK);
    assert.deepEqual([b.read(EP1_OUT) & 0x3ff, (b.read(EP1_OUT) >>> 16) & 0x3ff], [1, 2]);
    assert.equal(b.read(RAM + 0x1c0) & 0xffff, 0x0202);
  });

  test('stalls when told, endpoint 0 only when armed, until the next setup', () => {
    b.write(EP2_IN, STALL);
    assert.equal(usb.in(2).handshake, Handshake.STALL);
    b.write(EP0_IN, STALL);
    assert.equal(usb.in(0).handshake, Handshake.NAK);
    b.write(STALL_ARM, 1);
    assert.equal(usb.in(0).handshake, Handshake.STALL);
    usb.setup(new Uint8Array(8));
    assert.equal(usb.in(0).handshake, Handshake.NAK);
    assert.equal((b.read(SIE_STATUS) >> 17) & 1, 1);
  });

  test('is silent without pull-up, and tells of reset and suspend by interrupts that clear by their status bits', () => {
    b.write(INTE, (1 << 12) | (1 << 14));
    usb.beginReset();
    assert.equal(b.read(INTS), 1 << 12);
    b.write(SIE_STATUS, 1 << 19);
    assert.equal(b.read(INTS), 0);
    usb.endReset();
    b.run(101_000);
    usb.suspend();
    assert.equal(b.read(INTS), 1 << 14);
    assert.equal((b.read(SIE_STATUS) >> 4) & 1, 1);
    b.write(SIE_STATUS, 1 << 4);
    assert.equal(b.read(INTS), 0);
    b.write(SIE_CTRL, 1 << 29);
    assert.equal(usb.in(2).handshake, Handshake.SILENT);
    assert.equal(usb.setup(new Uint8Array(8)), Handshake.SILENT);
  });

  test('an unplugged cable suspends the bus after 3 ms', () => {
    const host = new UsbHost(b.chip.clock, usb, () => {});
    host.plug();
    host.unplug();
    b.run(3 * 125_000 - 10);
    assert.equal((b.read(SIE_STATUS) >> 4) & 1, 0);
    b.run(20);
    assert.equal((b.read(SIE_STATUS) >> 4) & 1, 1);
    assert.equal(host.active, false);
  });
});

/** Lets `transfer` talk to a device that takes all and sends `packets`; returns the tokens' sizes and the status. */
function converse(transfer, packets = []) {
  const tokens = [];
  for (let data1 = transfer instanceof ControlTransfer; tokens.length < 100;) {
    const token = transfer.token();
    tokens.push(token.setup ? 'setup' : token.out ? token.out.length : 'in');
    const answer = { handshake: Handshake.ACK };
    if (tokens.at(-1) === 'in') {
      answer.packet = packets.shift() ?? new Uint8Array(0);
      answer.data1 = data1;
      data1 = !data1;
    }
    const status = transfer.answered(answer);
    if (status !== null) return { tokens, status };
  }
  throw new Error('the transfer does not end');
}

describe('transfers', () => {
  const bytes = (count) => new Uint8Array(count).fill(7);

  test('bulk out is cut into full packets and the rest', () => {
    for (const [size, packets] of [[0, [0]], [1, [1]], [64, [64]], [65, [64, 1]], [200, [64, 64, 64, 8]]]) {
      const { tokens, status } = converse(new BulkOutTransfer(1, bytes(size), { data1: false }, 64));
      assert.deepEqual([tokens, status], [packets, Status.OK]);
    }
  });

  test('bulk in ends with a short packet, an empty one, or a full buffer; too much is an overflow', () => {
    const run = (capacity, ...sizes) => {
      const transfer = new BulkInTransfer(2, capacity, { data1: false }, 64);
      const { tokens, status } = converse(transfer, sizes.map(bytes));
      return [tokens.length, status, transfer.bytes.length];
    };
    assert.deepEqual(run(640, 64, 64, 3), [3, Status.OK, 131]);
    assert.deepEqual(run(640, 64, 0), [2, Status.OK, 64]);
    assert.deepEqual(run(128, 64, 64, 64), [2, Status.OK, 128]);
    assert.deepEqual(run(100, 64, 64).slice(0, 2), [2, Status.OVERFLOW]);
  });

  test('toggles alternate over transfers', () => {
    const toggle = { data1: false };
    converse(new BulkOutTransfer(1, bytes(130), toggle, 64));
    assert.equal(toggle.data1, true);
    assert.equal(new BulkOutTransfer(1, bytes(1), toggle, 64).token().data1, true);
  });

  test('a control transfer has a setup, its data, and a status the other way', () => {
    const read = new ControlTransfer(Uint8Array.of(0x80, 6, 0, 1, 0, 0, 70, 0));
    assert.deepEqual(converse(read, [bytes(64), bytes(6)]), { tokens: ['setup', 'in', 'in', 0], status: Status.OK });
    assert.equal(read.bytes.length, 70);
    const short = new ControlTransfer(Uint8Array.of(0x80, 6, 0, 1, 0, 0, 255, 0));
    assert.deepEqual(converse(short, [bytes(18)]).tokens, ['setup', 'in', 0]);
    const none = new ControlTransfer(Uint8Array.of(0, 5, 1, 0, 0, 0, 0, 0));
    assert.deepEqual(converse(none).tokens, ['setup', 'in']);
    const write = new ControlTransfer(Uint8Array.of(0x40, 1, 0, 0, 0, 0, 70, 0), bytes(70));
    assert.deepEqual(converse(write).tokens, ['setup', 64, 6, 'in']);
  });

  test('a packet with the wrong toggle is dropped as a repetition', () => {
    const transfer = new BulkInTransfer(2, 64, { data1: false }, 64);
    assert.equal(transfer.answered({ handshake: Handshake.ACK, packet: bytes(5), data1: true }), null);
    assert.equal(transfer.answered({ handshake: Handshake.ACK, packet: bytes(3), data1: false }), Status.OK);
    assert.equal(transfer.bytes.length, 3);
  });
});
