// SPDX-License-Identifier: MIT
// Timer, SIO, GPIO, pads, SPI, PIO and NVIC registers against the text of the RP2040 datasheet and of ARMv6-M: what a chip
// does, and what it does not forgive.
import assert from 'node:assert/strict';
import { test } from 'node:test';
import { Bench, PIO0 } from './bench.mjs';
import { hangProgram } from '../chip/processor.mjs';

const TIMER = 0x40054000;
const IO = 0x40014000;
const PADS = 0x4001c000;
const SIO = 0xd0000000;
const SPI = 0x4003c000;
const NVIC = 0xe000e000;
const CLK_PERI = 0x40008048;
const SET = 0x2000;
const TICKS_PER_US = 125;
const CTRL = (gpio) => IO + 4 + 8 * gpio;
const PAD = (gpio) => PADS + 4 + 4 * gpio;
const violations = (b) => b.violations.list.length;

/** Each of these, on a bench of its own, is a violation of the section given, and only one. */
function areViolations(offences) {
  for (const [section, offend] of offences) {
    const b = new Bench();
    offend(b);
    assert.equal(violations(b), 1, `${offend}: ${b.violations.list}`);
    assert.ok(b.violations.list[0].includes(section), b.violations.list[0]);
  }
}

// Timer, 4.6

test('an alarm rings when the low 32 bits are equal, disarms itself, and stays raised until it is cleared', () => {
  const b = new Bench();
  b.write(TIMER + 0x14, 10);
  assert.equal(b.read(TIMER + 0x20), 2);
  b.run(10 * TICKS_PER_US - 1);
  assert.deepEqual([b.read(TIMER + 0x34), b.read(TIMER + 0x20)], [0, 2]);
  b.run(2);
  assert.deepEqual([b.read(TIMER + 0x34), b.read(TIMER + 0x20), b.read(TIMER + 0x40)], [2, 0, 0]);
  b.write(TIMER + 0x38, 0xf);
  assert.equal(b.read(TIMER + 0x40), 2);
  b.write(TIMER + 0x34 + SET, 2); // write clear, through any alias
  assert.equal(b.read(TIMER + 0x34), 0);
});

test('ARMED disarms by ones; TIMELR latches TIMEHR', () => {
  const b = new Bench();
  b.write(TIMER + 0x10, 5);
  b.write(TIMER + 0x18, 6);
  b.write(TIMER + 0x20, 1);
  assert.equal(b.read(TIMER + 0x20), 4);
  b.run(20 * TICKS_PER_US);
  assert.deepEqual([b.read(TIMER + 0x34), b.read(TIMER + 0x0c), b.read(TIMER + 0x08)], [4, 20, 0]);
});

test('the timer does not forgive an alarm in the past, nor writes of what is read only', () => {
  areViolations([
    ['4.6.3', (b) => { b.run(20 * TICKS_PER_US); b.write(TIMER + 0x10, 19); }],
    ['4.6.3', (b) => b.write(TIMER + 0x10, 0)],
    ['4.6.5', (b) => b.write(TIMER + 0x28, 1)],
    ['4.6.5', (b) => b.write(TIMER + 0x04, 1)],
    ['4.6.5', (b) => b.write(TIMER + 0x30, 1)],
    ['4.6.5', (b) => b.read(TIMER + 0x44)],
  ]);
});

// SIO, 2.3.1

test('the divider takes eight cycles and gives whole numbers, of both signs, and by zero (2.3.1.5)', () => {
  for (const [dividend, divisor, places, quotient, remainder] of [
    [1000, 7, [0x60, 0x64], 142, 6], [-1000, 7, [0x68, 0x6c], -142, -6], [0xffffffff, 2, [0x60, 0x64], 0x7fffffff, 1],
    [5, 0, [0x60, 0x64], 0xffffffff, 5], [-5, 0, [0x68, 0x6c], 1, -5], [5, 0, [0x68, 0x6c], -1, 5]]) {
    const b = new Bench();
    b.write(SIO + places[0], dividend);
    b.write(SIO + places[1], divisor);
    assert.equal(b.read(SIO + 0x78) & 1, 0);
    b.run(8);
    assert.deepEqual([b.read(SIO + 0x78), b.read(SIO + 0x74), b.read(SIO + 0x70)], [3, remainder >>> 0, quotient >>> 0]);
    assert.equal(violations(b), 0);
  }
});

