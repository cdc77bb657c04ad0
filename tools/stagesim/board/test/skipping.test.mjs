// SPDX-License-Identifier: MIT
// Jumping over idle cycles must change nothing: random programs on several machines of both blocks, with pushes, pops,
// forced instructions, divider changes and outside pins at random times, give the same edges, FIFOs and registers as
// stepping every cycle.
import assert from 'node:assert/strict';
import { test } from 'node:test';
import { Bench, PIO0, PIO1, pinctrl } from './bench.mjs';
import { JMP, MOV, OUT, SET, SRC, irqClear, irqSet, irqWait, jmp, mov, nop, out, pull, push, set, shiftIn, waitGpio,
         waitIrq } from './opcodes.mjs';

const CYCLES = 3000;

/** mulberry32: a small seeded generator, so that a failing seed can be run again. */
function generator(seed) {
  let state = seed >>> 0;
  return (below) => {
    state = (state + 0x6d2b79f5) >>> 0;
    let t = Math.imul(state ^ (state >>> 15), state | 1);
    t ^= t + Math.imul(t ^ (t >>> 7), t | 61);
    return ((t ^ (t >>> 14)) >>> 0) % below;
  };
}

function randomInstruction(pick, address) {
  const field = pick(4) === 0 ? pick(32) : 0;
  const near = (address + pick(4) + 30) % 32; // short loops, among them loops to itself
  const choices = [
    () => jmp(pick(8), pick(2) ? near : address, field),
    () => jmp(JMP.xDec, near, field),
    () => jmp(JMP.pin, near, field),
    () => set(SET.pins, pick(32), field),
    () => set(pick(2) ? SET.x : SET.y, pick(32), field),
    () => mov(pick(2) ? MOV.x : MOV.y, [SRC.pins, SRC.x, SRC.y, SRC.status, SRC.isr, SRC.osr][pick(6)], field, pick(3)),
    () => mov(MOV.pins, SRC.x, field),
    () => out([OUT.pins, OUT.x, OUT.y, OUT.pc, OUT.null][pick(5)], pick(32), field),
    () => pull({ ifEmpty: pick(2), block: pick(2) }, field),
    () => push({ ifFull: pick(2), block: pick(2) }, field),
    () => shiftIn([SRC.pins, SRC.x, SRC.null][pick(3)], pick(32), field),
    () => waitGpio(pick(2), pick(10), field),
    () => waitIrq(pick(2), pick(4), field),
    () => [irqSet, irqWait, irqClear][pick(3)](pick(4) | (pick(2) << 4), field),
    () => nop(field),
  ];
  return choices[pick(choices.length)]();
}

/** Runs seed's programs and events; returns all that can be observed. */
function play(seed, naive) {
  const pick = generator(seed);
  const b = new Bench({ naive });
  b.givePins(0, 0x0ff, 0x07f);
  b.givePins(1, 0xf00, 0xf00);
  const machines = [[0, 0], [0, 2], [1, 1]];
  for (const block of [0, 1]) b.load(block, Array.from({ length: 32 }, (_, n) => randomInstruction(pick, n)));
  for (const [block, machine] of machines) {
    const side = pick(3);
    b.configure(block, machine, {
      clkdiv: [1 << 16, 1 << 16, (1 + pick(4)) << 16, ((1 + pick(3)) << 16) | (pick(256) << 8)][pick(4)],
      execctrl: (pick(2) << 30) | (pick(12) << 24) | (31 << 12) | pick(4),
      shiftctrl: (pick(4) << 16) | (pick(4) << 18) | (pick(32) << 20) | (pick(32) << 25) | (pick(3) << 30),
      pinctrl: pinctrl({ side, sideBase: block * 8 + pick(4), set: pick(4), setBase: block * 8 + pick(4), out: pick(5),
                         outBase: block * 8 + pick(4), inBase: pick(8) }),
    });
    b.force(block, machine, jmp(JMP.always, pick(32)));
  }
  b.enable(0, 5);
  b.enable(1, 2);
  const reads = [];
  while (b.time.cycle < CYCLES) {
    b.run(1 + pick(pick(4) === 0 ? 400 : 40));
    const [block, machine] = machines[pick(3)];
    const base = block ? PIO1 : PIO0;
    const events = [
      () => b.push(block, machine, pick(0x7fffffff)),
      () => b.push(block, machine, pick(8)),
      () => reads.push(b.read(base + 0x20 + 4 * machine)),
      () => reads.push(b.read(base + 0xd4 + 0x18 * machine)),
      () => b.pads.drive(7, pick(2) === 1),
      () => b.write(base + 0x34, 1 << pick(4)),
      () => b.write(base + 0x30, 1 << pick(4)),
      () => b.force(block, machine, randomInstruction(pick, pick(32))),
      () => b.configure(block, machine, { clkdiv: (1 + pick(3)) << 16 }),
      () => b.write(base, pick(16)),
      () => b.enable(block, block ? 2 : 5),
    ];
    events[pick(events.length)]();
  }
  const registers = machines.map(([block, machine]) => {
    const address = b.read((block ? PIO1 : PIO0) + 0xd4 + 0x18 * machine);
    const { x, y, osr, isr, osrCount, isrCount } = b.chip.pio[block].machines[machine];
    return { address, x, y, osr, isr, osrCount, isrCount };
  });
  const status = [0x04, 0x08, 0x0c, 0x30].flatMap((offset) => [b.read(PIO0 + offset), b.read(PIO1 + offset)]);
  return { edges: b.edges, reads, registers, status };
}

test('random programs give the same edges, words and registers with and without jumps in time', () => {
  let edges = 0;
  for (let seed = 1; seed <= 100; seed++) {
    const jumped = play(seed, false);
    const stepped = play(seed, true);
    assert.deepEqual(jumped, stepped, `seed ${seed}`);
    edges += jumped.edges.length;
  }
  assert.ok(edges > 2000, `only ${edges} edges: the programs do nothing`);
});
