// SPDX-License-Identifier: MIT
// Corrections to rp2040js' Cortex-M0+ core: sleeping, waking and faulting as the ARMv6-M manual has it.
import { correctInterrupts } from './nvic.mjs';

import { BusFault } from './bus.mjs';

const EXC_NMI = 2;
const EXC_HARDFAULT = 3;
const EXECUTE_NEVER = 0x40000000; // from here on (ARMv6-M B3.1)
const ENTRY_CYCLES = 15; // Cortex-M0+ TRM 3.4.1 with zero wait states; the return takes about as long
const RETURN_CYCLES = 13;

/**
 * Stock: WFI with an interrupt already pending sleeps for ever, WFI under PRIMASK enters the handler, exceptions cost
 * no time and breakpoints do nothing.
 * @param {import('rp2040js').RP2040} chip
 */
export function correctProcessor(chip) {
  const { core } = chip;
  core.extraCycles = 0;

  const enter = core.exceptionEntry;
  core.exceptionEntry = (number) => {
    core.extraCycles += ENTRY_CYCLES;
    enter.call(core, number);
  };
  const leave = core.exceptionReturn;
  core.exceptionReturn = (value) => {
    core.extraCycles += RETURN_CYCLES;
    leave.call(core, value);
  };

  // An interrupt only ends the sleep; the next instruction boundary takes it, or not under PRIMASK.
  core.onPending = () => {
    if (core.waiting && wakePending(core)) core.waiting = false;
  };
  correctInterrupts(chip);

  // A BKPT without a debugger, and UDF, fault (ARMv6-M B1.5.6).
  chip.onBreak = () => raiseHardFault(chip);
}

/** Enters the HardFault handler at the next instruction; in a handler of that priority, locks up (ARMv6-M B1.5.6). */
export function raiseHardFault(chip) {
  const { core } = chip;
  core.waiting = false;
  if (core.IPSR === EXC_NMI || core.IPSR === EXC_HARDFAULT) {
    lockUp(chip);
    return;
  }
  try {
    core.exceptionEntry(EXC_HARDFAULT);
    core.PC &= ~1;
  } catch (error) {
    if (!(error instanceof BusFault)) throw error; // the stack, or the vector table, is not there
    lockUp(chip);
  }
}

/** Nothing but a reset helps. */
export function lockUp(chip) {
  hangProgram(chip);
  chip.core.PM = true;
}

/** Lets the program go on at a branch to itself, which is put where no program is: the stack's far end. */
export function hangProgram(chip) {
  const STACK_END = 0x20041000; // of the last SRAM bank (RP2040 datasheet 2.6.2)
  const BRANCH_TO_SELF = 0xe7fe;
  chip.writeUint16(STACK_END, BRANCH_TO_SELF);
  chip.core.PC = STACK_END;
  chip.core.PM = false;
  chip.core.waiting = false;
}

/** Whether an exception is pending that would end a WFI: PRIMASK does not matter (ARMv6-M B1.5.19). */
function wakePending(core) {
  return (core.pendingInterrupts & core.enabledInterrupts) !== 0 || core.pendingNMI || core.pendingSystick ||
    core.pendingPendSV;
}

/** The instruction under way has met a bus fault. */
export function takeBusFault(core) {
  core.PC = core.instructionAt;
  core.extraCycles = 0;
  raiseHardFault(core.rp2040);
}

/**
 * Runs one instruction and returns its cycles. Afterwards `core.waiting` is true if nothing but an interrupt can make
 * the program go on: WFI, or a branch to itself.
 */
export function runInstruction(core) {
  const from = core.PC;
  core.instructionAt = from;
  if (from >= EXECUTE_NEVER) throw new BusFault('an instruction where nothing may run');
  const cycles = core.executeInstruction() + core.extraCycles;
  core.extraCycles = 0;
  if (core.PC === from) core.waiting = true;
  if (core.waiting && wakePending(core)) core.waiting = false;
  return cycles;
}
