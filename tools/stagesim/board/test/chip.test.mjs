// SPDX-License-Identifier: MIT
// What the chip does not forgive, each against the datasheet's text: bus, resets, clocks, watchdog, flash.
import assert from 'node:assert/strict';
import { describe, test } from 'node:test';
import { crc32Mpeg2 } from '../chip/boot_rom.mjs';
import { BusFault } from '../chip/bus.mjs';
import { buildChip } from '../chip/chip.mjs';
import { FlashChip } from '../chip/flash_chip.mjs';
import { Cause } from '../chip/system.mjs';
import { Violations } from '../chip/violations.mjs';
import { Bench } from './bench.mjs';

const TICKS_PER_US = 125;
const SET = 0x2000;
const CLR = 0x3000;
const RESETS = 0x4000c000;
const RESETS_DONE = 0x4000c008;
const XOSC_CTRL = 0x40024000;
const XOSC_STATUS = 0x40024004;
const XOSC_STARTUP = 0x4002400c;
const PLL_SYS = 0x40028000;
const CLK_REF_CTRL = 0x40008030;
const CLK_REF_SELECTED = 0x40008038;
const CLK_SYS_CTRL = 0x4000803c;
const CLK_SYS_SELECTED = 0x40008044;
const WATCHDOG_CTRL = 0x40058000;
const WATCHDOG_LOAD = 0x40058004;
const WATCHDOG_TICK = 0x4005802c;
const PSM_WDSEL = 0x40010008;
const SSI = 0x18000000;
const SRAM = 0x20000000;
const BOOT2_AT = 0x20041f00;
const BRANCH_TO_SELF = 0xe7fe;

/** A chip that has just come out of reset by power, with what is in its flash. */
function cold({ flash = new Uint8Array(2 << 20).fill(0xff), onLoader = () => {}, onWatchdog = () => {}, ...options } = {}) {
  const violations = new Violations(() => {});
  const start = { cause: Cause.POWER, reason: 0, scratch: new Uint32Array(8), crystalTicks: 0, seed: 1, onWatchdog, onLoader };
  const parts = buildChip({ start, flash: new FlashChip(flash, new Uint8Array(8)), violations, ...options });
  return { ...parts, violations };
}

/** The same, past the boot ROM: its processor stands still and `write` and `read` are the program's. */
function afterRom(options = {}) {
  const parts = cold({ flash: bootable([BRANCH_TO_SELF]), ...options });
  parts.lockstep.run(30_000 * TICKS_PER_US);
  const { chip, lockstep, time } = parts;
  assert.equal(chip.core.PC, BOOT2_AT);
  return { ...parts, write: (address, value) => chip.writeUint32(address, value >>> 0), read: (address) => chip.readUint32(address) >>> 0,
           wait: (us) => lockstep.run(time.cycle + us * TICKS_PER_US) };
}

/** Flash whose first 256 bytes are a boot2 of these instructions. */
function bootable(halfwords) {
  const flash = new Uint8Array(2 << 20).fill(0xff);
  const view = new DataView(flash.buffer);
  flash.fill(0, 0, 252);
  halfwords.forEach((halfword, n) => view.setUint16(2 * n, halfword, true));
  view.setUint32(252, crc32Mpeg2(flash.subarray(0, 252)), true);
  return flash;
}

const says = (violations, pattern) => assert.ok(violations.list.some((text) => pattern.test(text)), `${pattern}: ${violations.list}`);

