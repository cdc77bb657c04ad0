// SPDX-License-Identifier: MIT
// Faults that tests inject into the emulated board, at a tick or at a trigger.
import { starveDma } from './dma.mjs';
import { raiseHardFault } from './processor.mjs';
import { Cause } from './system.mjs';

/** What each fault does to a Board. */
const FAULTS = {
  reset: (board) => board.reset(Cause.RUN_PIN),
  watchdog: (board) => board.reset(Cause.WATCHDOG),
  hang: (board) => board.hang(),
  hardfault: (board) => raiseHardFault(board.chip),
  starve: (board) => starveDma(board.chip),
  unplug: (board) => board.unplug(),
  estop: (board) => board.drive(board.pins.stopInputs.ESTOP, false),
  overtemperature: (board) => board.drive(board.pins.stopInputs.OVER_TEMPERATURE, false),
  openlamp: (board) => board.drive(board.pins.stopInputs.OPEN_LAMP, false),
  genlock: (board) => board.drive(board.pins.genlock, true),
  genlockfall: (board) => board.drive(board.pins.genlock, false),
  release: (board) => Object.values(board.pins.stopInputs).forEach((gpio) => board.drive(gpio, true)),
};

/**
 * @param {string} text FAULT@TICK or FAULT@trigger:N
 * @returns {{name: string, inject: (board: object) => void, tick: number, trigger: number}} the unused one Infinity
 */
export function parseInjection(text) {
  const match = /^([a-z]+)@(?:(\d+)|trigger:(\d+))$/.exec(text);
  if (!match || !FAULTS[match[1]]) {
    throw new Error(`--inject ${text}: write FAULT@TICK or FAULT@trigger:N with one of ${Object.keys(FAULTS).join(', ')}`);
  }
  return { name: match[1], inject: FAULTS[match[1]], tick: match[2] ? Number(match[2]) : Infinity,
           trigger: match[3] ? Number(match[3]) : Infinity };
}
