// SPDX-License-Identifier: MIT
// The CAN controller against the tables and figures of its datasheet (DS20001801J), and the bus against CAN 2.0.
import assert from 'node:assert/strict';
import { beforeEach, describe, test } from 'node:test';
import { CanBus } from '../can/can_bus.mjs';
import { arbitration, decodeFrame, encodeFrame, frameBits, wireBits } from '../can/can_frame.mjs';
import { Mcp2515 } from '../can/mcp2515.mjs';
import { Bench } from './bench.mjs';

const frame = (id, bytes, more = {}) =>
  ({ id, extended: false, remote: false, length: bytes.length, data: Uint8Array.from(bytes), ...more });

/** A node that sends what it is given and keeps what it hears. */
class Peer {
  constructor(bus, bitRate = bus.bitRate) {
    Object.assign(this, { bus, bitRate, queue: [], heard: [], failures: [], acknowledges: true, errorPassive: false });
    bus.add(this);
  }
  put(one) { this.queue.push(one); this.bus.kick(); }
  next() { return this.queue[0] ?? null; }
  sent() { this.queue.shift(); this.bus.kick(); }
  lost() {}
  failed(sending, kind) { this.failures.push(kind); this.bus.kick(); }
  received(one) { this.heard.push(one); return this.acknowledges; }
}

describe('frames on the wire', () => {
  test('fields stand where CAN 2.0 has them, and with its CRC a frame is a multiple of the generator polynomial (3.1.1)', () => {
    const standard = frameBits(frame(0x14, [0x01])).join('');
    assert.equal(standard.slice(0, -15), '0' + '00000010100' + '000' + '0001' + '00000001');
    const extended = frameBits(frame(0x15555554, [], { extended: true, remote: true, length: 2 })).join('');
    assert.equal(extended.slice(0, -15), '0' + '10101010101' + '11' + '010101010101010100' + '100' + '0010');
    for (const bits of [standard, extended]) {
      let rest = BigInt(`0b${bits}`);
      for (let n = bits.length - 16; n >= 0; n--) if (rest >> BigInt(n + 15) & 1n) rest ^= 0xc599n << BigInt(n);
      assert.equal(rest, 0n);
    }
  });
  test('lengths between the least, without stuffing, and the most that stuffing can add', () => {
    let least = Infinity;
    let most = 0;
    for (let n = 0; n < 3000; n++) {
      const bytes = Array.from({ length: 8 }, (_, k) => (n * 7919 * (k + 3)) >> 3 & 0xff);
      const bits = wireBits(frame(n % 2048, bytes));
      [least, most] = [Math.min(least, bits), Math.max(most, bits)];
    }
    assert.ok(least >= 108 && most <= 108 + 24, `${least} to ${most}`); // floor((98 - 1) / 4) stuff bits at most
    assert.ok(least < most);
  });
  test('every five equal bits take a stuff bit', () => {
    const zeros = frameBits(frame(0, [])).join('').match(/^0*/)[0].length; // all but the CRC and DLC are 0
    assert.equal(zeros, 34); // SOF, identifier, RTR, IDE, r0, DLC and a CRC that is 0, too
    assert.equal(wireBits(frame(0, [])), 34 + 6 + 10);
  });
  test('arbitration: lower identifiers, data before remote, standard before extended of the same base', () => {
    const order = [frame(0x100, []), frame(0x100, [], { remote: true }), frame(0x100 * 2 ** 18, [], { extended: true }),
                   frame(0x100 * 2 ** 18 + 1, [], { extended: true }), frame(0x101, [])];
    const values = order.map(arbitration);
    assert.deepEqual(values, [...values].sort((a, b) => a - b));
    assert.equal(new Set(values).size, values.length);
  });
  test('records are those of struct can_frame', () => {
    const record = encodeFrame(frame(0x1abcdef, [1, 2], { extended: true }));
    assert.equal(record.toString('hex'), 'efcdab81' + '02000000' + '0102000000000000');
    assert.deepEqual(decodeFrame(record), frame(0x1abcdef, [1, 2], { extended: true }));
    assert.equal(decodeFrame(Buffer.from('0000002000000000' + '00'.repeat(8), 'hex')), 'error');
    assert.equal(decodeFrame(Buffer.from('0001000009000000' + '00'.repeat(8), 'hex')), undefined);
  });
});

