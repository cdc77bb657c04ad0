// SPDX-License-Identifier: MIT
// The command line of the emulated board.
import { parseArgs } from 'node:util';
import { STEPPINGS } from './chip/sysinfo.mjs';
import { parseInjection } from './injections.mjs';

export const USAGE = `usage: node board.mjs --image FILE [options]

Runs the board's firmware, the same image that is flashed, on an emulated RP2040.

  --image FILE        firmware, .elf or .uf2
  --board NAME        whose pins to connect: pico or feather_can (default: the board that the image says it is for)
  --flash-as-is       take an image that the boot ROM would not start: the board is then in its boot loader
  --rosc-mhz F        of the ring oscillator from which it boots, 1.8 to 12 (default 6.5)
  --crystal-ms F      that the crystal takes to swing (default 6)
  --sio-out N         what SIO's GPIO_OUT holds at the start, as a debugger that resets nothing may leave it (default 0)
  --usb SOCKET        listen there for a USB client (docs/architecture.md, "USB transfers over a socket")
  --busy-hub          on the cable's hub, other devices' packets never leave the bus idle
  --chip-revision R   the chip's stepping: b0, b1 or b2 (default b2)
  --can SOCKET        fit a CAN controller, and listen there for nodes of its bus ("CAN frames over a socket")
  --can-kbit-s N      the bus's bit rate (default 1000)
  --lamp-nodes        put the lamps' drivers on that bus, which tell temperature, current and faults each second
  --exposures SOCKET  connect there and send every exposure as a JSON line
  --vcd FILE          write the board's signals as a value change dump
  --pace virtual      time stops while the reader of exposures is behind or nothing is to be done (default)
  --pace wall         as fast as the wall clock, or slower where the machine is busy (told at the end); exposures that nobody
                      takes in time are dropped and counted
  --active-low N      the camera on trigger N exposes while its pin is low; may be given several times
  --chain-bits N      length of the lamps' shift chain (default 176)
  --naive             step every cycle: slow, for checking the fast way
  --cycles-limit N    end after N ticks of 8 ns
  --seed N            of the chip's random bits (default 1)
  --board-id HEX      the flash chip's unique number, 16 digits
  --inject FAULT@WHEN WHEN is a tick, or trigger:N or trigger:N+TICKS for the N-th rise of any trigger;
                      may be given several times.
                      reset, watchdog, hardfault; hang: the main program stops, lockup: handlers, too; starve: DMA,
                      or starve:CHANNEL; flip:ADDRESS:BIT of memory, upset:BIT of the timeline's counter; unplug,
                      suspend and busreset of USB; sleep and resume of its host; buserror garbles the next bulk IN,
                      fatalbuserror so that the controller locks up (RP2040-E15), usblockup locks it up at once; estop,
                      overtemperature, openlamp pull that input low, release lets all go high; genlock and genlockfall
                      are edges of that input; genlockclock:TICKS, openlampclock:TICKS and canclock:TICKS let an input
                      change that often; lampfault:NODE:BITS (wire.h, ols_lamp_fault), lampopen:NODE:OUTPUT and
                      lampsilent:NODE of a lamp node; short:GPIO:LEVEL of a pad, whatever drives it, unshort:GPIO
  --stats             print ticks, speed, dropped lines and violations as JSON at the end
  --help

exit codes: 0; 1 an error; 3 the program did what a chip does not forgive ("violation: " on stderr)

example: node board.mjs --image build/firmware/stage.elf --usb /run/user/1000/board.sock --vcd trace.vcd
`;

/** @throws {Error} with what to do about it */
export function parseOptions(args) {
  const text = { type: 'string' };
  const flag = { type: 'boolean', default: false };
  let values;
  try {
    ({ values } = parseArgs({
      args,
      options: {
        image: text, board: text, usb: text, can: text, 'can-kbit-s': { ...text, default: '1000' }, exposures: text, vcd: text,
        'busy-hub': flag, 'chip-revision': { ...text, default: 'b2' }, pace: { ...text, default: 'virtual' },
        'chain-bits': { ...text, default: '176' }, naive: flag, 'cycles-limit': text, seed: { ...text, default: '1' },
        'board-id': { ...text, default: '4f4c532d56495254' },
        inject: { type: 'string', multiple: true, default: [] },
        'lamp-nodes': flag,
        'active-low': { type: 'string', multiple: true, default: [] }, stats: flag, help: flag, 'flash-as-is': flag,
        'rosc-mhz': { ...text, default: '6.5' }, 'crystal-ms': { ...text, default: '6' }, 'sio-out': { ...text, default: '0' },
      },
    }));
  } catch (error) {
    throw new Error(`${error.message}; see --help`);
  }
  if (values.help) return values;
  if (!values.image) throw new Error('--image is missing; see --help');
  if (!['virtual', 'wall'].includes(values.pace)) throw new Error(`--pace ${values.pace}: it is virtual or wall`);
  if (!STEPPINGS.includes(values['chip-revision'])) {
    throw new Error(`--chip-revision ${values['chip-revision']}: it is one of ${STEPPINGS.join(', ')}`);
  }
  const chainBits = integer('--chain-bits', values['chain-bits'], 4);
  if (chainBits % 4 !== 0) throw new Error(`--chain-bits ${chainBits}: not a multiple of 4`);
  if (values['lamp-nodes'] && !values.can) throw new Error('--lamp-nodes: they are on the CAN bus; give --can');
  const inject = values.inject.map(parseInjection);
  if (!values['lamp-nodes'] && inject.some(({ name }) => name.startsWith('lamp'))) {
    throw new Error('--inject lamp...: there are no lamp nodes; give --lamp-nodes');
  }
  return {
    ...values,
    lampNodes: values['lamp-nodes'],
    chainBits,
    stepping: values['chip-revision'],
    busyHub: values['busy-hub'],
    canBitRate: 1000 * integer('--can-kbit-s', values['can-kbit-s'], 1),
    seed: integer('--seed', values.seed, 0),
    roscHz: 1e6 * number('--rosc-mhz', values['rosc-mhz'], 1.8, 12),
    sioOut: integer('--sio-out', values['sio-out'], 0),
    crystal_ms: number('--crystal-ms', values['crystal-ms'], 0, 1e6),
    cyclesLimit: values['cycles-limit'] ? integer('--cycles-limit', values['cycles-limit'], 1) : Infinity,
    activeLow: values['active-low'].map((text) => trigger(text)),
    boardId: identity(values['board-id']),
    inject,
  };
}

function identity(text) {
  if (!/^[0-9a-f]{16}$/i.test(text)) throw new Error(`--board-id ${text}: not 16 hex digits`);
  return Uint8Array.from(Buffer.from(text, 'hex'));
}

function trigger(text) {
  if (!/^[0-3]$/.test(text)) throw new Error(`--active-low ${text}: not a trigger, 0 to 3`);
  return Number(text);
}

function number(name, text, least, most) {
  const value = Number(text);
  if (text.trim() === '' || !(value >= least && value <= most)) throw new Error(`${name} ${text}: not a number from ${least} to ${most}`);
  return value;
}

function integer(name, text, least) {
  const value = Number(text);
  if (!Number.isSafeInteger(value) || value < least) throw new Error(`${name} ${text}: not a whole number >= ${least}`);
  return value;
}