test('SIO does not forgive a divider that is read too early, nor registers that are not there', () => {
  areViolations([
    ['2.3.1.5', (b) => { b.write(SIO + 0x60, 9); b.write(SIO + 0x64, 3); b.run(6); b.read(SIO + 0x70); }],
    ['2.3.1.7', (b) => b.write(SIO + 0x04, 1)],
    ['2.3.1.7', (b) => b.read(SIO + 0x180)],
    ['2.3.1.7', (b) => b.write(SIO + 0x54, 1)],
  ]);
});

// GPIO and pads, 2.19

test('edges are latched whether or not they are enabled, and cleared by ones; levels are as they are (2.19.3)', () => {
  const b = new Bench();
  b.pads.drive(9, true);
  b.pads.drive(9, false);
  assert.equal((b.read(IO + 0xf4) >> 4) & 0xf, 0b1101);
  b.write(IO + 0xf4, 0xff);
  assert.equal((b.read(IO + 0xf4) >> 4) & 0xf, 0b0001);
  b.pads.drive(9, true);
  b.write(IO + 0x104, 8 << 4);
  assert.deepEqual([b.read(IO + 0x124), b.chip.core.pendingInterrupts], [8 << 4, 1 << 13]);
  const other = new Bench();
  other.pads.drive(9, true);
  other.write(IO + 0x134, 8 << 4);
  assert.deepEqual([other.read(IO + 0x154), other.chip.core.pendingInterrupts], [8 << 4, 0], 'processor 1');
});

test('a pad whose input is disabled reads low, and overrides work on both ways', () => {
  const b = new Bench();
  const status = () => [9, 13, 17, 19].map((place) => (b.read(IO + 8 * 4) >> place) & 1);
  b.pads.drive(4, true);
  assert.deepEqual(status(), [0, 0, 1, 1]);
  b.write(PAD(4), 0x16);
  assert.deepEqual(status(), [0, 0, 0, 0]);
  b.write(CTRL(4), 0x1f | (3 << 16));
  assert.deepEqual(status(), [0, 0, 0, 1]);
  b.write(CTRL(4), 0x1f | (1 << 16) | (3 << 8) | (1 << 12));
  assert.deepEqual(status(), [1, 1, 0, 1]);
});

test('GPIO does not forgive functions that a pin does not have, nor writes of what is read only', () => {
  areViolations([
    ['2.19.2', (b) => b.write(CTRL(3), 8)],
    ['2.19.2', (b) => b.write(CTRL(3), 0)],
    ['2.19.2', (b) => b.write(CTRL(3), 12)],
    ['2.19.6.1', (b) => b.write(IO + 0x120, 1)],
    ['2.19.6.1', (b) => b.write(IO, 1)],
    ['2.19.6.1', (b) => b.read(IO + 0x190)],
    ['2.19.6.3', (b) => b.read(PADS + 0x84)],
  ]);
  const b = new Bench();
  b.write(CTRL(21), 8); // CLOCK GPOUT0
  assert.equal(violations(b), 0);
});

// SPI, 4.4

/** A block that is set up for 8 bits at 125 MHz / 14, loop-back. */
test('a pad with both pulls keeps the level that it was driven to (2.19.4)', () => {
  const b = new Bench();
  b.write(PAD(9), 0x40 | 0x0c);
  for (const level of [true, false]) {
    b.pads.drive(9, level);
    b.pads.drive(9, null);
    assert.equal((b.pads.levels >> 9) & 1, level ? 1 : 0);
  }
  b.write(PAD(9), 0x40 | 0x08);
  assert.equal((b.pads.levels >> 9) & 1, 1);
});

