// SPDX-License-Identifier: MIT
// One PIO state machine, exact to the cycle (RP2040 datasheet 3.2 to 3.5). It tells when it next acts, so that the
// cycles between need not be stepped.
import { PioClock } from './pio_clock.mjs';
import { PioFifo } from './pio_fifo.mjs';
import { execute } from './pio_instructions.mjs';
import { findLoop } from './pio_loop.mjs';
import { Stall } from './pio_stall.mjs';

const NEVER = Infinity;
const NO_LATCH = -1;
const NO_ADDRESS = -1;

const EXEC_SIDE_EN = 1 << 30;
const EXEC_SIDE_PINDIR = 1 << 29;
const EXEC_STATUS_RX = 1 << 4;
const EXEC_NOT_MODELLED = 0x3 << 17; // INLINE_OUT_EN, OUT_STICKY
const SHIFT_JOIN_RX = 1 << 31;
const SHIFT_JOIN_TX = 1 << 30;
const GPIO_MASK = 0x3fffffff; // GPIO 0 to 29 have a pad

export class PioMachine {
  /** @param {import('./pio.mjs').Pio} block */
  constructor(block, index, naive) {
    this.block = block;
    this.index = index;
    this.naive = naive;
    this.reset(0);
  }

  /** All registers and state as after the block's reset. */
  reset(cycle) {
    this.clock = new PioClock();
    this.clock.restart(cycle);
    this.enabled = false;
    this.pc = 0;
    this.x = 0;
    this.y = 0;
    this.osr = 0;
    this.osrCount = 32; // bits shifted out: 32 is empty
    this.isr = 0;
    this.isrCount = 0;
    this.tx = new PioFifo(4);
    this.rx = new PioFifo(4);

    /** The cycle in which this machine acts next, if nothing wakes it earlier. */
    this.due = NEVER;
    this.refillDue = NEVER; // of an autopull between two OUTs
    this.tick = 0; // of the machine's clock, in which it acts next
    this.delayLeft = 0; // ticks; naive stepping counts delays down, otherwise `tick` already lies behind them
    this.stall = Stall.NONE;
    this.waitPin = 0; // while stalled on a pin
    this.latch = NO_LATCH; // instruction from OUT EXEC, MOV EXEC or a stalled SMx_INSTR write
    this.jumped = false;
    this.irqRaised = false; // a stalled `irq wait` has set its flag
    this.pushPending = false; // a stalled IN has shifted and has yet to push
    this.loop = null; // the loop being skipped, if any
    this.loopTick = 0; // at which it was entered
    this.loopCache = new Map();

    this.shiftCtrl = 0;
    this.setExecCtrl(0x1f << 12);
    this.setShiftCtrl(0x3 << 18);
    this.setPinCtrl(0x5 << 26);
  }

  /** A bit of X flips in `cycle`, as radiation flips one. */
  upset(bit, cycle) {
    this.settle(cycle);
    this.x = (this.x ^ (1 << bit)) >>> 0;
    this.block.reschedule();
  }

  // Registers

  setExecCtrl(value) {
    if (value & EXEC_NOT_MODELLED) this.#note('INLINE_OUT_EN and OUT_STICKY are not modelled');
    this.execCtrl = (value & 0x7fffffff) >>> 0;
    this.sideOptional = (value & EXEC_SIDE_EN) !== 0;
    this.sidePinDirs = (value & EXEC_SIDE_PINDIR) !== 0;
    this.jmpPin = (value >>> 24) & 0x1f;
    this.wrapTop = (value >>> 12) & 0x1f;
    this.wrapBottom = (value >>> 7) & 0x1f;
    this.statusOfRx = (value & EXEC_STATUS_RX) !== 0;
    this.statusLevel = value & 0xf;
    this.loopCache.clear();
  }

