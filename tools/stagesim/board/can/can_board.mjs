// SPDX-License-Identifier: MIT
// The CAN controller on its board: SPI bytes as long as they take, chip select, interrupt and reset pins.
import { Mcp2515 } from './mcp2515.mjs';

const SPI_HZ_MAX = 10_000_000; // Microchip DS20001801J, table 13-6

export class CanBoard {
  #controller;
  #pins;
  #spi;
  #violations;
  #drive;
  #levels = 0;

  /**
   * @param {import('./can_bus.mjs').CanBus} bus
   * @param {{spi: number, pins: Record<string, number>}} wiring of the board
   * @param {{drive: (gpio: number, level: boolean) => void, violations: import('../chip/violations.mjs').Violations}} board
   */
  constructor(bus, wiring, { drive, violations }) {
    this.bus = bus;
    this.#pins = wiring.pins;
    this.#spi = wiring.spi;
    this.#violations = violations;
    this.#drive = drive;
    this.#controller = new Mcp2515(bus);
    this.#controller.onInterrupt = (level) => drive(this.#pins.CAN_INTERRUPT, level);
  }

  /** Connects to the RP2040 that runs from now on. The controller and its bus go on. */
  attach(chip) {
    const spi = chip.spi[this.#spi];
    this.bus.attach(chip.clock);
    this.#controller.attach(chip.clock);
    this.#drive(this.#pins.CAN_INTERRUPT, !this.#controller.interrupting);
    let sent = 0;
    const done = chip.clock.createAlarm(() => spi.completeTransmit(this.#controller.exchange(sent)));
    spi.onTransmit = (byte) => {
      if (spi.clockFrequency > SPI_HZ_MAX || spi.dataBits !== 8) {
        this.#violations.note('Microchip DS20001801J 13', `SPI of ${spi.dataBits} bits at ${Math.round(spi.clockFrequency / 1000)} kHz: ` +
          `the controller takes 8 bits at ${SPI_HZ_MAX / 1000} kHz at most`);
      }
      sent = byte;
      done.schedule(8e9 / spi.clockFrequency);
    };
  }

  get bitTiming() {
    return this.#controller.bitTiming;
  }

  /** The board's pins have changed. A pin that nobody drives is pulled to rest by the module. */
  pinsChanged(levels, driven) {
    const { CAN_CS, CAN_RESET } = this.#pins;
    const low = driven & ~levels;
    const changed = low ^ this.#levels;
    this.#levels = low;
    if (changed & (1 << CAN_CS)) this.#controller.select((low & (1 << CAN_CS)) !== 0);
    if (changed & low & (1 << CAN_RESET)) this.#controller.reset();
  }
}