function spiBench({ clock = true } = {}) {
  const b = new Bench();
  if (!clock) b.write(CLK_PERI, 0);
  b.write(SPI + 0x10, 2);
  b.write(SPI, (6 << 8) | 7);
  b.write(SPI + 4, 2 | 1);
  return b;
}

test('a frame takes its bits, and a ninth received word is an overrun', () => {
  const b = spiBench();
  const frame = Math.floor((8 * 14 * 125e6) / b.chip.clkPeri); // 4.4.3
  for (let n = 0; n < 8; n++) b.write(SPI + 8, 0x1a0 + n);
  assert.equal(b.read(SPI + 0xc) & 0x10, 0x10);
  b.run(frame - 1);
  assert.equal(b.read(SPI + 0xc) & 4, 0);
  b.run(9 * frame);
  assert.deepEqual([b.read(SPI + 0xc), b.read(SPI + 0x18) & 1], [0b01111, 0]);
  b.write(SPI + 8, 1);
  b.run(2 * frame);
  assert.equal(b.read(SPI + 0x18) & 1, 1);
  b.write(SPI + 0x20, 1);
  assert.equal(b.read(SPI + 0x18) & 1, 0);
  assert.deepEqual(Array.from({ length: 8 }, () => b.read(SPI + 8)), Array.from({ length: 8 }, (_, n) => 0xa0 + n));
  assert.equal(violations(b), 0);
});

test('SPI does not forgive settings while it runs, reserved ones, a full FIFO, an empty one or no clock', () => {
  const running = (offend) => { const b = spiBench(); offend(b); return b; };
  const offences = [
    ['4.4.3', (b) => b.write(SPI, 7)],
    ['4.4.3', (b) => b.write(SPI + 0x10, 4)],
    ['4.4.3', (b) => { b.write(SPI + 8, 1); b.write(SPI + 4, 0); }],
    ['4.4.4', (b) => b.write(SPI + 4, 6)],
    ['4.4.4', (b) => { for (let n = 0; n < 10; n++) b.write(SPI + 8, n); }],
    ['4.4.4', (b) => b.read(SPI + 8)],
    ['4.4.4', (b) => { b.write(SPI + 4, 0); b.write(SPI, 2); }],
    ['4.4.4', (b) => { b.write(SPI + 4, 0); b.write(SPI, 0x17); }],
    ['4.4.4', (b) => { b.write(SPI + 4, 0); b.write(SPI + 0x10, 3); }],
    ['4.4.4', (b) => b.write(SPI + 0xc, 1)],
  ];
  for (const [section, offend] of offences) {
    const b = running(offend);
    assert.equal(violations(b), 1, `${offend}: ${b.violations.list}`);
    assert.ok(b.violations.list[0].includes(section), b.violations.list[0]);
  }
  const unclocked = spiBench({ clock: false });
  unclocked.write(SPI + 8, 1);
  unclocked.run(1000);
  assert.deepEqual([unclocked.read(SPI + 0xc) & 4, violations(unclocked)], [0, 1]);
});

// PIO, 3.7

test('PIO does not forgive full and empty FIFOs, reserved settings or writes of what is read only', () => {
  areViolations([
    ['3.7', (b) => { for (let n = 0; n < 5; n++) b.push(0, 0, n); }],
    ['3.7', (b) => b.read(PIO0 + 0x20)],
    ['3.7', (b) => b.configure(0, 0, { clkdiv: 0x100 })],
    ['3.7', (b) => b.configure(0, 0, { shiftctrl: 0xc0000000 })],
    ['3.7', (b) => b.configure(0, 0, { pinctrl: 6 << 26 })],
    ['3.7', (b) => b.configure(0, 0, { pinctrl: 33 << 20 })],
    ['3.7', (b) => b.configure(0, 0, { execctrl: 1 << 17 })],
    ['3.7', (b) => b.write(PIO0 + 0xd4, 3)],
    ['3.7', (b) => b.write(PIO0 + 0x04, 3)],
    ['3.7', (b) => b.read(PIO0 + 0x48)],
    ['3.7', (b) => b.write(PIO0 + 0x134, 1)],
  ]);
});

