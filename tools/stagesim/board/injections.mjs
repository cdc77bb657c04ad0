// SPDX-License-Identifier: MIT
// Faults that tests inject into the emulated board, at a tick or at a trigger.
import { starveDma } from './chip/dma.mjs';
import { raiseHardFault } from './chip/processor.mjs';
import { Cause } from './chip/system.mjs';

/** What each fault does to a Board, with the numbers given after its name. */
const FAULTS = {
  reset: (board) => board.reset(Cause.RUN_PIN),
  watchdog: (board) => board.reset(Cause.WATCHDOG),
  hang: (board) => board.hang(),
  lockup: (board) => board.lockUp(),
  hardfault: (board) => raiseHardFault(board.chip),
  starve: (board, channel) => starveDma(board.chip, channel),
  upset: (board, bit) => board.chip.pio[0].machines[0].upset(bit, board.cycle),
  flip: (board, address, bit) => board.chip.writeUint8(address, board.chip.readUint8(address) ^ (1 << bit)),
  unplug: (board) => board.unplug(),
  suspend: (board) => board.usbHost.suspend(),
  busreset: (board) => board.usbHost.resetBus(),
  sleep: (board) => board.usbHost.sleep(),
  resume: (board) => board.usbHost.resume(),
  buserror: (board) => board.usbHost.injectBusError(false),
  fatalbuserror: (board) => board.usbHost.injectBusError(true),
  usblockup: (board) => board.chip.usbCtrl.lockUp(),
  estop: (board) => board.drive(board.pins.stopInputs.ESTOP, false),
  overtemperature: (board) => board.drive(board.pins.stopInputs.OVER_TEMPERATURE, false),
  openlamp: (board) => board.drive(board.pins.stopInputs.OPEN_LAMP, false),
  genlock: (board) => board.drive(board.pins.genlock, true),
  genlockfall: (board) => board.drive(board.pins.genlock, false),
  genlockclock: (board, ticks) => board.oscillate(board.pins.genlock, ticks),
  openlampclock: (board, ticks) => board.oscillate(board.pins.stopInputs.OPEN_LAMP, ticks),
  canclock: (board, ticks) => board.oscillate(board.pins.can.pins.CAN_INTERRUPT, ticks),
  short: (board, gpio, level) => board.short(gpio, level === 1),
  unshort: (board, gpio) => board.short(gpio, null),
  lampfault: (board, node, faults) => board.lampNodes.setFault(node, faults),
  lampopen: (board, node, output) => board.lampNodes.open(node, output),
  lampsilent: (board, node) => board.lampNodes.silence(node),
  release: (board) => Object.values(board.pins.stopInputs).forEach((gpio) => board.drive(gpio, true)),
};
/** How many numbers a fault takes, at least and at most, and what each must be below; none where it is not here. */
const NUMBERS = { starve: { least: 0, below: [12] }, upset: { least: 1, below: [32] },
                  genlockclock: { least: 1, below: [1e9] }, openlampclock: { least: 1, below: [1e9] },
                  canclock: { least: 1, below: [1e9] },
                  flip: { least: 2, below: [0x20042000, 8] }, short: { least: 2, below: [30, 2] },
                  lampfault: { least: 2, below: [16, 256] }, lampopen: { least: 2, below: [16, 16] },
                  lampsilent: { least: 1, below: [16] },
                  unshort: { least: 1, below: [30] } };

/**
 * @param {string} text FAULT[:NUMBER...]@TICK, FAULT[:NUMBER...]@trigger:N or the latter with +TICKS
 * @returns {{name: string, inject: (board: object) => void, tick: number, trigger: number, delay: number}} of tick and
 *   trigger, the unused one is Infinity; delay is in ticks after the trigger
 */
export function parseInjection(text) {
  const match = /^([a-z]+)((?::(?:0x[0-9a-f]+|\d+))*)@(?:(\d+)|trigger:(\d+)(?:\+(\d+))?)$/.exec(text);
  if (!match || !FAULTS[match[1]]) {
    throw new Error(`--inject ${text}: write FAULT@TICK or FAULT@trigger:N[+TICKS] with one of ${Object.keys(FAULTS).join(', ')}`);
  }
  const [, name, list, tick, trigger, delay] = match;
  const numbers = list.split(':').slice(1).map(Number);
  const { least, below } = NUMBERS[name] ?? { least: 0, below: [] };
  if (numbers.length < least || numbers.length > below.length || numbers.some((number, n) => number >= below[n])) {
    throw new Error(`--inject ${text}: ${name} takes ${below.length} numbers, below ${below.join(' and ') || 'nothing'}`);
  }
  return { name, inject: (board) => FAULTS[name](board, ...numbers), tick: tick ? Number(tick) : Infinity,
           trigger: trigger ? Number(trigger) : Infinity, delay: Number(delay ?? 0) };
}
