// SPDX-License-Identifier: MIT
// One RP2040 from a reset to the next: rp2040js with the parts that time or the program would notice put right.
import { RP2040 } from 'rp2040js';
import { attachBootRom } from './boot_rom.mjs';
import { Dma } from './dma.mjs';
import { attachFlash } from './flash.mjs';
import { Lockstep } from './lockstep.mjs';
import { Pads } from './pads.mjs';
import { Pio } from './pio.mjs';
import { correctProcessor } from './processor.mjs';
import { correctSio } from './sio.mjs';
import { Spi } from './spi.mjs';
import { correctSystem } from './system.mjs';
import { Timer } from './timer.mjs';
import { UsbController } from './usb_controller.mjs';

const PIO_PAGES = [0x50200, 0x50300];
const DMA_PAGE = 0x50000;
const TIMER_PAGE = 0x40054;
const IO_BANK0_PAGE = 0x40014;
const PADS_BANK0_PAGE = 0x4001c;
const SPI_PAGES = [0x4003c, 0x40040];
const USB_PAGE = 0x50110;

/**
 * Cycles are those of clk_sys and count from the reset; one is 8 ns from the first on, as if the program found its
 * 125 MHz already running. Both cores' flash and SRAM answer without wait states, and there is one core.
 * @param {{naive?: boolean, start: object, logger: object, violations: import('./violations.mjs').Violations}} options `start` as correctSystem takes it, and the flash
 *   chip's `uniqueId`; `violations` is told what a chip would not forgive
 */
export function buildChip({ naive = false, start, logger, violations }) {
  const time = { cycle: 0 };
  const chip = new RP2040();
  chip.logger = logger;
  chip.violations = violations;
  correctProcessor(chip);
  chip.dma = new Dma(chip);
  chip.peripherals[DMA_PAGE] = chip.dma;
  const pads = new Pads(time);
  chip.pio = PIO_PAGES.map((page, index) => {
    chip.peripherals[page] = new Pio(chip, { index, pads, time, naive });
    return chip.peripherals[page];
  });
  chip.usbCtrl = new UsbController(chip);
  chip.peripherals[USB_PAGE] = chip.usbCtrl;
  chip.spi = SPI_PAGES.map((page, index) => (chip.peripherals[page] = new Spi(chip, index)));
  chip.peripherals[TIMER_PAGE] = new Timer(chip);
  correctSio(chip, time);
  correctSystem(chip, start);
  attachFlash(chip, start.uniqueId);
  attachBootRom(chip);
  pads.attach(chip);
  chip.peripherals[IO_BANK0_PAGE] = pads.ioBank;
  chip.peripherals[PADS_BANK0_PAGE] = pads.padsBank;
  return { chip, pads, time, lockstep: new Lockstep(chip, pads, time, naive) };
}

/** rp2040js' messages, each text once: it warns of the same register at every access. */
export function onceLogger(write) {
  const said = new Set();
  const say = (name, message) => {
    const text = `${name}: ${message}`;
    if (said.size < 100 && !said.has(text)) write(text);
    said.add(text);
  };
  return { debug: () => {}, info: () => {}, warn: say, error: say };
}
