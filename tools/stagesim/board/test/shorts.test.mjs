// SPDX-License-Identifier: MIT
// A shorted pad has its level whatever drives it, and the chip's inputs see that.
import assert from 'node:assert/strict';
import { test } from 'node:test';
import { parseInjection } from '../injections.mjs';
import { Bench } from './bench.mjs';

const GPIO = 5;
const BIT = 1 << GPIO;
const CTRL = 0x40014004 + 8 * GPIO;
const STATUS = CTRL - 4;
const FROM_PAD = 1 << 17;
const OUT_SET = 0xd0000014;
const OUT_CLR = 0xd0000018;

/** GPIO 5 as an output of SIO, by override. */
function output() {
  const b = new Bench();
  b.write(CTRL, 5 | (3 << 12));
  return b;
}

test('a short to either level wins over an output, and what drives it comes back without the short', () => {
  const b = output();
  const levels = [];
  const look = () => levels.push((b.pads.levels >> GPIO) & 1);
  for (const drive of [OUT_SET, OUT_CLR]) {
    b.write(drive, BIT);
    b.run(4);
    look();
    for (const level of [true, false, null]) {
      b.pads.short(GPIO, level);
      look();
    }
  }
  assert.deepEqual(levels, [1, 1, 0, 1, 0, 1, 0, 0]);
});

test('the status register and the synchronised inputs see the short, not the output', () => {
  const b = output();
  b.run(4);
  assert.equal(b.read(STATUS) & FROM_PAD, 0);
  b.pads.short(GPIO, true);
  b.run(4);
  assert.equal(b.read(STATUS) & FROM_PAD, FROM_PAD);
  assert.ok(b.pads.seen(GPIO, b.time.cycle, 0));
  b.pads.short(GPIO, null);
  b.run(4);
  assert.equal(b.read(STATUS) & FROM_PAD, 0);
});

test('a short of a pad that nobody drives counts as driven: a trace shows it', () => {
  const b = new Bench();
  b.pads.short(GPIO, true);
  assert.equal(b.pads.driven & BIT, BIT);
  assert.equal(b.pads.levels & BIT, BIT);
});

test('shorts are injected with a pad and a level, and taken away with the pad', () => {
  const done = [];
  const board = { short: (gpio, level) => done.push([gpio, level]) };
  for (const text of ['short:5:1@7', 'short:29:0@7', 'unshort:5@trigger:3+9']) parseInjection(text).inject(board);
  assert.deepEqual(done, [[5, true], [29, false], [5, null]]);
  for (const text of ['short@7', 'short:5@7', 'short:30:1@7', 'short:5:2@7', 'unshort@7', 'unshort:5:1@7']) {
    assert.throws(() => parseInjection(text), /--inject/, text);
  }
});