  /** Changing a join bit empties both FIFOs (datasheet 3.7, SM0_SHIFTCTRL). */
  setShiftCtrl(value) {
    const joins = (SHIFT_JOIN_RX | SHIFT_JOIN_TX) >>> 0;
    if ((value & joins) >>> 0 === joins) this.#note('both FIFOs are joined: neither has room');
    if (((value ^ this.shiftCtrl) & joins) !== 0) {
      const joinTx = (value & SHIFT_JOIN_TX) !== 0;
      const joinRx = (value & SHIFT_JOIN_RX) !== 0;
      this.tx = new PioFifo(joinTx ? 8 : joinRx ? 0 : 4);
      this.rx = new PioFifo(joinRx ? 8 : joinTx ? 0 : 4);
    }
    this.shiftCtrl = value >>> 0;
    this.pullThreshold = (value >>> 25) & 0x1f || 32;
    this.pushThreshold = (value >>> 20) & 0x1f || 32;
    this.outRight = (value & (1 << 19)) !== 0;
    this.inRight = (value & (1 << 18)) !== 0;
    this.autopull = (value & (1 << 17)) !== 0;
    this.autopush = (value & (1 << 16)) !== 0;
  }

  setPinCtrl(value) {
    this.pinCtrl = value >>> 0;
    this.sideBits = value >>> 29;
    this.setCount = (value >>> 26) & 0x7;
    this.outCount = (value >>> 20) & 0x3f;
    this.inBase = (value >>> 15) & 0x1f;
    this.sideBase = (value >>> 10) & 0x1f;
    this.setBase = (value >>> 5) & 0x1f;
    this.outBase = value & 0x1f;
    if (this.setCount > 5) this.#note(`SET_COUNT ${this.setCount} is more than 5`);
    if (this.outCount > 32) this.#note(`OUT_COUNT ${this.outCount} is more than 32`);
    if (this.sideBits > 5) this.#note(`SIDESET_COUNT ${this.sideBits} is more than 5`);
    this.loopCache.clear();
  }

