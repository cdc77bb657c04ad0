// SPDX-License-Identifier: MIT
// DMA against the text of RP2040 datasheet 2.5, register by register.
import assert from 'node:assert/strict';
import { test } from 'node:test';
import { Bench } from './bench.mjs';

const DMA = 0x50000000;
const MEMORY = 0x20010000;
const EN = 1;
const WORDS = 2 << 2;
const HALVES = 1 << 2;
const INCR = (1 << 4) | (1 << 5);
const QUIET = 1 << 21;
const BUSY = 1 << 24;
const UNPACED = 0x3f << 15;
const chainTo = (channel) => channel << 11;
const at = (channel, word) => DMA + 0x40 * channel + 4 * word;
const READ = 0, WRITE = 1, COUNT = 2, CTRL_TRIG = 3, AL1_CTRL = 4, AL1_COUNT_TRIG = 7, AL2_WRITE_TRIG = 11, AL3_READ_TRIG = 15;
const INTR = DMA + 0x400;
const INTE0 = DMA + 0x404;
const INTS0 = DMA + 0x40c;
const MULTI = DMA + 0x430;
const ABORT = DMA + 0x444;
const SET = 0x2000;

/** A bench with a channel that copies `words` from one place to another, not started unless `ctrl` has EN. */
function bench(channel, { count = 4, ctrl = EN | WORDS | INCR | UNPACED | chainTo(channel), from = MEMORY, to = MEMORY + 0x1000 } = {}) {
  const b = new Bench();
  for (let n = 0; n < 64; n++) b.write(MEMORY + 4 * n, 0x01020300 + n);
  b.write(at(channel, READ), from);
  b.write(at(channel, WRITE), to);
  b.write(at(channel, COUNT), count);
  b.write(at(channel, AL1_CTRL), ctrl);
  return b;
}

const violations = (b) => b.violations.list.length;
const busy = (b, channel) => (b.read(at(channel, AL1_CTRL)) & BUSY) !== 0;

test('each of the four trigger registers starts a channel, and its aliases do not', () => {
  for (const [word, value] of [[AL1_COUNT_TRIG, 4], [AL2_WRITE_TRIG, MEMORY + 0x1000], [AL3_READ_TRIG, MEMORY],
                               [CTRL_TRIG, EN | WORDS | INCR | UNPACED | chainTo(2)]]) {
    const b = bench(2);
    assert.equal(busy(b, 2), false);
    b.write(at(2, word), value);
    assert.equal(busy(b, 2), true);
    b.run(20);
    assert.deepEqual([busy(b, 2), b.read(MEMORY + 0x100c), b.read(at(2, COUNT))], [false, 0x01020303, 0]);
    assert.equal(violations(b), 0);
  }
});

test('zero in a trigger register starts nothing, and interrupts only in quiet mode (2.5.2.3)', () => {
  for (const quiet of [0, QUIET]) {
    const b = bench(2, { ctrl: EN | WORDS | UNPACED | chainTo(2) | quiet });
    b.write(at(2, AL3_READ_TRIG), 0);
    b.run(20);
    assert.deepEqual([busy(b, 2), b.read(INTR)], [false, quiet ? 4 : 0]);
  }
});

test('TRANS_COUNT is a reload value: each trigger transfers as many again', () => {
  const b = bench(1);
  for (let n = 1; n <= 3; n++) {
    b.write(MULTI, 2);
    b.run(20);
    assert.equal(b.read(at(1, READ)), MEMORY + 16 * n);
  }
  assert.equal(b.read(DMA + 0x844), 4, 'DBG_TCR');
});

test('without EN triggers are ignored, and a busy channel pauses with BUSY up (2.5.7)', () => {
  const b = bench(1, { count: 40, ctrl: WORDS | INCR | UNPACED | chainTo(1) });
  b.write(MULTI, 2);
  assert.equal(busy(b, 1), false);
  b.write(at(1, CTRL_TRIG), EN | WORDS | INCR | UNPACED | chainTo(1));
  b.run(10);
  b.write(at(1, AL1_CTRL), WORDS | INCR | UNPACED | chainTo(1));
  b.run(2);
  const left = b.read(at(1, COUNT));
  b.run(50);
  assert.deepEqual([busy(b, 1), b.read(at(1, COUNT))], [true, left]);
  assert.ok(left > 0 && left < 40);
  b.write(at(1, AL1_CTRL), EN | WORDS | INCR | UNPACED | chainTo(1));
  b.run(50);
  assert.deepEqual([busy(b, 1), b.read(at(1, COUNT)), violations(b)], [false, 0, 0]);
});

test('completion chains to what CHAIN_TO says then, and to nobody if that is the channel itself', () => {
  const b = bench(3, { count: 8, ctrl: EN | WORDS | INCR | UNPACED | chainTo(5) });
  b.write(at(5, READ), MEMORY);
  b.write(at(5, WRITE), MEMORY + 0x2000);
  b.write(at(5, COUNT), 1);
  b.write(at(5, AL1_CTRL), EN | WORDS | UNPACED | chainTo(5));
  b.write(MULTI, 1 << 3);
  b.run(40);
  assert.deepEqual([b.read(MEMORY + 0x2000), b.read(INTR)], [0x01020300, 0b101000]);
});

