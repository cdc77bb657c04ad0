// SPDX-License-Identifier: MIT
// What leaves the board: exposures from edges, the trace, the image that goes in, the command line.
import assert from 'node:assert/strict';
import { mkdtempSync, readFileSync, rmSync, writeFileSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { after, describe, test } from 'node:test';
import { Chain } from '../chain.mjs';
import { ExposureRecorder } from '../exposures.mjs';
import { crc32Mpeg2 } from '../chip/boot_rom.mjs';
import { readImage } from '../image.mjs';
import { parseOptions } from '../options.mjs';
import { boardPins } from '../pins.mjs';
import { VcdWriter } from '../vcd.mjs';

const pico = boardPins('pico');
const PINS = pico.outputs;
const directory = mkdtempSync(join(tmpdir(), 'ols'));
after(() => rmSync(directory, { recursive: true }));

describe('the chain', () => {
  test('bit b of the pattern is the b-th bit shifted out', () => {
    const chain = new Chain(16);
    for (const bit of [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]) chain.clock(bit);
    assert.equal(chain.pattern, '0000');
    chain.latch();
    assert.equal(chain.pattern, '8421');
  });

  test('bits past its length fall off the end, and too few leave old ones in', () => {
    const chain = new Chain(8);
    for (let n = 0; n < 8; n++) chain.clock(1);
    for (let n = 0; n < 4; n++) chain.clock(0);
    chain.latch();
    assert.equal(chain.pattern, 'f0');
  });
});

describe('exposures', () => {
  /** Plays [tick, pin, level] edges on a chain of 8 bits; returns the exposures. */
  function record(edges, activeLow = []) {
    const exposures = [];
    const recorder = new ExposureRecorder(8, (exposure) => exposures.push(exposure), pico, activeLow);
    let levels = 0;
    for (const [tick, pin, level] of edges) {
      levels = level ? levels | (1 << PINS[pin]) : levels & ~(1 << PINS[pin]);
      recorder.edge(tick, levels);
    }
    return exposures;
  }

  const shift = (tick, byte) => Array.from({ length: 8 }, (_, n) => [
    [tick + 4 * n, 'DATA', (byte >> (7 - n)) & 1], [tick + 4 * n + 1, 'CLK', 1], [tick + 4 * n + 2, 'CLK', 0],
  ]).flat();
  const latch = (tick) => [[tick, 'LATCH', 1], [tick + 1, 'LATCH', 0]];

  test('an exposure is its trigger with the light in it, clipped to it', () => {
    const [exposure] = record([...shift(0, 0xa5), ...latch(100), [190, 'LIGHT_EN', 1], [200, 'TRIG0', 1],
                               [300, 'LIGHT_EN', 0], [400, 'LIGHT_EN', 1], [500, 'TRIG0', 0]]);
    assert.deepEqual(exposure, { type: 'exposure', n: 0, trigger: 0, rise: 200, fall: 500, segments: [
      { on: 200, off: 300, bits: 'a5' }, { on: 400, off: 500, bits: 'a5' }] });
  });

  test('a pattern latched while the light is on begins a new segment, the same pattern does not', () => {
    const [exposure] = record([...shift(0, 0x11), ...latch(100), [200, 'TRIG0', 1], [200, 'LIGHT_EN', 1],
                               ...shift(210, 0x22), ...latch(300), ...shift(310, 0x22), ...latch(400),
                               [500, 'LIGHT_EN', 0], [600, 'TRIG0', 0]]);
    assert.deepEqual(exposure.segments, [{ on: 200, off: 300, bits: '11' }, { on: 300, off: 500, bits: '22' }]);
  });

  test('shifting alone lights nothing new, and a dark exposure has no segments', () => {
    const exposures = record([...shift(0, 0x0f), ...latch(50), [60, 'TRIG1', 1], ...shift(70, 0xff), [150, 'TRIG1', 0],
                              [160, 'TRIG0', 1], [160, 'LIGHT_EN', 1], [170, 'TRIG0', 0]]);
    assert.deepEqual(exposures.map(({ trigger, segments }) => [trigger, segments]),
                     [[1, []], [0, [{ on: 160, off: 170, bits: '0f' }]]]);
  });

  test('an active-low trigger that is low before its idle level exposes nothing, whatever other pins do', () => {
    const exposures = record([[10, 'HEALTHY', 1], [20, 'HEALTHY', 0], [30, 'TRIG0', 1], [40, 'TRIG0', 0], [50, 'HEALTHY', 1],
                              [60, 'TRIG0', 1]], [0]);
    assert.deepEqual(exposures.map(({ rise, fall }) => [rise, fall]), [[40, 60]]);
  });

  test('data that changes with the clock comes too late for it', () => {
    const both = (1 << PINS.DATA) | (1 << PINS.CLK);
    let seen = '';
    const late = new ExposureRecorder(8, ({ segments }) => {
      seen = segments[0].bits;
    }, pico);
    for (const [tick, levels] of [[1, both], [2, 0], [3, 1 << PINS.LATCH], [4, 0],
                                  [5, (1 << PINS.TRIG0) | (1 << PINS.LIGHT_EN)], [6, 0]]) {
      late.edge(tick, levels);
    }
    assert.equal(seen, '00');
  });
});

test('the trace has nanoseconds, initial values and one line for each change', () => {
  const path = join(directory, 'trace.vcd');
  const vcd = new VcdWriter(path, pico);
  vcd.edge(10, 1 << PINS.TRIG0);
  vcd.edge(10, (1 << PINS.TRIG0) | (1 << PINS.LIGHT_EN));
  vcd.edge(25, 1 << PINS.LIGHT_EN);
  vcd.close(30);
  const [head, body] = readFileSync(path, 'utf8').split('$end\n#0\n');
  assert.match(head, /\$timescale 1 ns/);
  const id = (name) => new RegExp(`wire 1 (.) ${name} `).exec(head)[1];
  assert.equal(body.split('$end\n')[1], `#80\n1${id('TRIG0')}\n1${id('LIGHT_EN')}\n#200\n0${id('TRIG0')}\n#240\n`);
});

describe('boards', () => {
  test('each has its pins, and a name that is none is answered with those there are', () => {
    assert.equal(boardPins('feather_can').outputs.LIGHT_EN, 1);
    assert.throws(() => boardPins('picco'), /no board "picco"; there are: feather_can, pico/);
  });

  test('READY is the GPIO behind SYNC, which is a button on the Feather and never driven there', () => {
    assert.equal(boardPins('pico').outputs.READY, boardPins('pico').outputs.SYNC + 1);
    const { outputs, mask } = boardPins('feather_can');
    assert.equal(outputs.READY, undefined);
    assert.equal((mask >> (outputs.SYNC + 1)) & 1, 0);
  });
});

describe('images', () => {
  const write = (name, bytes) => {
    const path = join(directory, name);
    writeFileSync(path, bytes);
    return path;
  };

  /** A UF2 file of one block with `boot2` at the start of flash. */
  function uf2(boot2, { family = 0xe48bff56, address = 0x10000000 } = {}) {
    const block = Buffer.alloc(512);
    [0x0a324655, 0x9e5d5157, 0x2000, address, 256, 0, 1, family].forEach((word, n) => block.writeUInt32LE(word, 4 * n));
    boot2.copy(block, 32);
    block.writeUInt32LE(0x0ab16f30, 508);
    return block;
  }

  const boot2 = Buffer.alloc(256, 0x5a);
  boot2.writeUInt32LE(crc32Mpeg2(boot2.subarray(0, 252)), 252);

  test('the boot ROM\'s CRC has its published check value', () => {
    assert.equal(crc32Mpeg2(Buffer.from('123456789')), 0x0376e6e7);
  });

  test('a good image is read, with its bytes at their addresses', () => {
    const { flash } = readImage(write('good.uf2', uf2(boot2, { address: 0x10000000 })));
    assert.deepEqual(Buffer.from(flash.subarray(0, 256)), boot2);
    assert.ok(flash.subarray(256).every((byte) => byte === 0xff));
  });

  test('an image says which board it is for by the label behind boot2 and two vectors, or not at all', () => {
    assert.equal(readImage(write('silent.uf2', uf2(boot2))).label, null);
    const page = Buffer.alloc(256);
    page.write('OLab', 8);
    page.write('feather_can', 8 + 16);
    page.write('1.2.3', 8 + 32);
    const labelled = Buffer.concat([uf2(boot2), uf2(page, { address: 0x10000100 })]);
    assert.deepEqual(readImage(write('labelled.uf2', labelled)).label, { board: 'feather_can', version: '1.2.3' });
  });

  test('what cannot be started is refused with the file\'s name and the reason', () => {
    const damaged = Buffer.from(boot2);
    damaged[3] ^= 1;
    const cases = [
      [join(directory, 'none.elf'), /cannot read the firmware image \(ENOENT\).*make firmware/],
      [write('empty', Buffer.alloc(0)), /neither an ELF nor a UF2/],
      [write('text', Buffer.from('hello')), /neither an ELF nor a UF2/],
      [write('x86.elf', Buffer.concat([Buffer.from('\x7fELF\x01\x01', 'latin1'), Buffer.alloc(60)])), /not a 32-bit/],
      [write('crc.uf2', uf2(damaged)), /boot ROM would refuse/],
      [write('family.uf2', uf2(boot2, { family: 1 })), /not the RP2040/],
      [write('ram.uf2', uf2(boot2, { address: 0x20000000 })), /not in flash/],
      [write('cut.elf', Buffer.from('\x7fELF', 'latin1')), /not a 32-bit/],
    ];
    for (const [path, reason] of cases) {
      assert.throws(() => readImage(path), (error) => error.message.startsWith(path) && reason.test(error.message), path);
    }
  });
});

test('the command line is checked before anything starts', () => {
  const options = parseOptions(['--image', 'a.elf', '--inject', 'starve@trigger:50', '--inject', 'reset@1000']);
  assert.deepEqual(options.inject.map(({ name, tick, trigger }) => [name, tick, trigger]),
                   [['starve', Infinity, 50], ['reset', 1000, Infinity]]);
  assert.equal(options.chainBits, 176);
  for (const wrong of [[], ['--image'], ['--image', 'a', '--pace', 'fast'], ['--image', 'a', '--chain-bits', '7'],
                       ['--image', 'a', '--inject', 'fire@3'], ['--image', 'a', '--cycles-limit', '-1'],
                       ['--image', 'a', '--board-id', 'xyz'], ['--image', 'a', '--frobnicate']]) {
    assert.throws(() => parseOptions(wrong), Error, wrong.join(' '));
  }
});