describe('bus (2.1, 2.2; ARMv6-M A3.2.1)', () => {
  test('an access where nothing is, unaligned, or writing the boot ROM is a fault', () => {
    const b = new Bench();
    for (const access of [() => b.read(0x30000000), () => b.read(SRAM + 0x42000), () => b.write(0x60000000, 1), () => b.read(SRAM + 2),
                          () => b.chip.readUint16(SRAM + 1), () => b.write(0x40054011, 1), () => b.write(0x20, 0)]) {
      assert.throws(access, BusFault);
    }
  });

  test('a fault takes the processor to its HardFault handler, a second one in there locks it up', () => {
    const b = new Bench();
    b.chip.writeUint32(SRAM + 12, (SRAM + 0x200) | 1); // its vector
    b.chip.writeUint16(SRAM + 0x200, 0x6800); // ldr r0, [r0]: faults again
    b.chip.core.registers[0] = 0x30000000;
    b.processor([0x6800]);
    b.run(1);
    assert.equal(b.chip.core.IPSR, 3);
    assert.equal(b.chip.core.PC, SRAM + 0x200);
    b.run(100);
    assert.equal(b.chip.core.PM, true); // nothing gets in any more
    assert.equal(b.lockstep.awakeCycles < 100, true);
  });

  test('a DMA channel that the bus answers with an error halts with its flag, and nobody is chained (2.5.7)', () => {
    for (const [from, to, flag] of [[0x30000000, SRAM + 0x800, 1 << 30], [SRAM + 0x800, 0x60000000, 1 << 29]]) {
      const b = new Bench();
      b.write(0x50000000, from);
      b.write(0x50000004, to);
      b.write(0x50000008, 4);
      b.write(0x5000000c, (0x3f << 15) | (2 << 2) | 1);
      b.run(20);
      assert.equal(b.read(0x50000010) & ((7 << 29) | (1 << 24)), (0x80000000 | flag) | 0);
      assert.equal(b.read(0x50000008), 4);
    }
  });

  test('nothing is executed from where peripherals are (ARMv6-M B3.1)', () => {
    const b = new Bench();
    b.chip.writeUint32(SRAM + 12, (SRAM + 0x200) | 1);
    b.chip.core.PC = 0x50200000;
    b.run(1);
    assert.equal(b.chip.core.IPSR, 3);
  });

  test('registers ignore an access\'s width: a byte is written to all four lanes (2.1.4)', () => {
    const b = new Bench();
    b.chip.writeUint8(0x4005800c, 0xa5);
    assert.equal(b.read(0x4005800c), 0xa5a5a5a5);
    b.chip.writeUint16(0x4005800e, 0x1234);
    assert.equal(b.read(0x4005800c), 0x12341234);
    assert.equal(b.chip.readUint8(0x4005800d), 0x12);
  });

  test('reserved and read-only bits, and registers that are none, are noted with their section', () => {
    const b = new Bench();
    b.write(CLK_REF_CTRL, 0x80);
    says(b.violations, /2\.15\.7: CLOCKS CLK_REF_CTRL = 0x80: bits 0x80 are reserved/);
    b.write(0x40058008, 1);
    says(b.violations, /4\.7\.6: WATCHDOG REASON = 0x1/);
    b.write(0x40058000 + SET, 1);
    says(b.violations, /WATCHDOG CTRL = 0x1 by SET/);
    b.read(0x40054100);
    says(b.violations, /4\.6\.5: a read of TIMER \+ 0x100/);
    b.write(0x40034000, 1);
    says(b.violations, /UART0 \+ 0x0, which is not modelled/);
    assert.equal(b.violations.list.length, 5);
  });
});