test('0 in CTRL chains to channel 0: a stopped channel that completes starts it', () => {
  const b = bench(3, { ctrl: EN | WORDS | INCR | UNPACED });
  b.write(at(0, READ), MEMORY);
  b.write(at(0, WRITE), MEMORY + 0x2000);
  b.write(at(0, COUNT), 1);
  b.write(at(0, AL1_CTRL), EN | WORDS | UNPACED);
  b.write(MULTI, 1 << 3);
  b.run(40);
  assert.equal(b.read(MEMORY + 0x2000), 0x01020300);
  assert.equal(b.read(at(7, AL1_CTRL)), chainTo(7), 'after reset to itself');
});

test('an abort leaves BUSY up until it is over, chains to nobody, and may interrupt after all (erratum E13)', () => {
  const b = bench(3, { count: 100, ctrl: EN | WORDS | INCR | UNPACED | chainTo(5) });
  b.write(at(5, COUNT), 1);
  b.write(at(5, AL1_CTRL), EN | WORDS | UNPACED | chainTo(5));
  b.write(MULTI, 1 << 3);
  b.run(10);
  b.write(ABORT, 1 << 3);
  assert.deepEqual([busy(b, 3), b.read(ABORT)], [true, 1 << 3]);
  b.run(20);
  assert.deepEqual([busy(b, 3), b.read(ABORT), busy(b, 5), b.read(INTR)], [false, 0, false, 1 << 3]);
  assert.equal(violations(b), 0);
});

test('a trigger of a busy channel is lost, and so is an address written meanwhile: both are violations', () => {
  const b = bench(3, { count: 100 });
  b.write(MULTI, 1 << 3);
  b.run(5);
  b.write(MULTI, 1 << 3);
  b.write(at(3, READ), MEMORY);
  b.write(at(3, AL1_CTRL), EN | WORDS | UNPACED | chainTo(3));
  assert.deepEqual(b.violations.list.map((text) => text.slice(0, 23)),
                   ['RP2040 datasheet 2.5.2:', 'RP2040 datasheet 2.5.1:', 'RP2040 datasheet 2.5.7:']);
});

test('an address that is not aligned is a bus error: the channel halts, says which, and interrupts even in quiet mode', () => {
  for (const [word, flag] of [[READ, 30], [WRITE, 29]]) {
    const b = bench(3, { ctrl: EN | HALVES | INCR | UNPACED | chainTo(3) | QUIET });
    b.write(at(3, word), MEMORY + 1);
    b.write(MULTI, 1 << 3);
    b.run(20);
    const flags = ((1 << flag) | 0x80000000) >>> 0;
    assert.deepEqual([b.read(at(3, AL1_CTRL)) & 0xe0000000 & ~BUSY, b.read(INTR)], [flags | 0, 1 << 3]);
    assert.equal(violations(b), 1);
    b.write(at(3, AL1_CTRL) + SET, 1 << flag); // write clear
    assert.equal(b.read(at(3, AL1_CTRL)) >>> 29, 0);
  }
});

test('a ring wraps the lower bits of one address alone', () => {
  for (const [select, reads, writes] of [[0, 0, 0x50], [1 << 10, 0x50, 0]]) {
    const b = bench(3, { count: 20, ctrl: EN | WORDS | INCR | UNPACED | chainTo(3) | (4 << 6) | select });
    b.write(MULTI, 1 << 3);
    b.run(40);
    assert.deepEqual([b.read(at(3, READ)) - MEMORY, b.read(at(3, WRITE)) - MEMORY - 0x1000], [reads, writes]);
  }
});

test('interrupts are cleared by ones in INTR or INTS, through any alias, and reach the line that is enabled', () => {
  const b = bench(3);
  b.write(INTE0, 1 << 3);
  b.write(MULTI, 1 << 3);
  b.run(20);
  assert.deepEqual([b.read(INTR), b.read(INTS0), b.read(DMA + 0x41c)], [8, 8, 0]);
  b.write(INTS0, 1 << 4);
  assert.equal(b.read(INTR), 8);
  b.write(INTS0, 1 << 3);
  assert.deepEqual([b.read(INTR), b.read(INTS0)], [0, 0]);
});

test('what the datasheet reserves is a violation', () => {
  const offences = [
    (b) => b.write(at(3, AL1_CTRL), EN | (3 << 2)),
    (b) => b.write(at(3, AL1_CTRL), EN | chainTo(12)),
    (b) => b.write(at(3, AL1_CTRL), EN | (50 << 15)),
    (b) => b.write(at(3, AL1_COUNT_TRIG), 0) || b.write(MULTI, 1 << 3),
    (b) => b.write(DMA + 0x420, (2 << 16) | 1),
    (b) => b.write(DMA + 0x434, 1),
    (b) => b.write(DMA + 0x448, 1),
    (b) => b.write(ABORT, 1 << 12),
    (b) => b.read(DMA + 0x44c),
  ];
  for (const offend of offences) {
    const b = bench(3);
    offend(b);
    b.run(5);
    assert.equal(violations(b), 1, offend.toString());
  }
});

test('a channel that is stopped while busy must not name another one in CHAIN_TO (2.5.2.2)', () => {
  for (const [chain, expected] of [[0, 1], [5, 0]]) {
    const b = new Bench();
    b.write(DMA + 0x40 * 5, 0x20000800);
    b.write(DMA + 0x40 * 5 + 4, 0x20000900);
    b.write(DMA + 0x40 * 5 + 8, 100);
    b.write(DMA + 0x40 * 5 + 12, (0 << 15) | (5 << 11) | (2 << 2) | 1); // paced by PIO, busy for ever
    b.run(10);
    b.write(DMA + 0x40 * 5 + 16, chain << 11);
    assert.equal(b.violations.list.filter((text) => /CHAIN_TO/.test(text)).length, expected);
  }
});