test('a reset of a PIO block puts its registers and machines back, and lets go of the pins', () => {
  const b = new Bench();
  b.givePins(0, 1, 1);
  b.load(0, [0xe001]);
  b.configure(0, 0, { pinctrl: 1 << 26, shiftctrl: 0x40000000, execctrl: 0 });
  b.push(0, 0, 1);
  b.enable(0, 1);
  b.write(PIO0 + 0x12c, 0xf00);
  b.run(20);
  assert.equal(b.pads.levels & 1, 1);
  b.chip.pio[0].reset();
  assert.deepEqual([0, 0x0c, 0xc8, 0xcc, 0xd0, 0xdc, 0x12c].map((offset) => b.read(PIO0 + offset)),
                   [0, 0, 0x10000, 0x1f000, 0xc0000, 0x14000000, 0]);
  assert.equal(b.pads.driven & 1, 0);
});

// NVIC and SCB

/** A program that sleeps for ever; handlers of interrupts 0 and 1 count in R6 and R5 and leave their lines alone. */
function sleeper() {
  const b = new Bench();
  [[16, 0x300, 0x3601], [17, 0x340, 0x3501]].forEach(([exception, at, add]) => {
    b.chip.writeUint32(0x20000000 + 4 * exception, (0x20000000 + at) | 1);
    [add, 0x4770].forEach((halfword, n) => b.chip.writeUint16(0x20000000 + at + 2 * n, halfword));
  });
  hangProgram(b.chip);
  return b;
}

test('a line that has fallen again has interrupted all the same, once', () => {
  const b = sleeper();
  b.chip.setInterrupt(0, true);
  b.chip.setInterrupt(0, false);
  assert.equal(b.read(NVIC + 0x200), 1);
  b.write(NVIC + 0x100, 1);
  b.run(200);
  assert.deepEqual([b.chip.core.registers[6], b.read(NVIC + 0x200)], [1, 0]);
});

test('a line that stays high interrupts again and again; ICPR clears what is pending only when it is low', () => {
  const b = sleeper();
  b.chip.setInterrupt(0, true);
  b.write(NVIC + 0x280, 1);
  assert.equal(b.read(NVIC + 0x200), 1);
  b.write(NVIC + 0x100, 1);
  b.run(400);
  assert.ok(b.chip.core.registers[6] > 5);
  b.write(NVIC + 0x180, 1);
  b.run(100);
  b.chip.setInterrupt(0, false);
  b.write(NVIC + 0x280, 1);
  assert.equal(b.read(NVIC + 0x200), 0);
});

test('priorities have two bits each, and the higher one comes first, then the lower number (B1.5.4)', () => {
  const b = sleeper();
  b.write(NVIC + 0x400, 0xffffff7f);
  assert.equal(b.read(NVIC + 0x400), 0xc0c0c040);
  b.write(NVIC + 0x100, 3);
  b.chip.core.PM = true;
  b.write(NVIC + 0x200, 3);
  assert.equal((b.read(NVIC + 0xd04) >> 12) & 0x1ff, 16);
  b.write(NVIC + 0x400, 0x000000c0);
  assert.equal((b.read(NVIC + 0xd04) >> 12) & 0x1ff, 17);
  b.write(NVIC + 0x180, 2);
  assert.equal((b.read(NVIC + 0xd04) >> 12) & 0x1ff, 16, 'of what is enabled');
});

test('the system control block does not forgive what is not there', () => {
  areViolations([
    ['2.4.8', (b) => b.write(NVIC + 0xd08, 0x20000080)],
    ['2.4.8', (b) => b.write(NVIC + 0xd0c, 0x05fa0004)],
    ['2.4.8', (b) => b.write(NVIC + 0xd10, 2)],
    ['2.4.8', (b) => b.write(NVIC + 0xd94, 1)],
    ['2.4.8', (b) => b.read(NVIC + 0xd28)],
  ]);
});
