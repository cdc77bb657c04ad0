#!/usr/bin/env node
// SPDX-License-Identifier: MIT
// The emulated board: runs the firmware image on an RP2040 model and connects it to a host and a virtual stage.
import { Board } from './board_model.mjs';
import { CanBus } from './can/can_bus.mjs';
import { CanSocket } from './can/can_socket.mjs';
import { LampNodes } from './can/lamp_nodes.mjs';
import { ExposureRecorder } from './exposures.mjs';
import { ExposureSocket } from './exposure_socket.mjs';
import { readImage } from './image.mjs';
import { parseOptions, USAGE } from './options.mjs';
import { Pacer } from './pacer.mjs';
import { boardPins } from './pins.mjs';
import { Violations } from './chip/violations.mjs';
import { UsbSocket } from './usb/usb_socket.mjs';
import { VcdWriter } from './vcd.mjs';

const TICK_HZ = 125_000_000;
const EXIT_VIOLATION = 3;
const PLUG_TICKS = TICK_HZ / 2; // for a device that was plugged in to be found and configured, the host's waiting included
const PARENT_MS = 500;

async function main() {
  const parent = process.ppid; // before anything is awaited: it may be killed while this starts
  const options = parseOptions(process.argv.slice(2));
  if (options.help) {
    process.stdout.write(USAGE);
    return;
  }
  const log = (text) => process.stderr.write(`board: ${text}\n`);
  const image = readImage(options.image, options['flash-as-is']);
  const pins = boardPins(options.board ?? boardOf(image));
  const vcd = options.vcd ? new VcdWriter(options.vcd, pins) : null;
  const stage = options.exposures ? await ExposureSocket.open(options.exposures, options.pace === 'wall') : null;
  const recorder = stage
    ? new ExposureRecorder(options.chainBits, (exposure) => stage.send(exposure), pins, options.activeLow) : null;

  const canBus = options.can ? new CanBus(options.canBitRate) : null;
  const lampNodes = options.lampNodes ? new LampNodes(canBus, options.chainBits, pins) : null;
  const violations = new Violations(log);
  const board = new Board(image, {
    violations,
    canBus,
    pins,
    naive: options.naive,
    stepping: options.stepping,
    busyHub: options.busyHub,
    seed: options.seed,
    uniqueId: options.boardId,
    roscHz: options.roscHz,
    crystal_ms: options.crystal_ms,
    sioOut: options.sioOut,
    injections: options.inject,
    lampNodes,
    log,
    onEdge: (tick, levels) => {
      vcd?.edge(tick, levels);
      recorder?.edge(tick, levels);
      lampNodes?.edge(tick, levels);
    },
    onReset: (cause) => {
      usb?.drop();
      stage?.send({ type: 'reset', cause });
    },
    onUnplug: () => usb?.drop(),
  });
  const can = canBus ? new CanSocket(options.can, canBus, { onActivity: () => pacer.wake(), log }) : null;
  const pacer = new Pacer(board, { pace: options.pace, ticksLimit: options.cyclesLimit, stage, can, lampNodes,
                                   openSince: () => recorder?.openSince ?? Infinity });
  const usb = options.usb ? new UsbSocket(options.usb, {
    host: () => board.usbHost,
    onActivity: () => pacer.wake(),
    onClient: (connected) => {
      stage?.send({ type: 'usb', connected });
      if (connected) pacer.wake(PLUG_TICKS);
    },
    log,
  }) : null;
  if (stage) stage.now = () => Math.min(board.tick, recorder.openSince);
  await can?.listen();
  await usb?.listen(); // last: whoever can reach it finds all of the board

  stage?.send({ type: 'hello', tick_hz: TICK_HZ, chain_bits: options.chainBits, firmware: image.name });
  for (const signal of ['SIGTERM', 'SIGINT']) process.on(signal, () => pacer.stop());
  whenOrphaned(parent, () => {
    log('whoever started this board has gone: ending');
    pacer.stop();
  });
  await pacer.run();

  const wall_late_ms = Math.round(pacer.statistics.wall_late_us / 1000);
  if (wall_late_ms > 0) log(`behind the wall clock by ${wall_late_ms} ms in all: this machine is too busy`);
  usb?.close();
  can?.close();
  vcd?.close(board.tick);
  await stage?.end();
  if (options.stats) {
    const statistics = { ...pacer.statistics, ...board.handlerTimes, boot: board.boot, pads: board.padDrives, dropped: stage?.dropped ?? 0,
                         can: board.canTiming, violations: violations.list };
    process.stderr.write(`${JSON.stringify(statistics)}\n`);
  }
  if (violations.list.length > 0) process.exitCode = EXIT_VIOLATION;
}

/** Calls once `parent`, the process that started this one, has ended, however it did. */
function whenOrphaned(parent, call) {
  const look = setInterval(() => {
    if (process.ppid === parent) return;
    clearInterval(look);
    call();
  }, PARENT_MS);
  look.unref();
}

function boardOf(image) {
  if (image.label === null) throw new Error(`${image.name}: does not say which board it is for; say so with --board`);
  return image.label.board;
}

main().catch((error) => {
  process.stderr.write(`board: ${error.message}\n`);
  process.exitCode = 1;
});
