// SPDX-License-Identifier: MIT
// PIO against closed forms from the datasheet: small programs whose every edge is known beforehand. Each runs both
// ways, stepping every cycle and jumping over idle ones.
import assert from 'node:assert/strict';
import { describe, test } from 'node:test';
import { Bench, PIO0, edgesOf, pinctrl, wrap } from './bench.mjs';
import { JMP, MOV, OUT, SET, SRC, irqClear, irqSet, irqWait, jmp, mov, nop, out, pull, push, set, shiftIn, waitGpio,
         waitIrq } from './opcodes.mjs';

const PIN = 5;
const BIT = 1 << PIN;
const SHIFT_RIGHT = 0x3 << 18;
const AUTOPULL = 1 << 17;
const AUTOPUSH = 1 << 16;
const JOIN_TX = 0x40000000;
const JOIN_RX = 0x80000000;
const threshold = (bits) => (bits & 31) << 25;
const FDEBUG = PIO0 + 0x08;
const FSTAT = PIO0 + 0x04;
const FLEVEL = PIO0 + 0x0c;
const IRQ = PIO0 + 0x30;
const IRQ_FORCE = PIO0 + 0x34;

for (const naive of [false, true]) {
  const bench = (program, options = {}) => {
    const b = new Bench({ naive });
    b.givePins(0, BIT, BIT);
    b.load(0, program);
    b.configure(0, 0, { execctrl: wrap(program.length - 1), shiftctrl: SHIFT_RIGHT,
                        pinctrl: pinctrl({ set: 1, setBase: PIN, out: 1, outBase: PIN }), ...options });
    return b;
  };
  /** Cycles, counted from the first edge, in which the pin changes. */
  const changes = (b) => edgesOf(b.edges, PIN).map(([cycle]) => cycle - edgesOf(b.edges, PIN)[0][0]);

  describe(naive ? 'stepping every cycle' : 'jumping over idle cycles', () => {
    test('a delay of n holds the next instruction back by n cycles', () => {
      const b = bench([set(SET.pins, 1, 3), set(SET.pins, 0, 1)]);
      b.enable(0, 1);
      b.run(30);
      assert.deepEqual(changes(b), [0, 4, 6, 10, 12, 16, 18, 22, 24, 28]);
    });

    test('an integer divider stretches every tick', () => {
      const b = bench([set(SET.pins, 1), set(SET.pins, 0, 1)], { clkdiv: 7 << 16 });
      b.enable(0, 1);
      b.run(60);
      assert.deepEqual(changes(b), [0, 7, 21, 28, 42, 49]);
    });

    test('a fractional divider puts tick k in cycle floor(k D / 256)', () => {
      const divisor = 2 * 256 + 77;
      const b = bench([set(SET.pins, 1), set(SET.pins, 0)], { clkdiv: divisor << 8 });
      b.enable(0, 1);
      b.run(2000);
      const ticks = Math.ceil((2000 * 256) / divisor);
      assert.deepEqual(changes(b), Array.from({ length: ticks }, (_, k) => Math.floor((k * divisor) / 256)));
    });

    test('a divider of 0 means 65536', () => {
      const b = bench([set(SET.pins, 1), set(SET.pins, 0)], { clkdiv: 0 });
      b.enable(0, 1);
      b.run(200_000);
      assert.deepEqual(changes(b), [0, 65536, 131072, 196608]);
    });

    test('a disabled machine does not step, and goes on where it was', () => {
      const b = bench([set(SET.pins, 1, 4), set(SET.pins, 0, 4)]);
      b.enable(0, 1);
      b.run(7); // two cycles into the delay of the second instruction
      b.write(PIO0, 0);
      b.run(1000);
      b.write(PIO0, 1);
      b.run(10);
      assert.deepEqual(changes(b), [0, 5, 1010, 1015]);
    });

    test('a forced instruction acts at once on a disabled machine', () => {
      const b = bench([nop()]);
      b.force(0, 0, set(SET.pins, 1));
      assert.deepEqual(edgesOf(b.edges, PIN), [[1, 1]]);
    });

    test('a forced instruction that stalls stays in the latch until it is done', () => {
      const b = bench([nop()]);
      b.force(0, 0, pull());
      b.run(10);
      assert.equal(b.read(PIO0 + 0xcc) >>> 31, 1);
      b.push(0, 0, 1);
      b.run(2);
      assert.equal(b.read(PIO0 + 0xcc) >>> 31, 0);
      b.force(0, 0, out(OUT.pins, 1));
      assert.equal(edgesOf(b.edges, PIN).length, 1);
    });

    test('out pc jumps to where the data says', () => {
      const b = bench([pull(), out(OUT.pc, 5), jmp(JMP.always, 2), set(SET.pins, 1), jmp(JMP.always, 4)]);
      b.push(0, 0, 3);
      b.enable(0, 1);
      b.run(10);
      assert.deepEqual(edgesOf(b.edges, PIN), [[3, 1]]);
      assert.equal(b.read(PIO0 + 0xd4), 4);
    });

    test('out exec runs the data in the next cycle, and its own delay is ignored', () => {
      const b = bench([pull(), out(OUT.exec, 16, 9), set(SET.pins, 0), jmp(JMP.always, 3)]);
      b.push(0, 0, set(SET.pins, 1, 4));
      b.enable(0, 1);
      b.run(20);
      assert.deepEqual(edgesOf(b.edges, PIN), [[3, 1], [8, 0]]); // 1 pull, 2 out, 3 executed with 4 of delay
    });

    test('mov exec runs a register as an instruction', () => {
      const b = bench([pull(), mov(MOV.exec, SRC.osr), jmp(JMP.always, 2)]);
      b.push(0, 0, set(SET.pins, 1));
      b.enable(0, 1);
      b.run(10);
      assert.deepEqual(edgesOf(b.edges, PIN), [[3, 1]]);
    });

    test('pull noblock takes X from an empty FIFO and does not count as a stall', () => {
      const b = bench([set(SET.x, 1), pull({ block: 0 }), out(OUT.pins, 1), jmp(JMP.always, 3)]);
      b.enable(0, 1);
      b.run(10);
      assert.deepEqual(edgesOf(b.edges, PIN), [[3, 1]]);
      assert.equal(b.read(FDEBUG), 0);
    });

    test('a blocking pull sets TXSTALL, again and again while it stalls', () => {
      const b = bench([pull(), set(SET.pins, 1), jmp(JMP.always, 2)]);
      b.enable(0, 1);
      b.run(100);
      assert.equal(b.read(FDEBUG), 1 << 24);
      b.write(FDEBUG, 1 << 24);
      b.run(2);
      assert.equal(b.read(FDEBUG), 1 << 24);
      b.push(0, 0, 0);
      b.run(5);
      b.write(FDEBUG, 1 << 24);
      b.run(5);
      assert.equal(b.read(FDEBUG), 0);
      assert.deepEqual(edgesOf(b.edges, PIN), [[104, 1]]); // pull in cycle 102, set in 103
    });

    test('autopull refills in the cycle of the last out, so that no cycle is lost', () => {
      const b = bench([out(OUT.pins, 1)], { shiftctrl: (SHIFT_RIGHT | AUTOPULL | threshold(2)) });
      for (let n = 0; n < 4; n++) b.push(0, 0, 0b01);
      b.enable(0, 1);
      b.run(20);
      assert.deepEqual(changes(b), [0, 1, 2, 3, 4, 5, 6, 7]);
    });

    test('an out that finds its data only now needs one cycle more', () => {
      const late = bench([out(OUT.pins, 1)], { shiftctrl: SHIFT_RIGHT | AUTOPULL });
      late.enable(0, 1);
      late.run(10);
      late.push(0, 0, 1);
      late.run(10);
      assert.deepEqual(edgesOf(late.edges, PIN), [[12, 1], [13, 0]]);
      // Refilled in the background, during a delay, it needs none.
      const early = bench([nop(15), out(OUT.pins, 1)], { shiftctrl: SHIFT_RIGHT | AUTOPULL });
      early.enable(0, 1);
      early.run(10);
      early.push(0, 0, 1);
      early.run(3);
      assert.equal(early.read(FLEVEL), 0);
      early.run(7);
      assert.deepEqual(edgesOf(early.edges, PIN), [[17, 1]]);
    });

    test('with autopull a pull of a full OSR takes nothing', () => {
      const b = bench([pull(), jmp(JMP.always, 1)], { shiftctrl: SHIFT_RIGHT | AUTOPULL });
      b.push(0, 0, 1);
      b.push(0, 0, 2);
      b.enable(0, 1);
      b.run(5);
      assert.equal(b.read(FLEVEL), 1);
    });

    test('mov status tells whether the TX FIFO holds fewer words than N', () => {
      const b = bench([mov(MOV.x, SRC.status), jmp(JMP.notX, 3), jmp(JMP.always, 0), set(SET.pins, 1)],
                      { execctrl: wrap(3) | 2 });
      b.enable(0, 1);
      b.run(30);
      assert.equal(b.edges.length, 0);
      b.push(0, 0, 0);
      b.run(30);
      assert.equal(b.edges.length, 0);
      b.push(0, 0, 0);
      b.run(30);
      assert.equal(edgesOf(b.edges, PIN).length, 1);
    });

    test('a joined FIFO holds eight words, the ninth is an overflow, and joining empties it', () => {
      const b = bench([jmp(JMP.always, 0)], { shiftctrl: SHIFT_RIGHT | JOIN_TX });
      for (let n = 0; n < 8; n++) b.push(0, 0, n);
      assert.equal(b.read(FDEBUG), 0);
      assert.equal(b.read(FLEVEL) & 0xff, 8);
      assert.equal((b.read(FSTAT) >> 16) & 1, 1);
      assert.equal((b.read(FSTAT) >> 8) & 1, 1); // the RX side is gone: empty
      assert.equal(b.read(FSTAT) & 1, 1); // and full
      b.push(0, 0, 8);
      assert.equal(b.read(FDEBUG), 1 << 16);
      b.configure(0, 0, { shiftctrl: SHIFT_RIGHT });
      assert.equal(b.read(FLEVEL) & 0xff, 0);
      for (let n = 0; n < 4; n++) b.push(0, 0, n);
      assert.equal((b.read(FSTAT) >> 16) & 1, 1);
    });

    test('a full RX FIFO stalls push, loses the word of push noblock, and reading it empty is noticed', () => {
      const b = bench([set(SET.x, 21), shiftIn(SRC.x, 32), push(), jmp(JMP.always, 1)]);
      b.enable(0, 1);
      b.run(50);
      assert.equal(b.read(FDEBUG), 1);
      assert.equal((b.read(FLEVEL) >> 4) & 0xf, 4);
      assert.equal(b.read(PIO0 + 0x20), 21);
      b.run(5);
      assert.equal((b.read(FLEVEL) >> 4) & 0xf, 4); // the stalled push has gone on
      const lossy = bench([set(SET.x, 21), shiftIn(SRC.x, 32), push({ block: 0 }), jmp(JMP.always, 1)],
                          { shiftctrl: SHIFT_RIGHT | JOIN_RX });
      lossy.enable(0, 1);
      lossy.run(100);
      assert.equal(lossy.read(FDEBUG), 1);
      for (let n = 0; n < 8; n++) assert.equal(lossy.read(PIO0 + 0x20), 21);
      const empty = bench([nop()]);
      empty.read(PIO0 + 0x20);
      assert.equal(empty.read(FDEBUG), 1 << 8);
    });

    test('autopush pushes when the threshold is reached and stalls on a full FIFO', () => {
      const b = bench([set(SET.x, 5), shiftIn(SRC.x, 4), jmp(JMP.always, 1)],
                      { shiftctrl: SHIFT_RIGHT & ~(1 << 18) | AUTOPUSH | (8 << 20) });
      b.enable(0, 1);
      b.run(200);
      assert.equal(b.read(FDEBUG), 1);
      assert.equal(b.read(PIO0 + 0x20), 0x55);
    });

    test('flags: set is seen by another machine in the next cycle, and wait clears it', () => {
      const b = bench([nop(9), irqSet(4), jmp(JMP.always, 2), waitIrq(1, 4), set(SET.pins, 1), jmp(JMP.always, 5)]);
      b.configure(0, 1, { execctrl: wrap(31), pinctrl: pinctrl({ set: 1, setBase: PIN }) });
      b.force(0, 1, jmp(JMP.always, 3));
      b.enable(0, 3);
      b.run(30);
      assert.deepEqual(edgesOf(b.edges, PIN), [[13, 1]]); // set in cycle 10, seen in 11, pin in 12
      assert.equal(b.read(IRQ), 0);
    });

    test('irq wait goes on when somebody has cleared its flag, and relative flags add the machine number', () => {
      const b = bench([irqWait(0x10), set(SET.pins, 1), irqClear(7), jmp(JMP.always, 3)]);
      b.configure(0, 2, { execctrl: wrap(3), pinctrl: pinctrl({ set: 1, setBase: PIN }) });
      b.write(IRQ_FORCE, 1 << 7);
      b.enable(0, 4);
      b.run(20);
      assert.equal(b.read(IRQ), (1 << 2) | (1 << 7));
      b.write(IRQ, 1 << 2);
      b.run(5);
      assert.equal(b.read(IRQ), 0);
      assert.deepEqual(edgesOf(b.edges, PIN), [[22, 1]]); // goes on in cycle 20, sets in 21
    });

    test('side-set takes its bits from the delay, acts while stalled, and may be left out when optional', () => {
      const side = { execctrl: wrap(3) | (1 << 30), pinctrl: pinctrl({ side: 2, sideBase: PIN }) };
      const b = bench([nop(0b11000 | 2), nop(0b00000 | 1), pull({}, 0b10000), jmp(JMP.always, 3, 0b11000)], side);
      b.enable(0, 1);
      b.run(40);
      b.push(0, 0, 0);
      b.run(20);
      assert.deepEqual(edgesOf(b.edges, PIN), [[1, 1], [6, 0], [42, 1]]);
    });

    test('side-set wins over set, and the higher machine wins over the lower', () => {
      const b = bench([set(SET.pins, 0, 0b10000), jmp(JMP.always, 1, 0b10000)],
                      { pinctrl: pinctrl({ side: 1, sideBase: PIN, set: 1, setBase: PIN }) });
      b.enable(0, 1);
      b.run(5);
      assert.deepEqual(edgesOf(b.edges, PIN), [[1, 1]]);
      const two = bench([set(SET.pins, 0), set(SET.pins, 1)]);
      two.configure(0, 3, { execctrl: wrap(1), pinctrl: pinctrl({ set: 1, setBase: PIN }) });
      two.force(0, 3, jmp(JMP.always, 1));
      two.enable(0, 9);
      two.run(6);
      assert.deepEqual(edgesOf(two.edges, PIN).map(([cycle]) => cycle), [1, 2, 3, 4, 5, 6]);
    });

    test('pin mappings wrap from GPIO 31 to GPIO 0', () => {
      const b = bench([set(SET.pins, 0b11111), jmp(JMP.always, 1)], { pinctrl: pinctrl({ set: 5, setBase: 30 }) });
      b.givePins(0, 0b111, 0b111);
      b.enable(0, 1);
      b.run(3);
      assert.equal(b.pads.levels, 0b111);
    });

    test('an output pad reads back through the synchroniser, two cycles after its edge', () => {
      const b = bench([nop(9), set(SET.pins, 1), jmp(JMP.always, 2), waitGpio(1, PIN), set(SET.pins, 1),
                       jmp(JMP.always, 5)]);
      b.givePins(0, BIT | (1 << 6), BIT | (1 << 6));
      b.configure(0, 1, { execctrl: wrap(31), pinctrl: pinctrl({ set: 1, setBase: 6 }) });
      b.force(0, 1, jmp(JMP.always, 3));
      b.enable(0, 3);
      b.run(30);
      const [[edge]] = edgesOf(b.edges, PIN);
      // seen in cycle edge + 2, the answer is set in edge + 3 and on its pad in edge + 4
      assert.deepEqual(edgesOf(b.edges, 6), [[edge + 4, 1]]);
      // without the synchroniser two cycles sooner
      const fast = bench([set(SET.pins, 1), jmp(JMP.always, 1), waitGpio(1, PIN), set(SET.pins, 1), jmp(JMP.always, 4)]);
      fast.givePins(0, BIT | (1 << 6), BIT | (1 << 6));
      fast.configure(0, 1, { execctrl: wrap(31), pinctrl: pinctrl({ set: 1, setBase: 6 }) });
      fast.write(PIO0 + 0x38, BIT);
      fast.force(0, 1, jmp(JMP.always, 2));
      fast.enable(0, 3);
      fast.run(30);
      assert.deepEqual(edgesOf(fast.edges, 6), [[edgesOf(fast.edges, PIN)[0][0] + 2, 1]]);
    });

    test('a pad without input enable reads low', () => {
      const b = bench([set(SET.pins, 1), jmp(JMP.pin, 3), jmp(JMP.always, 1), set(SET.pins, 0)],
                      { execctrl: wrap(3) | (PIN << 24) });
      b.write(0x4001c004 + 4 * PIN, 0x10);
      b.enable(0, 1);
      b.run(50);
      assert.equal(edgesOf(b.edges, PIN).length, 1);
    });

    test('counting loops last their counts times their ticks', () => {
      const b = bench([pull(), mov(MOV.x, SRC.osr), set(SET.pins, 1), jmp(JMP.xDec, 3, 6), set(SET.pins, 0),
                       jmp(JMP.always, 5)]);
      b.push(0, 0, 12345);
      b.enable(0, 1);
      b.run(100_000);
      assert.deepEqual(changes(b), [0, 1 + 12346 * 7]);
    });

    test('a watching loop stamps a pin to its two ticks', () => {
      const watch = [jmp(JMP.pin, 2), jmp(JMP.xDec, 0), mov(MOV.isr, SRC.x), push({ block: 0 }), jmp(JMP.always, 4)];
      for (const rise of [1000, 1001, 54321]) {
        const b = new Bench({ naive });
        b.load(0, watch);
        b.configure(0, 0, { execctrl: wrap(4) | (9 << 24) });
        b.force(0, 0, mov(MOV.x, SRC.null, 0, 1)); // X = ~0
        b.enable(0, 1);
        b.run(rise);
        b.pads.drive(9, true);
        b.run(20);
        // the pin is seen from cycle rise + 2 on, by the next even cycle; X has gone down once for each pass
        assert.equal(b.read(PIO0 + 0x20), 0xffffffff - Math.ceil((rise + 2) / 2));
      }
    });

    test('reading a register of a machine whose loop is skipped gives what stepping would', () => {
      const b = bench([pull(), mov(MOV.x, SRC.osr), jmp(JMP.xDec, 2, 3), set(SET.pins, 1), jmp(JMP.always, 4)]);
      b.push(0, 0, 1000);
      b.enable(0, 1);
      b.run(2 + 4 * 500);
      assert.equal(b.read(PIO0 + 0xd4), 2);
      b.run(3000);
      assert.deepEqual(edgesOf(b.edges, PIN), [[2 + 4 * 1001 + 1, 1]]);
    });
  });
}
