// SPDX-License-Identifier: MIT
// Which signal is on which GPIO of a board: boards.json, made by firmware/tools/board_pins.py from firmware/boards/.
import { readFileSync } from 'node:fs';

const BOARDS = JSON.parse(readFileSync(new URL('boards.json', import.meta.url), 'utf8'));

/**
 * @typedef {object} BoardPins
 * @property {string} name
 * @property {Record<string, number>} outputs GPIO by signal, as in traces
 * @property {Record<string, number>} stopInputs stop everything unless they are high: emergency stop, healthy drivers
 * @property {number} genlock the input whose rise can start play
 * @property {number[]} triggers GPIOs of TRIG0 to TRIG3
 * @property {number} mask bit n: GPIO n is an output
 * @property {{spi: number, pins: Record<string, number>} | null} can the CAN controller's SPI block and GPIOs
 */

/**
 * @returns {BoardPins}
 * @throws {Error} naming the boards there are
 */
export function boardPins(name) {
  const board = Object.hasOwn(BOARDS, name) ? BOARDS[name] : null;
  if (board === null) throw new Error(`no board "${name}"; there are: ${Object.keys(BOARDS).join(', ')}`);
  const { outputs, stopInputs, inputs } = board;
  return Object.freeze({
    name, outputs, stopInputs, genlock: inputs.GENLOCK, can: board.can,
    triggers: [outputs.TRIG0, outputs.TRIG1, outputs.TRIG2, outputs.TRIG3],
    mask: Object.values(outputs).reduce((mask, gpio) => mask | (1 << gpio), 0),
  });
}
