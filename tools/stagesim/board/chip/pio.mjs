// SPDX-License-Identifier: MIT
// One PIO block: registers, instruction memory, flags and interrupts around four state machines
// (RP2040 datasheet 3.5 and 3.7). Takes the place of rp2040js' own model, whose time is not the chip's.
import { BasePeripheral } from 'rp2040js';
import { PioMachine, withPins } from './pio_machine.mjs';
import { Stall } from './pio_stall.mjs';

const NEVER = Infinity;
const CTRL = 0x000;
const FSTAT = 0x004;
const FDEBUG = 0x008;
const FLEVEL = 0x00c;
const TXF0 = 0x010;
const RXF0 = 0x020;
const IRQ = 0x030;
const IRQ_FORCE = 0x034;
const INPUT_SYNC_BYPASS = 0x038;
const DBG_PADOUT = 0x03c;
const DBG_PADOE = 0x040;
const DBG_CFGINFO = 0x044;
const INSTR_MEM0 = 0x048;
const SM0_CLKDIV = 0x0c8;
const SM_STRIDE = 0x18;
const INTR = 0x128;
const IRQ0_INTE = 0x12c;
const IRQ1_INTS = 0x140;

const DEBUG_TXSTALL = 24;
const DEBUG_TXOVER = 16;
const DEBUG_RXUNDER = 8;
const DEBUG_RXSTALL = 0;

export class Pio extends BasePeripheral {
  /**
   * @param {import('rp2040js').RP2040} chip
   * @param {{index: number, pads: import('./pads.mjs').Pads, time: {cycle: number}, naive: boolean}} options
   */
  constructor(chip, { index, pads, time, naive }) {
    super(chip, `PIO${index}`);
    this.index = index;
    this.pads = pads;
    this.time = time;
    this.firstInterrupt = 7 + 2 * index; // PIO0_IRQ_0 is interrupt 7 (datasheet 2.3.2)
    this.memory = new Uint16Array(32);
    this.pinValues = 0;
    this.pinDirections = 0;
    this.pinsChanged = false;
    this.syncBypass = 0;
    this.flags = 0;
    this.flagsToSet = 0;
    this.flagsToClear = 0;
    this.debug = 0;
    this.interruptEnable = [0, 0];
    this.interruptForce = [0, 0];
    /** Cycle in which the first of the machines acts next. May be early, never late. */
    this.due = NEVER;
    this.machines = [0, 1, 2, 3].map((n) => new PioMachine(this, n, naive));
    this.#updateRequests();
  }

  note(section, text) {
    this.rp2040.violations.note(section, `PIO ${this.index}: ${text}`);
  }

  /** As after the block's reset. Instruction memory keeps what it has: it has no reset (3.7). */
  reset() {
    const { cycle } = this.time;
    for (const machine of this.machines) machine.reset(cycle);
    this.pinValues = 0;
    this.pinDirections = 0;
    this.syncBypass = 0;
    this.flags = 0;
    this.flagsToSet = 0;
    this.flagsToClear = 0;
    this.debug = 0;
    this.interruptEnable = [0, 0];
    this.interruptForce = [0, 0];
    this.reschedule();
    this.#updateRequests();
    this.updateInterrupts();
    this.pads.update(cycle + 1);
  }

  // Time

  /** Lets every machine do what falls due in `cycle`. They see flags and pins as they were when it began. */
  step(cycle) {
    let due = NEVER;
    for (const machine of this.machines) {
      if (machine.due <= cycle || machine.refillDue <= cycle) machine.step(cycle);
      due = Math.min(due, machine.due, machine.refillDue);
    }
    this.due = due;
    if (this.flagsToSet | this.flagsToClear) this.#commitFlags(cycle + 1);
  }

  inputsChanged(changed, cycle) {
    for (const machine of this.machines) {
      if (machine.inputsChanged(changed, cycle)) this.due = Math.min(this.due, machine.due);
    }
  }

  get quiet() {
    return this.machines.every((machine) => machine.quiet);
  }

  /** Call after anything but a step has changed when a machine acts next. */
  reschedule() {
    let due = NEVER;
    for (const machine of this.machines) due = Math.min(due, machine.due, machine.refillDue);
    this.due = due;
  }

  // What machines do to what they share

  writePins(value, base, count) {
    const pins = withPins(this.pinValues, value, base, count);
    if (pins === this.pinValues) return;
    this.pinValues = pins;
    this.pinsChanged = true;
  }

  writeDirections(value, base, count) {
    const directions = withPins(this.pinDirections, value, base, count);
    if (directions === this.pinDirections) return;
    this.pinDirections = directions;
    this.pinsChanged = true;
  }

  /** Whether another machine than `machine` may drive some of `pins`, which then has to assert them all the time. */
  sharesPins(machine, pins) {
    return this.machines.some((other) => other !== machine && (other.drivenPins & pins) !== 0);
  }

