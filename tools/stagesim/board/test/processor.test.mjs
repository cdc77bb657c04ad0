// SPDX-License-Identifier: MIT
// The processor's corrections: sleep, wake, faults, and the timers, DMA and watchdog that act while it sleeps. Programs
// are Thumb halfwords, assembled by hand.
import assert from 'node:assert/strict';
import { test } from 'node:test';
import { starveDma } from '../chip/dma.mjs';
import { parseInjection } from '../injections.mjs';
import { hangProgram, raiseHardFault } from '../chip/processor.mjs';
import { watchdogLegacy } from '../chip/system.mjs';
import { Bench, PIO0, wrap } from './bench.mjs';
import { MOV, SRC, jmp, mov, pull, push, JMP } from './opcodes.mjs';

const SRAM = 0x20000000;
const WFI = 0xbf30;
const CPSID = 0xb672;
const CPSIE = 0xb662;
const BRANCH_TO_SELF = 0xe7fe;
const ADDS_R7_1 = 0x3701; // counts what has been passed
const ADDS_R6_1 = 0x3601; // counts handler entries
const BX_LR = 0x4770;
const BKPT = 0xbe00;
const TIMER0_IRQ = 0;
const HANDLER = SRAM + 0x200;

/** A bench whose exceptions 3 and 16 count in R6 and return; interrupt 0 is enabled. */
function bench(program) {
  const b = new Bench();
  for (const exception of [3, 16]) b.chip.writeUint32(SRAM + 4 * exception, HANDLER | 1);
  [ADDS_R6_1, BX_LR].forEach((halfword, n) => b.chip.writeUint16(HANDLER + 2 * n, halfword));
  b.processor(program);
  b.write(0xe000e100, 1 << TIMER0_IRQ);
  return b;
}

const passed = (b) => b.chip.core.registers[7];
const handled = (b) => b.chip.core.registers[6];

test('WFI sleeps until an interrupt, whose handler then runs', () => {
  const b = bench([WFI, ADDS_R7_1, BRANCH_TO_SELF]);
  b.run(1000);
  assert.deepEqual([passed(b), handled(b)], [0, 0]);
  b.chip.setInterrupt(TIMER0_IRQ, true);
  b.run(5);
  b.chip.setInterrupt(TIMER0_IRQ, false);
  b.run(100);
  assert.equal(passed(b), 1);
  assert.ok(handled(b) >= 1);
});

test('WFI with an interrupt already pending goes on', () => {
  const b = bench([CPSID, ADDS_R7_1, WFI, ADDS_R7_1, BRANCH_TO_SELF]);
  b.run(1);
  b.chip.setInterrupt(TIMER0_IRQ, true);
  b.run(100);
  assert.equal(passed(b), 2);
});

test('under PRIMASK an interrupt ends WFI but its handler waits for CPSIE', () => {
  const b = bench([CPSID, WFI, ADDS_R7_1, BRANCH_TO_SELF]);
  b.run(10);
  b.chip.setInterrupt(TIMER0_IRQ, true);
  b.run(50);
  assert.deepEqual([passed(b), handled(b)], [1, 0]);
  const open = bench([CPSID, WFI, ADDS_R7_1, CPSIE, BRANCH_TO_SELF]);
  open.run(10);
  open.chip.setInterrupt(TIMER0_IRQ, true);
  open.run(10);
  open.chip.setInterrupt(TIMER0_IRQ, false);
  open.run(50);
  assert.equal(passed(open), 1);
  assert.ok(handled(open) >= 1);
});

test('an interrupt that is not enabled does not end WFI', () => {
  const b = bench([WFI, ADDS_R7_1, BRANCH_TO_SELF]);
  b.chip.setInterrupt(1, true);
  b.run(100);
  assert.equal(passed(b), 0);
});

test('a breakpoint without a debugger is a hard fault, and one can be raised from outside', () => {
  const b = bench([BKPT, BRANCH_TO_SELF]);
  b.run(60);
  assert.ok(handled(b) >= 1);
  const asleep = bench([WFI, BRANCH_TO_SELF]);
  asleep.run(50);
  raiseHardFault(asleep.chip);
  asleep.run(60);
  assert.equal(handled(asleep), 1);
});

test('a timer alarm rings at its microsecond, not before', () => {
  for (const start of [0, 3, 124, 125, 1000]) {
    const b = bench([BRANCH_TO_SELF]);
    b.run(start);
    b.write(0x40054038, 1); // INTE
    b.write(0x40054010, 20); // ALARM0 at 20 us
    b.run(20 * 125 - start - 1);
    assert.equal(b.read(0x40054034), 0, `started at cycle ${start}`);
    b.run(2);
    assert.equal(b.read(0x40054034), 1, `started at cycle ${start}`);
    assert.ok(b.read(0x40054028) >= 20);
  }
});