describe('the controller', () => {
  let bus;
  let clock;
  let chip;
  let peer;
  let interrupts;

  const spi = (...bytes) => {
    chip.select(true);
    const answers = bytes.map((byte) => chip.exchange(byte));
    chip.select(false);
    return answers;
  };
  const read = (address) => spi(0x03, address, 0)[2];
  const write = (address, ...values) => spi(0x02, address, ...values);
  const pass = (us) => clock.tick(us * 1000);
  /** 1 Mbit/s, everything accepted, all interrupts but MERRE enabled. */
  const join = () => {
    write(0x28, 0x01, 0x91, 0x00, 0x3f);
    write(0x60, 0x64);
    write(0x70, 0x60);
    write(0x0f, 0x00);
  };

  beforeEach(() => {
    bus = new CanBus(1_000_000);
    clock = new Bench().chip.clock;
    chip = new Mcp2515(bus);
    peer = new Peer(bus);
    interrupts = [];
    chip.onInterrupt = (level) => interrupts.push(level);
    bus.attach(clock);
    chip.attach(clock);
  });

  test('after reset: configuration mode, and as table 11-2 has it', () => {
    join();
    spi(0xc0);
    assert.deepEqual([0x0e, 0x0f, 0x1c, 0x1d, 0x2b, 0x2c, 0x2d].map(read), [0x80, 0x87, 0, 0, 0, 0, 0]);
    assert.equal(read(0x7e), 0x80, 'CANSTAT is in every row');
  });
  test('bit timing and filters are written in configuration mode only, and filters read 0 elsewhere', () => {
    write(0x28, 0xff, 0x91, 0x03);
    assert.deepEqual([0x28, 0x29, 0x2a].map(read), [0xc7, 0x91, 0x03]);
    write(0x00, 0x12, 0xff);
    assert.deepEqual([read(0x00), read(0x01)], [0x12, 0xeb]);
    write(0x0f, 0x00);
    write(0x2a, 0x05);
    assert.equal(read(0x2a), 0x03);
    assert.equal(read(0x00), 0);
  });
  test('bit modify changes the bits of its mask, and whole bytes of registers that have no bits of their own', () => {
    write(0x2b, 0b0101_0001);
    spi(0x05, 0x2b, 0b0011_0011, 0b1110_0010);
    assert.equal(read(0x2b), 0b0110_0010); // figure 12-1's rule
    write(0x36, 0x55);
    spi(0x05, 0x36, 0x0f, 0xaa);
    assert.equal(read(0x36), 0xaa);
  });
  test('bit rates follow from oscillator, prescaler and segments (chapter 5)', () => {
    // 8 quanta of 125 and 250 ns, with the propagation segment's share of 2 or 4; 16 of 125 ns; 16 of 500 ns, which section 5 has as its example at 125 kbit/s
    for (const [cnf1, cnf2, cnf3, rate] of [[0x00, 0x91, 0x01, 1e6], [0x00, 0x83, 0x01, 1e6], [0x01, 0x91, 0x01, 5e5], [0x00, 0xbb, 0x02, 5e5],
                                            [0x03, 0xb1, 0x05, 125e3]]) {
      write(0x0f, 0x80);
      write(0x28, cnf3, cnf2, cnf1);
      write(0x0f, 0x00);
      assert.equal(chip.bitRate, rate);
    }
  });
  test('the segments of a bit are those of registers 5-1 to 5-3', () => {
    write(0x0f, 0x80);
    write(0x28, 0x01, 0x83, 0x40);
    assert.deepEqual(chip.bitTiming, { quantum_ns: 125, jump: 2, propagation: 4, phase1: 1, phase2: 2 });
    write(0x28, 0x02, 0xbb, 0x01);
    assert.deepEqual(chip.bitTiming, { quantum_ns: 250, jump: 1, propagation: 4, phase1: 8, phase2: 3 });
    write(0x28, 0x02, 0x3b, 0x01);
    assert.equal(chip.bitTiming.phase2, 8, 'as phase 1 without BTLMODE');
  });
  test('a frame is sent from a buffer and takes its bits on the bus', () => {
    join();
    spi(0x40, 0x600 >> 3, 0, 0, 0, 3, 1, 2, 3);
    spi(0x81);
    assert.equal(spi(0xa0, 0)[1], 0x04, 'TXREQ of buffer 0');
    const bits = wireBits(frame(0x600, [1, 2, 3]));
    pass(bits - 1);
    assert.deepEqual(peer.heard, []);
    pass(1);
    assert.deepEqual(peer.heard, [frame(0x600, [1, 2, 3])]);
    assert.equal(spi(0xa0, 0)[1], 0x08, 'TX0IF');
    assert.deepEqual(interrupts, [false]);
    spi(0x05, 0x2c, 0x04, 0);
    assert.deepEqual(interrupts, [false, true]);
  });
  test('the highest priority goes first, and among equals the highest buffer (3.3)', () => {
    join();
    for (const [n, priority] of [[0, 1], [1, 0], [2, 1]]) {
      spi(0x40 + 2 * n, 0x10 + n, 0, 0, 0, 0);
      write(0x30 + 0x10 * n, priority);
    }
    spi(0x87);
    pass(1000);
    assert.deepEqual(peer.heard.map(({ id }) => id >> 3), [0x12, 0x10, 0x11]);
  });
  test('a pending buffer is not written, an aborted one is not sent', () => {
    join();
    peer.put(frame(0x001, [0, 0, 0, 0, 0, 0, 0, 0]));
    pass(1);
    spi(0x40, 0x20, 0, 0, 0, 1, 7);
    spi(0x81);
    write(0x36, 9);
    assert.equal(read(0x36), 7);
    spi(0x05, 0x0f, 0x10, 0x10); // ABAT
    assert.equal(read(0x30), 0x40, 'ABTF and no TXREQ');
    pass(1000);
    assert.deepEqual(peer.heard, []);
  });
  test('two buffers hold two frames in order; a third is an overflow and the first two stay (figure 4-3)', () => {
    join();
    for (const id of [0x111, 0x222, 0x333]) peer.put(frame(id, [id >> 8]));
    pass(400);
    assert.equal(read(0x2c) & 3, 3);
    assert.equal(read(0x2d), 0x80, 'RX1OVR');
    assert.equal(read(0x0e) >> 1 & 7, 1, 'ICOD: error');
    assert.deepEqual(spi(0x90, 0, 0, 0, 0, 0, 0).slice(1), [0x22, 0x20, 0, 0, 1, 1]);
    assert.equal(read(0x2c) & 3, 2, 'reading a buffer through its shortcut frees it');
    assert.deepEqual(spi(0x94, 0, 0, 0, 0, 0, 0).slice(1), [0x44, 0x40, 0, 0, 1, 2]);
    spi(0x05, 0x2d, 0xc0, 0);
    assert.equal(read(0x2d), 0);
  });
  test('without rollover the second frame is an overflow of buffer 0', () => {
    join();
    write(0x60, 0x60);
    peer.put(frame(1, []));
    peer.put(frame(2, []));
    pass(300);
    assert.deepEqual([read(0x2c) & 3, read(0x2d)], [1, 0x40]);
  });
  test('filters: each buffer has its mask, data bytes of standard frames count, status tells the filter (4.5)', () => {
    write(0x20, 0xff, 0xe0, 0xff, 0); // buffer 0: identifier and first data byte
    write(0x24, 0xf0, 0, 0, 0); // buffer 1: the upper four bits
    write(0x04, 0x600 >> 3, 0, 0x42, 0); // filter 1
    write(0x14, 0x200 >> 3); // filter 4
    write(0x08, 0x7f8 >> 3, 0x08); // filter 2: extended
    for (const address of [0x00, 0x10, 0x18]) write(address, 0x33);
    join();
    write(0x60, 0x04);
    write(0x70, 0x00);
    for (const one of [frame(0x600, [0x41]), frame(0x7f8, [1]), frame(0x600, [0x42]), frame(0x205, [])]) peer.put(one);
    pass(500);
    assert.equal(read(0x2c) & 3, 3);
    assert.deepEqual([read(0x60) & 1, read(0x66)], [1, 0x42]);
    assert.deepEqual([read(0x70) & 7, read(0x71)], [4, 0x40]);
    assert.equal(spi(0xb0, 0)[1], 0b11_0_0_0_001);
    assert.equal(read(0x2d), 0);
  });
  test('alone on a bus it becomes error passive but never leaves (CAN 2.0, 8., exception 1)', () => {
    join();
    bus.remove(peer);
    spi(0x40, 1, 0, 0, 0, 0);
    spi(0x81);
    pass(20_000);
    assert.equal(read(0x1c), 128);
    assert.equal(read(0x2d) & 0x3f, 0x15, 'TXEP, TXWAR, EWARN');
    bus.add(peer);
    pass(200);
    assert.equal(peer.heard.length, 1);
    assert.equal(read(0x1c), 127);
  });
  test('32 broken frames are bus-off; after 128 times 11 bits it comes back and sends (6.)', () => {
    join();
    bus.breakFrames(32);
    spi(0x40, 1, 0, 0, 0, 0);
    spi(0x81);
    while (!(read(0x2d) & 0x20)) pass(1);
    assert.equal(peer.heard.length, 0);
    pass(1407);
    assert.equal(read(0x2d) & 0x20, 0x20);
    pass(2);
    assert.equal(read(0x2d), 0);
    pass(100);
    assert.equal(peer.heard.length, 1);
  });
  test('one-shot mode does not send again, loop-back hears itself, listen-only is silent', () => {
    join();
    peer.acknowledges = false;
    write(0x0f, 0x08);
    spi(0x40, 1, 0, 0, 0, 0);
    spi(0x81);
    pass(500);
    assert.equal(read(0x30) & 0x18, 0x10, 'TXERR and no TXREQ');
    write(0x0f, 0x40);
    spi(0x42, 0x33, 0, 0, 0, 1, 0x77);
    spi(0x82);
    write(0x0f, 0x40);
    assert.deepEqual([read(0x61), read(0x66)], [0x33, 0x77]);
    write(0x0f, 0x60);
    const other = new Peer(bus);
    other.acknowledges = false;
    peer.put(frame(5, []));
    pass(300);
    assert.ok(peer.failures.includes('ack'), 'nobody acknowledged');
  });
  test('a lost arbitration is flagged and sent next', () => {
    join();
    peer.put(frame(0x7ff, [])); // keeps the bus busy while both get ready
    pass(1);
    peer.put(frame(0x001, []));
    spi(0x40, 0x40, 0, 0, 0, 0);
    spi(0x81);
    pass(115);
    assert.equal(read(0x30) & 0x28, 0x28, 'MLOA while pending');
    pass(100);
    assert.deepEqual(peer.heard.map(({ id }) => id), [0x200]);
  });
  test('at another bit rate it understands nothing and drives the bus into errors', () => {
    write(0x28, 0x01, 0x91, 0x01);
    write(0x60, 0x64);
    write(0x0f, 0x00); // 500 kbit/s
    peer.acknowledges = true;
    const third = new Peer(bus);
    peer.put(frame(1, [1]));
    pass(200);
    assert.equal(third.heard.length, 1);
    assert.equal(read(0x2c) & 1, 0);
    assert.equal(read(0x1d), 1);
    spi(0x40, 1, 0, 0, 0, 0);
    spi(0x81);
    for (let us = 0; us < 5000 && !(read(0x2d) & 0x20); us++) pass(1);
    assert.equal(read(0x2d) & 0x20, 0x20, 'bus-off');
    assert.equal(third.heard.length, 1);
    assert.equal(third.failures.length, 32);
  });
});