test('blocks whose time would be another one are not used before clk_sys has its 125 MHz and the timer its tick', () => {
  const { write, wait, violations } = afterRom();
  write(RESETS + CLR, (1 << 21) | (1 << 10));
  wait(1);
  write(0x50200000, 1);
  says(violations, /3\.7: PIO0 CTRL is written without clk_sys at 125 MHz/);
  write(0x40054010, 1000);
  says(violations, /4\.6\.5: TIMER ALARM0 is written without the watchdog's tick at 1 MHz/);
});

describe('resets (2.14)', () => {
  test('a block that is held in reset loses what is written and reads as zeros', () => {
    const { write, read, violations } = afterRom();
    write(0x40030000, 0x1100); // BUSCTRL BUS_PRIORITY
    assert.equal(read(0x40030000), 0);
    says(violations, /2\.14: a write of BUSCTRL/);
  });

  test('it answers once RESET_DONE says so, and keeps nothing from before', () => {
    const { write, read, wait, violations } = afterRom();
    assert.equal(read(RESETS_DONE) & (1 << 1), 0);
    write(RESETS + CLR, 1 << 1);
    write(0x40030000, 0x1100);
    says(violations, /2\.14: a write of BUSCTRL/); // too early
    wait(1);
    assert.equal(read(RESETS_DONE) & (1 << 1), 1 << 1);
    write(0x40030000, 0x1100);
    assert.equal(read(0x40030000), 0x1100);
    write(RESETS + SET, 1 << 1);
    write(RESETS + CLR, 1 << 1);
    wait(1);
    assert.equal(read(0x40030000), 0);
  });

  test('SPI and USB come out of reset only when clk_peri and clk_usb run (2.14.1)', () => {
    const { write, read, wait } = afterRom();
    write(RESETS + CLR, (1 << 16) | (1 << 24));
    wait(100);
    assert.equal(read(RESETS_DONE) & ((1 << 16) | (1 << 24)), 0);
    write(0x40008048, 1 << 11); // clk_peri from clk_sys
    assert.equal(read(RESETS_DONE) & ((1 << 16) | (1 << 24)), 1 << 16);
  });
});

describe('clocks (2.15 to 2.18)', () => {
  const startCrystal = ({ write, wait }, delay, us) => {
    write(XOSC_STARTUP, delay);
    write(XOSC_CTRL, 0xfabaa0);
    wait(us);
  };

  test('STABLE comes after 256 periods of 12 MHz for each step of STARTUP (2.16.3)', () => {
    const bench = afterRom();
    startCrystal(bench, 300, 6390); // 6.4 ms
    assert.equal(bench.read(XOSC_STATUS) >>> 31, 0);
    bench.wait(20);
    assert.equal(bench.read(XOSC_STATUS) >>> 31, 1);
    assert.deepEqual(bench.violations.list, []);
  });

  test('a wait shorter than the crystal takes gives a clock that is none, and is noted when it is used', () => {
    const bench = afterRom({ crystal_ms: 6 });
    startCrystal(bench, 47, 1010);
    assert.equal(bench.read(XOSC_STATUS) >>> 31, 1);
    bench.write(CLK_REF_CTRL, 2);
    says(bench.violations, /2\.16\.3: clk_ref is given a crystal oscillator that is not stable yet/);
    assert.equal(bench.read(CLK_REF_SELECTED), 1); // still the ring oscillator
    bench.wait(6000);
    assert.equal(bench.read(CLK_REF_SELECTED), 4);
  });

  const pll = (bench, reference, feedback) => {
    startCrystal(bench, 300, 7000);
    bench.write(RESETS + CLR, 1 << 12);
    bench.wait(1);
    bench.write(PLL_SYS, reference);
    bench.write(PLL_SYS + 8, feedback);
    bench.write(PLL_SYS + 4 + CLR, 0x21);
  };

  test('a PLL locks within its ranges, after its time, and never outside (2.18.4)', () => {
    const good = afterRom();
    pll(good, 1, 125);
    assert.equal(good.read(PLL_SYS) >>> 31, 0);
    good.wait(200);
    assert.equal(good.read(PLL_SYS) >>> 31, 1);
    assert.deepEqual(good.violations.list, []);
    for (const [reference, feedback, reason] of [[1, 15, /feedback divider of 15/], [1, 62, /VCO of 744 MHz/], [1, 134, /VCO of 1608/],
                                                 [3, 200, /reference of 4 MHz/]]) {
      const bad = afterRom();
      pll(bad, reference, feedback);
      bad.wait(100_000);
      assert.equal(bad.read(PLL_SYS) >>> 31, 0);
      says(bad.violations, reason);
    }
  });

  test('clk_sys follows its multiplexer once the source runs, and a processor\'s cycle is then 8 ns', () => {
    const bench = afterRom({ roscHz: 5e6 });
    const { lockstep, time, chip } = bench;
    const cyclesIn = (ticks) => {
      bench.processorAt ??= [0x3701, 0xe7fd].forEach((halfword, n) => chip.writeUint16(SRAM + 2 * n, halfword)); // adds r7, #1; b .-2
      chip.core.PC = SRAM;
      chip.core.waiting = false;
      const before = chip.core.registers[7];
      lockstep.run(time.cycle + ticks);
      return (chip.core.registers[7] - before) >>> 0;
    };
    const slow = cyclesIn(30_000);
    pll(bench, 1, 125);
    bench.wait(200);
    bench.write(CLK_SYS_CTRL + SET, 1);
    assert.equal(bench.read(CLK_SYS_SELECTED), 1); // its output is still powered down
    says(bench.violations, /2\.15\.3\.2: clk_sys is switched to a clock of 0 MHz/);
    bench.write(PLL_SYS + 12, 0x62000);
    bench.write(PLL_SYS + 4 + CLR, 8);
    assert.equal(bench.read(CLK_SYS_SELECTED), 2);
    assert.ok(Math.abs(cyclesIn(30_000) / slow - 25) < 0.2, `${slow}`); // 125 MHz / 5 MHz
    bench.write(RESETS + SET, 1 << 12);
    says(bench.violations, /clk_sys has lost its source/);
    assert.equal(cyclesIn(30_000), 0);
  });
});

describe('watchdog (4.7)', () => {
  test('it counts ticks of clk_ref, two a tick (RP2040-E1): slower from the ring oscillator', () => {
    for (const roscHz of [2e6, 6.5e6, 12e6]) {
      let bitten = false;
      const { write, wait } = afterRom({ roscHz, onWatchdog: () => { bitten = true; } });
      write(PSM_WDSEL, 0x1fffc);
      write(WATCHDOG_TICK, 0x200 | 12);
      write(WATCHDOG_LOAD, 2 * 1000);
      write(WATCHDOG_CTRL, 1 << 30);
      const us = (1000 * 12e6) / roscHz;
      wait(us * 0.99);
      assert.equal(bitten, false, `${roscHz}`);
      wait(us * 0.02);
      assert.equal(bitten, true, `${roscHz}`);
    }
  });

  test('without a tick it never fires, and with a part of the chip selected it does not start it anew: both are noted', () => {
    const { write, violations } = afterRom();
    write(WATCHDOG_CTRL, 1 << 30);
    says(violations, /4\.7\.2: the watchdog is enabled and its tick does not run/);
    write(WATCHDOG_CTRL, 0x80000000);
    says(violations, /4\.7\.6: the watchdog fires while PSM_WDSEL is 0x0/);
  });
});

describe('flash and boot ROM (2.6.3, 2.8.1, 4.10)', () => {
  const configure = ({ write }, { baud = 4, control = (31 << 16) | (3 << 8), spi = (0x03 << 24) | (2 << 8) | (6 << 2) } = {}) => {
    write(SSI + 8, 0);
    write(SSI + 0x14, baud);
    write(SSI, control);
    write(SSI + 4, 0);
    write(SSI + 0xf4, spi);
    write(SSI + 8, 1);
  };

  test('flash answers by address when the SSI is set up for it, in the time that 64 bits take', () => {
    const flash = bootable([BRANCH_TO_SELF]);
    flash.set([1, 2, 3, 4], 0x1000);
    const bench = afterRom({ flash });
    configure(bench);
    bench.chip.core.extraCycles = 0;
    assert.equal(bench.read(0x10001000), 0x04030201);
    assert.equal(bench.chip.core.extraCycles, 64 * 4 + 8);
    bench.read(0x10001000);
    assert.equal(bench.chip.core.extraCycles, 64 * 4 + 8); // from the cache
    assert.deepEqual(bench.violations.list, []);
  });

  test('it does not when a field of the set-up is off, or the program holds its chip select', () => {
    const wrong = [{ control: 7 << 16 }, { control: 31 << 16 }, { spi: (0x03 << 24) | (2 << 8) | (8 << 2) },
                   { spi: (0xeb << 24) | (2 << 8) | (6 << 2) }, { spi: (0x03 << 24) | (2 << 8) | (6 << 2) | (1 << 11) }];
    for (const setup of wrong) {
      const bench = afterRom();
      configure(bench, setup);
      assert.equal(bench.read(0x10000000), 0xffffffff);
      says(bench.violations, /2\.6\.3: flash is read by address at 0x0 while the SSI is not set up/);
    }
    const held = afterRom();
    configure(held);
    held.write(0x4001800c, 2 << 8);
    held.read(0x10000000);
    says(held.violations, /2\.6\.3/);
  });

  test('a register of the SSI that is written while it is enabled, and an odd BAUDR, are noted', () => {
    const bench = afterRom();
    bench.write(SSI + 0x14, 4);
    says(bench.violations, /SSI \+ 0x14 is written while the SSI is enabled/);
    configure(bench, { baud: 3 });
    says(bench.violations, /BAUDR = 3/);
  });

  test('the ROM copies 256 bytes to SRAM5 and starts them if their CRC is right, else it looks 128 times and leaves', () => {
    const good = cold({ flash: bootable([0x2001, BRANCH_TO_SELF]) });
    good.lockstep.run(20_000 * TICKS_PER_US);
    assert.equal(good.chip.readUint16(BOOT2_AT), 0x2001);
    assert.equal(good.chip.core.registers[0], 1); // and it ran
    const damaged = bootable([0x2001, BRANCH_TO_SELF]);
    damaged[200] ^= 1;
    for (const flash of [damaged, undefined]) {
      const said = [];
      const bad = cold({ flash, onLoader: (why) => said.push(why) });
      bad.lockstep.run(400_000 * TICKS_PER_US);
      assert.deepEqual(said, []); // 128 attempts of 4 ms
      bad.lockstep.run(700_000 * TICKS_PER_US);
      assert.match(said[0], /after 128 attempts/);
      assert.deepEqual(bad.violations.list, []);
    }
  });
});