test('DMA moves one word a cycle while its request is up, and restarts itself through a second channel', () => {
  const b = new Bench();
  b.run(10); // the processor sleeps from here on
  b.load(0, [pull(), mov(MOV.isr, SRC.osr), push(), jmp(JMP.always, 0)]);
  b.configure(0, 0, { execctrl: wrap(3) });
  const words = [11, 22, 33];
  words.forEach((word, n) => b.write(SRAM + 0x1000 + 4 * n, word));
  b.write(SRAM + 0x1100, SRAM + 0x1000);
  const channel = (n) => 0x50000000 + 0x40 * n;
  const control = (request, chain, increments) => 1 | (2 << 2) | (increments << 4) | (chain << 11) | (request << 15);
  b.write(channel(1), SRAM + 0x1100);
  b.write(channel(1) + 4, channel(0) + 0x3c); // AL3_READ_ADDR_TRIG of channel 0
  b.write(channel(1) + 8, 1);
  b.write(channel(1) + 0x10, control(63, 1, 0)); // AL1_CTRL
  b.write(channel(0) + 4, PIO0 + 0x10);
  b.write(channel(0) + 8, words.length);
  b.write(channel(0) + 0x10, control(0, 1, 1));
  b.write(channel(0) + 0x3c, SRAM + 0x1000);
  for (const words of [1, 2, 3, 3]) { // the fourth cycle is the second channel's
    b.run(1);
    assert.equal(b.read(PIO0 + 0x0c) & 0xf, words);
  }
  b.run(10);
  assert.equal(b.read(PIO0 + 0x0c) & 0xf, 4); // full: three words and the first of the second round
  b.enable(0, 1);
  b.run(200);
  const received = [1, 2, 3, 4].map(() => b.read(PIO0 + 0x20));
  assert.deepEqual(received, [11, 22, 33, 11]);
  assert.equal(b.read(0x50000444), 0);
  starveDma(b.chip);
  for (let n = 0; n < 12; n++) {
    b.run(20);
    b.read(PIO0 + 0x20); // so that the machine can use up what it has
  }
  assert.equal(b.read(PIO0 + 0x0c) & 0xf, 0);
  assert.equal((b.read(PIO0 + 0x08) >> 24) & 1, 1);
});

test('the watchdog bites once, after its time in half microseconds, and leaves its reason and scratch words', () => {
  let bitten = 0;
  const { chip, lockstep, time } = new Bench({ onWatchdog: () => bitten++ });
  chip.core.waiting = true;
  chip.writeUint32(0x40010008, 0x1fffc); // PSM_WDSEL: all but the oscillators
  chip.writeUint32(0x4005802c, 1 << 9 | 12); // TICK: 12 MHz / 12
  chip.writeUint32(0x40058004, 2000); // 1 ms: counts down twice a microsecond (erratum RP2040-E1)
  chip.writeUint32(0x40058000, 1 << 30);
  chip.writeUint32(0x40058018, 0x12345678); // SCRATCH3
  lockstep.run(124_990);
  assert.equal(bitten, 0);
  lockstep.run(125_010);
  assert.equal(bitten, 1);
  lockstep.run(1_000_000);
  assert.equal(bitten, 1);
  assert.equal(time.cycle, 1_000_000);
  const { reason, scratch } = watchdogLegacy(chip);
  assert.deepEqual([reason, scratch[3]], [1, 0x12345678]);
});

test('a program that hangs passes nothing any more, but its handlers run', () => {
  const b = bench([ADDS_R7_1, 0xe7fd]); // counts for ever
  b.run(50);
  const before = passed(b);
  hangProgram(b.chip);
  b.chip.setInterrupt(TIMER0_IRQ, true);
  b.run(5);
  b.chip.setInterrupt(TIMER0_IRQ, false);
  b.run(100);
  assert.ok(before > 0 && passed(b) === before && handled(b) >= 1);
});

test('times of handlers are those from the interrupt to the entry, and to the return', () => {
  const b = bench([CPSID, ADDS_R7_1, ADDS_R7_1, ADDS_R7_1, CPSIE, BRANCH_TO_SELF]);
  b.run(1);
  b.chip.setInterrupt(TIMER0_IRQ, true);
  b.run(6);
  b.chip.setInterrupt(TIMER0_IRQ, false);
  b.run(100);
  const { handlers, longestHeld } = b.lockstep.handlerTimes;
  assert.equal(longestHeld, 4); // CPSID and three additions; CPSIE lets in
  assert.deepEqual(handlers.get(16), { count: 1, wait: 4, longest: 15 + 1 });
});

test('an injection takes the numbers it needs, and no others', () => {
  assert.equal(parseInjection('upset:17@trigger:5+300').delay, 300);
  assert.equal(parseInjection('starve@7').tick, 7);
  for (const text of ['upset@7', 'upset:32@7', 'flip:1@7', 'flip:0x20000000:8@7', 'estop:1@7', 'starve:12@7', 'x@1']) {
    assert.throws(() => parseInjection(text), /--inject/, text);
  }
});
