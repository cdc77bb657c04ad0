// SPDX-License-Identifier: MIT
// The nine PIO instructions: what each does to a state machine in one cycle (RP2040 datasheet 3.4).
import { Stall } from './pio_stall.mjs';

/**
 * Runs `opcode` on `machine` in `cycle`, without its side-set and delay. Returns what it waits for, or Stall.NONE when
 * it is done.
 * @param {import('./pio_machine.mjs').PioMachine} machine
 */
export function execute(machine, opcode, cycle) {
  const low = opcode & 0xff;
  switch (opcode >> 13) {
    case 0:
      if (condition(machine, low >> 5, cycle)) jump(machine, low);
      return Stall.NONE;
    case 1:
      return wait(machine, low, cycle);
    case 2:
      return shiftIn(machine, low, cycle);
    case 3:
      return shiftOut(machine, low);
    case 4:
      return low & 0x80 ? pull(machine, low) : push(machine, low);
    case 5:
      move(machine, low, cycle);
      return Stall.NONE;
    case 6:
      return raise(machine, low);
    default:
      setTo(machine, low);
      return Stall.NONE;
  }
}

function jump(machine, target) {
  machine.pc = target & 0x1f;
  machine.jumped = true;
}

function condition(machine, kind, cycle) {
  switch (kind) {
    case 0:
      return true;
    case 1:
      return machine.x === 0;
    case 2: {
      const before = machine.x;
      machine.x = (before - 1) >>> 0;
      return before !== 0;
    }
    case 3:
      return machine.y === 0;
    case 4: {
      const before = machine.y;
      machine.y = (before - 1) >>> 0;
      return before !== 0;
    }
    case 5:
      return machine.x !== machine.y;
    case 6:
      return machine.block.pads.seen(machine.jmpPin, cycle, machine.block.syncBypass);
    default:
      return machine.osrCount < machine.pullThreshold;
  }
}

function wait(machine, low, cycle) {
  const high = (low & 0x80) !== 0;
  const index = low & 0x1f;
  const source = (low >> 5) & 3;
  if (source === 2) {
    const flag = flagIndex(machine, index);
    if (machine.block.flagSet(flag) !== high) return Stall.IRQ;
    if (high) machine.block.clearFlag(flag);
    return Stall.NONE;
  }
  const gpio = source === 0 ? index : (index + machine.inBase) & 0x1f;
  machine.waitPin = gpio;
  return machine.block.pads.seen(gpio, cycle, machine.block.syncBypass) === high ? Stall.NONE : Stall.PIN;
}

function shiftIn(machine, low, cycle) {
  if (!machine.pushPending) {
    const bits = low & 0x1f || 32;
    const value = sourceValue(machine, low >> 5, cycle);
    if (bits === 32) {
      machine.isr = value;
    } else {
      const part = value & ((1 << bits) - 1);
      machine.isr = machine.inRight ? ((machine.isr >>> bits) | (part << (32 - bits))) >>> 0
                              : ((machine.isr << bits) | part) >>> 0;
    }
    machine.isrCount = Math.min(32, machine.isrCount + bits);
    if (!machine.autopush || machine.isrCount < machine.pushThreshold) return Stall.NONE;
  }
  machine.pushPending = machine.rx.full;
  if (machine.pushPending) {
    machine.block.noteRxStall(machine.index);
    return Stall.RX;
  }
  machine.pushIsr();
  return Stall.NONE;
}

function pull(machine, low) {
  if (low & 0x40 && machine.osrCount < machine.pullThreshold) return Stall.NONE;
  // With autopull a PULL of a full OSR is a fence, not a second pull (datasheet 3.5.4.2).
  if (machine.autopull && machine.osrCount === 0) return Stall.NONE;
  if (!machine.tx.empty) {
    machine.takeTx();
  } else if (low & 0x20) {
    machine.block.noteTxStall(machine.index);
    return Stall.TX;
  } else {
    machine.osr = machine.x;
    machine.osrCount = 0;
  }
  return Stall.NONE;
}

function push(machine, low) {
  if (low & 0x40 && machine.isrCount < machine.pushThreshold) return Stall.NONE;
  if (machine.rx.full) {
    machine.block.noteRxStall(machine.index);
    if (low & 0x20) return Stall.RX;
    machine.isr = 0;
    machine.isrCount = 0;
    return Stall.NONE;
  }
  machine.pushIsr();
  return Stall.NONE;
}

