// SPDX-License-Identifier: MIT
// The board's signals and their GPIOs (docs/architecture.md, "Pins").
export const PINS = Object.freeze({
  DATA: 2, CLK: 3, LATCH: 4, LIGHT_EN: 5, TRIG0: 6, TRIG1: 7, TRIG2: 8, TRIG3: 9, SYNC: 10, READY: 11,
  PHOTO: 28,
});
/** Inputs that stop everything unless they are high: wired to a closed emergency stop and healthy drivers. */
export const STOP_INPUTS = Object.freeze({ ESTOP: 12, OVER_TEMPERATURE: 13, OPEN_LAMP: 14 });
/** The input whose rise can start play. */
export const GENLOCK = 15;
export const TRIGGERS = Object.freeze([PINS.TRIG0, PINS.TRIG1, PINS.TRIG2, PINS.TRIG3]);
export const PIN_MASK = Object.values(PINS).reduce((mask, gpio) => mask | (1 << gpio), 0);
