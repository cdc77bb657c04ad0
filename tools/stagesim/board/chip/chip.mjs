// SPDX-License-Identifier: MIT
// One RP2040 from a reset to the next: rp2040js with the parts that time or the program would notice put right.
import { RP2040 } from 'rp2040js';
import { attachBootRom, bootRom } from './boot_rom.mjs';
import { Bus } from './bus.mjs';
import { Clocks } from './clocks.mjs';
import { Dma } from './dma.mjs';
import { Lockstep } from './lockstep.mjs';
import { CrystalOscillator, Pll } from './oscillators.mjs';
import { Pads } from './pads.mjs';
import { Pio } from './pio.mjs';
import { correctProcessor } from './processor.mjs';
import { QspiPins } from './qspi_pins.mjs';
import { Resets } from './resets.mjs';
import { Ssi } from './ssi.mjs';
import { StoredRegisters } from './stored_registers.mjs';
import { correctSio } from './sio.mjs';
import { Spi } from './spi.mjs';
import { revisionOf, SysInfo } from './sysinfo.mjs';
import { ChipReset, RingOscillator } from './system.mjs';
import { Timer } from './timer.mjs';
import { UsbController } from './usb_controller.mjs';
import { Watchdog } from './watchdog.mjs';
import { Xip, XipControl } from './xip.mjs';

const PAGES = { XIP_CTRL: 0x14000, XIP_SSI: 0x18000, SYSINFO: 0x40000, CLOCKS: 0x40008, RESETS: 0x4000c, PSM: 0x40010, IO_BANK0: 0x40014,
                IO_QSPI: 0x40018, PADS_BANK0: 0x4001c, PADS_QSPI: 0x40020, XOSC: 0x40024, PLL_SYS: 0x40028, PLL_USB: 0x4002c, BUSCTRL: 0x40030, SPI0: 0x4003c, SPI1: 0x40040, TIMER: 0x40054,
                WATCHDOG: 0x40058, ROSC: 0x40060, VREG_AND_CHIP_RESET: 0x40064, DMA: 0x50000, USBCTRL: 0x50110, PIO0: 0x50200, PIO1: 0x50300 };
export const ROSC_HZ = 6_500_000; // 2.17.1; 1.8 to 12 MHz over chips, voltage and temperature
export const CRYSTAL_MS = 6; // that a Pico's crystal takes to swing; others take longer

/**
 * One RP2040 as it comes out of reset: its processor is about to run the boot ROM. Time is counted in ticks of 8 ns, cycles of
 * clk_sys at 125 MHz; before clk_sys runs so fast, a cycle of the processor lasts several. There is one core.
 * @param {object} options
 * @param {boolean} options.naive steps every tick
 * @param {{cause: string, reason: number, scratch: Uint32Array, crystalTicks: number, seed: number, onWatchdog: () => void,
 *   onLoader: (reason: string) => void}} options.start why it starts, and what it finds in the registers that outlive a reset
 * @param {import('./flash_chip.mjs').FlashChip} options.flash
 * @param {number} options.roscHz
 * @param {number} options.crystal_ms
 * @param {string} options.stepping
 * @param {import('./violations.mjs').Violations} options.violations is told what a chip would not forgive
 */
export function buildChip({ naive = false, start, flash, roscHz = ROSC_HZ, crystal_ms = CRYSTAL_MS, stepping = 'b2',
                            violations }) {
  const time = { cycle: 0 };
  const chip = new RP2040();
  chip.logger = strictLogger(violations);
  chip.violations = violations;
  correctProcessor(chip);
  const pads = new Pads(time);
  const put = (name, peripheral) => {
    chip.peripherals[PAGES[name]] = peripheral;
    return peripheral;
  };
  chip.dma = put('DMA', new Dma(chip));
  chip.pio = [0, 1].map((index) => put(`PIO${index}`, new Pio(chip, { index, pads, time, naive })));
  const revision = revisionOf(stepping);
  put('SYSINFO', new SysInfo(chip, revision));
  chip.usbCtrl = put('USBCTRL', new UsbController(chip, time, revision));
  const clocks = putClocks(chip, put, time, { roscHz, crystal_ms, start });
  const resets = put('RESETS', new Resets(chip, time, clocks));
  const ssi = putFlash(chip, put, time, clocks, flash);
  const xip = new Xip(chip, ssi);
  put('XIP_CTRL', new XipControl(chip, xip));
  put('PSM', new StoredRegisters(chip, 'PSM'));
  put('BUSCTRL', new StoredRegisters(chip, 'BUSCTRL', { 0x4: 1 })); // nobody contends for the bus here
  put('VREG_AND_CHIP_RESET', new ChipReset(chip, start.cause));
  chip.spi = [0, 1].map((index) => put(`SPI${index}`, new Spi(chip, index)));
  put('TIMER', new Timer(chip));
  correctSio(chip, time);
  attachBootRom(chip);
  pads.attach(chip);
  put('IO_BANK0', pads.ioBank);
  put('PADS_BANK0', pads.padsBank);
  new Bus(chip, { resets, xip, clocks, watchdog: chip.peripherals[PAGES.WATCHDOG] });
  const lockstep = new Lockstep(chip, pads, time, clocks, naive);
  chip.core.waiting = true;
  lockstep.begin(bootRom(chip, start.onLoader));
  return { chip, pads, time, lockstep, clocks, resets };
}

function putClocks(chip, put, time, { roscHz, crystal_ms, start }) {
  const xosc = put('XOSC', new CrystalOscillator(chip, time, crystal_ms));
  if (start.crystalTicks > 0) xosc.keepRunning(start.crystalTicks);
  const [pllSys, pllUsb] = ['PLL_SYS', 'PLL_USB'].map((name) => put(name, new Pll(chip, name, time, xosc)));
  const rosc = put('ROSC', new RingOscillator(chip, start.seed, roscHz));
  const clocks = put('CLOCKS', new Clocks(chip, { rosc, xosc, pllSys, pllUsb }));
  const { reason, scratch, onWatchdog } = start;
  put('WATCHDOG', new Watchdog(chip, clocks, { reason, scratch, onReset: onWatchdog }));
  return clocks;
}

function putFlash(chip, put, time, clocks, flash) {
  const pins = put('IO_QSPI', new QspiPins(chip, flash));
  put('PADS_QSPI', pins.pads);
  return put('XIP_SSI', new Ssi(chip, time, clocks, pins));
}

/** For a test bench of single parts: as after a boot, every block out of reset, clk_sys and clk_usb from their PLLs. */
export function assumeBooted({ chip, lockstep, clocks, resets }) {
  lockstep.begin(null);
  chip.core.waiting = false;
  chip.peripherals[PAGES.XOSC].keepRunning(Infinity);
  for (const name of ['PLL_SYS', 'PLL_USB']) chip.peripherals[PAGES[name]].assumeLocked(name === 'PLL_SYS' ? [125, 6, 2] : [100, 5, 5]);
  clocks.assumeRunning();
  chip.peripherals[PAGES.WATCHDOG].writeUint32(0x2c, 1 << 9 | 12); // TICK: microseconds
  resets.assumeReleased();
}

/** What rp2040js warns of, an instruction or register that it does not have or a use that it takes for wrong, is a violation. */
function strictLogger(violations) {
  const note = (name, message) => violations.note('rp2040js', `${name}: ${message}`);
  return { debug: () => {}, info: () => {}, warn: note, error: note };
}