  flagSet(flag) {
    return ((this.flags >> flag) & 1) === 1;
  }

  setFlag(flag) {
    this.flagsToSet |= 1 << flag;
  }

  clearFlag(flag) {
    this.flagsToClear |= 1 << flag;
  }

  #commitFlags(visibleCycle) {
    this.flags = (this.flags & ~this.flagsToClear) | this.flagsToSet;
    this.flagsToSet = 0;
    this.flagsToClear = 0;
    for (const machine of this.machines) machine.wake(Stall.IRQ, visibleCycle);
    this.reschedule();
    this.updateInterrupts();
  }

  noteTxStall(index) {
    this.debug |= 1 << (DEBUG_TXSTALL + index);
  }

  noteRxStall(index) {
    this.debug |= 1 << (DEBUG_RXSTALL + index);
  }

  /** A word has left the machine's TX FIFO. */
  txChanged(machine) {
    this.#requestTx(machine);
    this.updateInterrupts();
  }

  /** A word has come into the machine's RX FIFO. */
  rxChanged(machine) {
    this.#requestRx(machine);
    this.updateInterrupts();
  }

  // DMA requests: numbers 0..3 and 8..11 are TX, 4..7 and 12..15 RX (datasheet 2.5.3.1)

  #requestTx(machine) {
    const request = this.index * 8 + machine.index;
    if (machine.tx.full) this.rp2040.dma.clearDREQ(request);
    else this.rp2040.dma.setDREQ(request);
  }

  #requestRx(machine) {
    const request = this.index * 8 + 4 + machine.index;
    if (machine.rx.empty) this.rp2040.dma.clearDREQ(request);
    else this.rp2040.dma.setDREQ(request);
  }

  #updateRequests() {
    for (const machine of this.machines) {
      this.#requestTx(machine);
      this.#requestRx(machine);
    }
  }

  // Interrupts

  get rawInterrupts() {
    let raw = (this.flags & 0xf) << 8;
    for (const machine of this.machines) {
      if (!machine.tx.full) raw |= 0x10 << machine.index;
      if (!machine.rx.empty) raw |= 0x01 << machine.index;
    }
    return raw;
  }

  #interruptStatus(line) {
    return (this.rawInterrupts & this.interruptEnable[line]) | this.interruptForce[line];
  }

  updateInterrupts() {
    for (let line = 0; line < 2; line++) {
      const used = this.interruptEnable[line] | this.interruptForce[line];
      this.rp2040.setInterrupt(this.firstInterrupt + line, used !== 0 && this.#interruptStatus(line) !== 0);
    }
  }

  // Bus

  readUint32(offset) {
    if (offset >= RXF0 && offset < IRQ) return this.#readFifo(this.machines[(offset - RXF0) >> 2]);
    if (offset >= SM0_CLKDIV && offset < INTR) {
      const place = offset - SM0_CLKDIV;
      return this.#readMachine(this.machines[Math.floor(place / SM_STRIDE)], place % SM_STRIDE);
    }
    if (offset >= IRQ0_INTE && offset <= IRQ1_INTS) {
      const place = (offset - IRQ0_INTE) >> 2;
      const line = place < 3 ? 0 : 1;
      return [this.interruptEnable[line], this.interruptForce[line], this.#interruptStatus(line)][place % 3];
    }
    switch (offset) {
      case CTRL:
        return this.machines.reduce((bits, machine) => bits | (machine.enabled ? 1 << machine.index : 0), 0);
      case FSTAT:
        return this.machines.reduce((bits, { tx, rx, index }) => bits |
          (((tx.empty ? 1 << 24 : 0) | (tx.full ? 1 << 16 : 0) | (rx.empty ? 1 << 8 : 0) | (rx.full ? 1 : 0))
            << index), 0) >>> 0;
      case FDEBUG:
        return this.debug >>> 0;
      case FLEVEL:
        return this.machines.reduce((bits, { tx, rx, index }) => bits | ((tx.count | (rx.count << 4)) << (8 * index)),
                                    0) >>> 0;
      case IRQ:
        return this.flags;
      case IRQ_FORCE:
        return 0;
      case INPUT_SYNC_BYPASS:
        return this.syncBypass >>> 0;
      case DBG_PADOUT:
        return this.pinValues >>> 0;
      case DBG_PADOE:
        return this.pinDirections >>> 0;
      case DBG_CFGINFO:
        return 0x00200404; // 32 instructions, 4 machines, FIFOs of 4
      case INTR:
        return this.rawInterrupts;
      default:
        return 0;
    }
  }

  writeUint32(offset, value) {
    const { cycle } = this.time;
    if (offset >= TXF0 && offset < RXF0) {
      this.#writeFifo(this.machines[(offset - TXF0) >> 2], value, cycle);
    } else if (offset >= INSTR_MEM0 && offset < SM0_CLKDIV) {
      this.#writeMemory((offset - INSTR_MEM0) >> 2, value, cycle);
    } else if (offset >= SM0_CLKDIV && offset < INTR) {
      const place = offset - SM0_CLKDIV;
      this.#writeMachine(this.machines[Math.floor(place / SM_STRIDE)], place % SM_STRIDE, value, cycle);
    } else if (offset >= IRQ0_INTE && offset <= IRQ1_INTS) {
      const place = (offset - IRQ0_INTE) >> 2;
      const line = place < 3 ? 0 : 1;
      if (place % 3 === 0) this.interruptEnable[line] = value & 0xfff;
      else if (place % 3 === 1) this.interruptForce[line] = value & 0xfff;
    } else {
      this.#writeGlobal(offset, value, cycle);
    }
    this.reschedule();
    this.updateInterrupts();
    if (this.pinsChanged) this.pads.update(cycle + 1);
  }

  #writeGlobal(offset, value, cycle) {
    switch (offset) {
      case CTRL:
        this.#writeCtrl(value, cycle);
        break;
      case FDEBUG:
        this.debug &= ~this.rawWriteValue;
        for (const machine of this.machines) this.#renoteStall(machine);
        break;
      case IRQ:
        this.flagsToClear |= this.rawWriteValue & 0xff;
        this.#commitFlags(cycle);
        break;
      case IRQ_FORCE:
        this.flagsToSet |= value & 0xff;
        this.#commitFlags(cycle);
        break;
      case INPUT_SYNC_BYPASS:
        for (const machine of this.machines) machine.settle(cycle);
        this.syncBypass = value;
        break;
    }
  }

  #writeCtrl(value, cycle) {
    for (const machine of this.machines) {
      const { index } = machine;
      if ((value >> (8 + index)) & 1) {
        machine.settle(cycle);
        machine.clock.restart(cycle);
        machine.clockChanged(cycle);
      }
      if ((value >> (4 + index)) & 1) machine.restart(cycle);
      machine.setEnabled(((value >> index) & 1) === 1, cycle);
    }
  }

  /** A stall that goes on sets its sticky bit again as soon as that is cleared. */
  #renoteStall(machine) {
    if (!machine.enabled && !machine.execStalled) return;
    if (machine.stall === Stall.TX && machine.tx.empty) this.noteTxStall(machine.index);
    if (machine.stall === Stall.RX) this.noteRxStall(machine.index);
  }

  #writeMemory(address, value, cycle) {
    for (const machine of this.machines) {
      machine.settle(cycle);
      machine.loopCache.clear();
    }
    this.memory[address] = value;
  }

  #writeFifo(machine, value, cycle) {
    if (machine.tx.full) {
      this.note('3.7', `SM${machine.index}: the TX FIFO is full: the word is lost (FDEBUG.TXOVER)`);
      this.debug |= 1 << (DEBUG_TXOVER + machine.index);
      return;
    }
    machine.tx.push(value);
    machine.txArrived(cycle);
    this.#requestTx(machine);
  }

  #readFifo(machine) {
    if (machine.rx.empty) {
      this.note('3.7', `SM${machine.index}: the RX FIFO is empty: what is read is not defined (FDEBUG.RXUNDER)`);
      this.debug |= 1 << (DEBUG_RXUNDER + machine.index);
      return 0;
    }
    const word = machine.rx.pull();
    machine.wake(Stall.RX, this.time.cycle);
    this.reschedule();
    this.rxChanged(machine);
    return word;
  }

  #readMachine(machine, place) {
    machine.settle(this.time.cycle);
    this.reschedule();
    switch (place) {
      case 0x00:
        return machine.clock.register;
      case 0x04:
        return (machine.execCtrl | (machine.execStalled ? 0x80000000 : 0)) >>> 0;
      case 0x08:
        return machine.shiftCtrl;
      case 0x0c:
        return machine.pc;
      case 0x10:
        return this.memory[machine.pc];
      default:
        return machine.pinCtrl;
    }
  }

  #writeMachine(machine, place, value, cycle) {
    for (const each of this.machines) each.settle(cycle); // they may share the pins that change hands here
    switch (place) {
      case 0x00:
        if (value >>> 16 === 0 && value & 0xff00) this.note('3.7', `SM${machine.index}_CLKDIV: with INT 0 (65536) FRAC must be 0`);
        machine.clock.setRegister(value, cycle);
        machine.clockChanged(cycle);
        break;
      case 0x04:
        machine.setExecCtrl(value);
        break;
      case 0x08:
        machine.setShiftCtrl(value);
        this.#updateRequests();
        break;
      case 0x0c:
        break; // read only: a JMP by SMx_INSTR sets it
      case 0x10:
        machine.force(value, cycle);
        if (this.flagsToSet | this.flagsToClear) this.#commitFlags(cycle + 1);
        break;
      default:
        machine.setPinCtrl(value);
    }
  }
}
