// SPDX-License-Identifier: MIT
// Finds loops of a PIO program that do nothing but count or watch a pin, so that time can skip over them.

const LONGEST_LOOP = 4;
const JMP = 0;
const NOP = 0xa042; // mov y, y: how assemblers write `nop`

/**
 * @typedef {object} PioLoop
 * @property {number[]} pcs     address of each instruction, in order
 * @property {number[]} starts  ticks from the start of a pass to each instruction
 * @property {number[]} xSteps  how often X has been decremented in this pass before each instruction
 * @property {number[]} ySteps  the same for Y
 * @property {number} passTicks ticks of one pass
 * @property {number} xPerPass
 * @property {number} yPerPass
 * @property {boolean} watchesPin
 * @property {number | null} side what it puts on the side-set pins, null if it leaves them alone
 */

/**
 * Follows the program from `pc` while every decrement jumps (its register is not zero yet) and the pin stays as it
 * is. Returns the loop if that leads back to `pc` through jumps and nops alone, and null otherwise. All of it must
 * side-set the same: then no pin changes from the second pass on.
 * @param {{memory: Uint16Array, wrapTop: number, wrapBottom: number, sideBits: number, sideOptional: boolean,
 *          pinHigh: boolean}} program
 * @returns {PioLoop | null}
 */
export function findLoop(program, pc) {
  const loop = { pcs: [], starts: [], xSteps: [], ySteps: [], passTicks: 0, xPerPass: 0, yPerPass: 0,
                 watchesPin: false, side: sideOf(program, program.memory[pc]) };
  let at = pc;
  do {
    const opcode = program.memory[at];
    if (loop.pcs.length === LONGEST_LOOP || sideOf(program, opcode) !== loop.side) return null;
    loop.pcs.push(at);
    loop.starts.push(loop.passTicks);
    loop.xSteps.push(loop.xPerPass);
    loop.ySteps.push(loop.yPerPass);
    loop.passTicks += 1 + ((opcode >> 8) & ((1 << (5 - program.sideBits)) - 1));
    const taken = jumps(program, opcode, loop);
    if (taken === null) return null;
    at = taken ? opcode & 0x1f : at === program.wrapTop ? program.wrapBottom : (at + 1) & 0x1f;
  } while (at !== pc);
  return loop;
}

/** What an instruction puts on the side-set pins, null if it leaves them alone. */
function sideOf(program, opcode) {
  if (program.sideBits === 0) return null;
  if (program.sideOptional && (opcode & 0x1000) === 0) return null;
  return ((opcode >> 8) & 0x1f) >> (5 - program.sideBits);
}

/** Whether `opcode` jumps; null if it is neither a jump with a known outcome nor a nop. */
function jumps(program, opcode, loop) {
  if ((opcode & 0xe0ff) === NOP) return false;
  if (opcode >> 13 !== JMP) return null;
  switch ((opcode >> 5) & 7) {
    case 0:
      return true;
    case 2:
      loop.xPerPass++;
      return true;
    case 4:
      loop.yPerPass++;
      return true;
    case 6:
      loop.watchesPin = true;
      return program.pinHigh;
    default:
      return null;
  }
}