  #note(text) {
    this.block.note('3.7', `SM${this.index}: ${text}`);
  }

  /** Pins of its side-set, and all that it can drive. */
  get sidePins() {
    return pinMask(this.sideBase, this.sideBits - (this.sideOptional ? 1 : 0));
  }

  get drivenPins() {
    return this.sidePins | pinMask(this.setBase, this.setCount) | pinMask(this.outBase, this.outCount);
  }

  get execStalled() {
    return this.latch !== NO_LATCH && this.stall !== Stall.NONE;
  }

  // Scheduling

  setEnabled(enabled, cycle) {
    if (enabled === this.enabled) return;
    this.settle(cycle);
    const nextTick = this.clock.tickFrom(cycle);
    if (enabled) {
      this.enabled = true;
      this.tick = nextTick + (this.naive ? 0 : this.delayLeft);
      if (!this.naive) this.delayLeft = 0;
      this.due = this.clock.cycleOf(this.tick);
    } else {
      if (!this.naive) this.delayLeft = Math.max(0, this.tick - nextTick);
      this.enabled = false;
      this.due = NEVER;
      this.refillDue = NEVER;
    }
  }

  /** CTRL.SM_RESTART: everything but PC, X, Y and the OSR's contents (datasheet 3.7, CTRL). */
  restart(cycle) {
    this.settle(cycle);
    this.isr = 0;
    this.isrCount = 0;
    this.osrCount = 32;
    this.delayLeft = 0;
    this.stall = Stall.NONE;
    this.latch = NO_LATCH;
    this.irqRaised = false;
    this.pushPending = false;
    this.#actAt(this.clock.tickFrom(cycle));
  }

  /** Call before the divider's grid changes, and after with the same cycle. */
  clockChanged(cycle) {
    this.delayLeft = 0;
    this.#actAt(this.clock.tickFrom(cycle));
  }

  /** Lets a machine that is stalled for `reason` try again in `cycle` or its first tick after. */
  wake(reason, cycle) {
    if (this.stall === reason && (this.enabled || this.latch !== NO_LATCH)) this.#actAt(this.clock.tickFrom(cycle));
  }

  /** Something came into the TX FIFO in `cycle`: before the machine acts in that cycle. */
  txArrived(cycle) {
    this.wake(Stall.TX, cycle);
    if (this.enabled && this.autopull && this.osrCount >= this.pullThreshold) {
      this.refillDue = this.clock.cycleOf(this.clock.tickFrom(cycle));
    }
  }

  /** Input pins in `changed` look different from `cycle` on. Returns whether this machine is watching one of them. */
  inputsChanged(changed, cycle) {
    if (this.stall === Stall.PIN && (changed >>> this.waitPin) & 1) {
      this.wake(Stall.PIN, cycle);
      return true;
    }
    if (this.loop !== null && this.loop.watchesPin && (changed >>> this.jmpPin) & 1) {
      this.due = Math.min(this.due, this.clock.cycleOf(this.clock.tickFrom(cycle)));
      return true;
    }
    return false;
  }

  /** True if nothing but an event from outside, or the end of a wait for a pin, can make this machine act. */
  get quiet() {
    if (this.loop !== null) return this.loop.watchesPin || this.loop.xPerPass + this.loop.yPerPass === 0;
    return !this.enabled || this.stall !== Stall.NONE;
  }

  #actAt(tick) {
    if (!this.enabled && this.latch === NO_LATCH) return;
    this.tick = tick;
    this.due = this.clock.cycleOf(tick);
  }

  // Skipping

  /** Starts to skip a loop if the jump from address `from` was its last instruction: one pass has been stepped. */
  #enterLoop(from) {
    const pinHigh = this.block.pads.seen(this.jmpPin, this.due, this.block.syncBypass);
    const key = this.pc * 2 + (pinHigh ? 1 : 0);
    let loop = this.loopCache.get(key);
    if (loop === undefined) {
      loop = findLoop({ memory: this.block.memory, wrapTop: this.wrapTop, wrapBottom: this.wrapBottom,
                        sideBits: this.sideBits, sideOptional: this.sideOptional, pinHigh }, this.pc);
      this.loopCache.set(key, loop);
    }
    if (loop === null || loop.pcs.at(-1) !== from) return;
    if (loop.watchesPin && !this.block.pads.settled(this.jmpPin, this.due)) return;
    // Whole passes in which every decrement finds its register not zero.
    const xPasses = loop.xPerPass ? Math.floor(this.x / loop.xPerPass) : NEVER;
    const yPasses = loop.yPerPass ? Math.floor(this.y / loop.yPerPass) : NEVER;
    const passes = Math.min(xPasses, yPasses);
    if (passes === 0 || (loop.side !== null && this.block.sharesPins(this, this.sidePins))) return;
    this.loop = loop;
    this.loopTick = this.tick;
    this.due = passes === NEVER ? NEVER : this.clock.cycleOf(this.tick + passes * loop.passTicks);
  }

  /** Leaves a loop that is being skipped, in the state that stepping would have led to just before `cycle`. */
  settle(cycle) {
    const { loop } = this;
    if (loop === null) return;
    this.loop = null;
    const ticks = this.clock.tickFrom(cycle) - this.loopTick;
    const passes = Math.floor(ticks / loop.passTicks);
    const rest = ticks - passes * loop.passTicks;
    let done = 0; // instructions of the last pass that have started
    while (done < loop.pcs.length && loop.starts[done] < rest) done++;
    const whole = done === loop.pcs.length;
    this.pc = whole ? loop.pcs[0] : loop.pcs[done];
    this.x = (this.x - passes * loop.xPerPass - (whole ? loop.xPerPass : loop.xSteps[done])) >>> 0;
    this.y = (this.y - passes * loop.yPerPass - (whole ? loop.yPerPass : loop.ySteps[done])) >>> 0;
    this.#actAt(this.loopTick + passes * loop.passTicks + (whole ? loop.passTicks : loop.starts[done]));
  }

  // Stepping

  /** Does what falls due in `cycle`. */
  step(cycle) {
    if (this.loop !== null && this.due <= cycle) this.settle(cycle);
    if (this.due <= cycle) {
      if (this.delayLeft > 0) {
        this.delayLeft--;
        this.#actAt(this.tick + 1);
      } else {
        this.#runNext(cycle);
      }
    }
    if (this.refillDue <= cycle) {
      this.refillDue = NEVER;
      this.refill();
    }
  }

  /**
   * SMx_INSTR: runs `opcode` in `cycle`, enabled or not, in place of what the machine was about to do. If it stalls it
   * stays in the latch until it is done (datasheet 3.5.7).
   */
  force(opcode, cycle) {
    this.settle(cycle);
    this.latch = opcode & 0xffff;
    this.stall = Stall.NONE;
    this.irqRaised = false;
    this.delayLeft = 0;
    this.#runNext(cycle);
  }

  #runNext(cycle) {
    const latched = this.latch !== NO_LATCH;
    const opcode = latched ? this.latch : this.block.memory[this.pc];
    this.latch = NO_LATCH;
    this.jumped = false;
    const from = this.pc;
    const begins = this.stall === Stall.NONE;
    this.stall = execute(this, opcode, cycle);
    if (begins) this.#side(opcode);
    if (this.stall !== Stall.NONE) {
      if (latched) this.latch = opcode;
      const retries = this.naive || this.#endsByItself(cycle);
      this.tick = this.clock.tickFrom(cycle + 1);
      this.due = retries ? this.clock.cycleOf(this.tick) : NEVER;
      return;
    }
    this.irqRaised = false;
    if (this.autopull) this.refill();
    if (!latched && !this.jumped) this.pc = this.pc === this.wrapTop ? this.wrapBottom : (this.pc + 1) & 0x1f;
    // The delay of an instruction that fills the latch is ignored (datasheet 3.4.5.2).
    const delay = this.latch !== NO_LATCH ? 0 : (opcode >> 8) & ((1 << (5 - this.sideBits)) - 1);
    this.#scheduleAfter(cycle, delay, latched ? NO_ADDRESS : from);
  }

  /** A stall ends by an event, except of an OUT that has just refilled the OSR, or if the pin's change is on its way. */
  #endsByItself(cycle) {
    if (this.stall === Stall.TX) return this.autopull && this.osrCount === 0;
    return this.stall === Stall.PIN && !this.block.pads.settled(this.waitPin, cycle);
  }

  #scheduleAfter(cycle, delay, from) {
    this.due = NEVER;
    if (this.naive || !this.enabled) this.delayLeft = delay;
    this.#actAt(this.clock.tickFrom(cycle + 1) + (this.naive || !this.enabled ? 0 : delay));
    if (this.jumped && !this.naive && this.enabled && this.latch === NO_LATCH) this.#enterLoop(from);
  }

  /** Side-set happens in the first cycle, stalled or not, and wins over OUT and SET (datasheet 3.5.6). */
  #side(opcode) {
    const { sideBits } = this;
    if (sideBits === 0) return;
    if (this.sideOptional && (opcode & 0x1000) === 0) return;
    const bits = this.sideOptional ? sideBits - 1 : sideBits;
    const value = ((opcode >> 8) & 0x1f) >> (5 - sideBits);
    if (this.sidePinDirs) this.block.writeDirections(value, this.sideBase, bits);
    else this.block.writePins(value, this.sideBase, bits);
  }

  // FIFOs

  pushIsr() {
    this.rx.push(this.isr);
    this.isr = 0;
    this.isrCount = 0;
    this.block.rxChanged(this);
  }

  takeTx() {
    this.osr = this.tx.pull();
    this.osrCount = 0;
    this.block.txChanged(this);
  }

  refill() {
    if (this.autopull && this.osrCount >= this.pullThreshold && !this.tx.empty) this.takeTx();
  }
}

function pinMask(base, count) {
  return count <= 0 ? 0 : rotate(count >= 32 ? 0xffffffff : (1 << count) - 1, base);
}

/** `pins` with `count` of them from `base` on taken from `value`. */
export function withPins(pins, value, base, count) {
  const mask = pinMask(base, count) & GPIO_MASK;
  return (pins & ~mask) | (rotate(value, base) & mask);
}

/** A 32-bit word rotated left: pin mappings wrap from GPIO 31 to 0. */
function rotate(value, places) {
  return places === 0 ? value : (value << places) | (value >>> (32 - places));
}