/** An empty OSR is refilled in one cycle and shifted in the next (datasheet 3.5.4.2). */
function shiftOut(machine, low) {
  if (machine.autopull && machine.osrCount >= machine.pullThreshold) {
    if (machine.tx.empty) machine.block.noteTxStall(machine.index);
    else machine.takeTx();
    return Stall.TX;
  }
  const bits = low & 0x1f || 32;
  let value = machine.osr;
  if (bits === 32) {
    machine.osr = 0;
  } else if (machine.outRight) {
    value = machine.osr & ((1 << bits) - 1);
    machine.osr >>>= bits;
  } else {
    value = machine.osr >>> (32 - bits);
    machine.osr = (machine.osr << bits) >>> 0;
  }
  machine.osrCount = Math.min(32, machine.osrCount + bits);
  outTo(machine, low >> 5, value, bits);
  return Stall.NONE;
}

function outTo(machine, destination, value, bits) {
  switch (destination) {
    case 0:
      machine.block.writePins(value, machine.outBase, machine.outCount);
      break;
    case 1:
      machine.x = value;
      break;
    case 2:
      machine.y = value;
      break;
    case 3:
      break;
    case 4:
      machine.block.writeDirections(value, machine.outBase, machine.outCount);
      break;
    case 5:
      jump(machine, value);
      break;
    case 6:
      machine.isr = value;
      machine.isrCount = bits;
      break;
    default:
      machine.latch = value & 0xffff;
  }
}

function sourceValue(machine, source, cycle) {
  switch (source) {
    case 0: {
      const pins = machine.block.pads.seenAll(cycle, machine.block.syncBypass);
      return machine.inBase ? ((pins >>> machine.inBase) | (pins << (32 - machine.inBase))) >>> 0 : pins;
    }
    case 1:
      return machine.x;
    case 2:
      return machine.y;
    case 5: {
      const level = machine.statusOfRx ? machine.rx.count : machine.tx.count;
      return level < machine.statusLevel ? 0xffffffff : 0;
    }
    case 6:
      return machine.isr;
    case 7:
      return machine.osr;
    default:
      return 0;
  }
}

function move(machine, low, cycle) {
  let value = sourceValue(machine, low & 7, cycle);
  const operation = (low >> 3) & 3;
  if (operation === 1) value = ~value >>> 0;
  else if (operation === 2) value = reverseBits(value);
  switch (low >> 5) {
    case 0:
      machine.block.writePins(value, machine.outBase, machine.outCount);
      break;
    case 1:
      machine.x = value;
      break;
    case 2:
      machine.y = value;
      break;
    case 4:
      machine.latch = value & 0xffff;
      break;
    case 5:
      jump(machine, value);
      break;
    case 6:
      machine.isr = value;
      machine.isrCount = 0;
      break;
    case 7:
      machine.osr = value;
      machine.osrCount = 0;
      break;
    default: // reserved
  }
}

function flagIndex(machine, index) {
  return index & 0x10 ? (index & 4) | ((index + machine.index) & 3) : index & 7;
}

function raise(machine, low) {
  const flag = flagIndex(machine, low & 0x1f);
  if (low & 0x40) {
    machine.block.clearFlag(flag);
    return Stall.NONE;
  }
  if (!machine.irqRaised) {
    machine.block.setFlag(flag);
    if ((low & 0x20) === 0) return Stall.NONE;
    machine.irqRaised = true;
    return Stall.IRQ;
  }
  return machine.block.flagSet(flag) ? Stall.IRQ : Stall.NONE;
}

function setTo(machine, low) {
  const value = low & 0x1f;
  switch (low >> 5) {
    case 0:
      machine.block.writePins(value, machine.setBase, machine.setCount);
      break;
    case 1:
      machine.x = value;
      break;
    case 2:
      machine.y = value;
      break;
    case 4:
      machine.block.writeDirections(value, machine.setBase, machine.setCount);
      break;
    default: // reserved
  }
}

function reverseBits(value) {
  let v = ((value & 0x55555555) << 1) | ((value >>> 1) & 0x55555555);
  v = ((v & 0x33333333) << 2) | ((v >>> 2) & 0x33333333);
  v = ((v & 0x0f0f0f0f) << 4) | ((v >>> 4) & 0x0f0f0f0f);
  v = ((v & 0x00ff00ff) << 8) | ((v >>> 8) & 0x00ff00ff);
  return ((v << 16) | (v >>> 16)) >>> 0;
}
