// SPDX-License-Identifier: MIT
// Runs PIO programs that come as JSON on standard input, for tests/hil/6_pio_oracle.py; answers with their edges.
import { readFileSync } from 'node:fs';
import { Bench, pinctrl, wrap } from './bench.mjs';

const AUTOPULL = 1 << 17;
const OUT_RIGHT = 1 << 19;

const played = JSON.parse(readFileSync(0)).map(({ program, words, autopull, threshold, outRight, side, cycles }) => {
  const b = new Bench();
  b.givePins(0, 0x3fffffff, 0x3fffffff);
  b.load(0, program);
  b.configure(0, 0, {
    execctrl: wrap(program.length - 1),
    shiftctrl: (autopull ? AUTOPULL : 0) | (outRight ? OUT_RIGHT : 0) | ((threshold & 31) << 25),
    pinctrl: pinctrl({ out: 8, outBase: 0, set: 5, setBase: 8, side, sideBase: 16 }),
  });
  for (const word of words) b.push(0, 0, word);
  b.enable(0, 1);
  b.run(cycles);
  return b.edges.filter(([cycle]) => cycle <= cycles);
});
process.stdout.write(JSON.stringify(played));
