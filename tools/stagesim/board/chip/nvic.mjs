// SPDX-License-Identifier: MIT
// Interrupts on their way to the processor, and the system control block (ARMv6-M B3.2 and B3.4; Cortex-M0+ Devices Generic
// User Guide 4.2.9, "Level-sensitive and pulse interrupts"). Priorities, nesting and tail-chaining are rp2040js' core's.

const FIRST_INTERRUPT = 16;
const NVIC_FIRST = 0x100;
const NVIC_LAST = 0x41f;
const ISER = 0x100;
const ICER = 0x180;
const ISPR = 0x200;
const ICPR = 0x280;
const IPR0 = 0x400;
const ICSR = 0xd04;
const VTOR = 0xd08;
const AIRCR = 0xd0c;
const SCR = 0xd10;
const CCR = 0xd14;
const SHPR2 = 0xd1c;
const SHPR3 = 0xd20;
const PRIORITY_BITS = 0xc0c0c0c0; // two bits each (2.4.3, "NVIC")

/**
 * An interrupt is pending from its line's rise, or while the line is high and its handler does not run, until its handler is
 * entered or it is cleared with the line low: a line that falls again before has interrupted all the same.
 * @param {import('rp2040js').RP2040} chip
 */
export function correctInterrupts(chip) {
  const { core, ppb } = chip;
  const note = (section, text) => chip.violations.note(section, text);
  let lines = 0;
  let active = 0;

  core.setInterrupt = (number, high) => {
    const bit = 1 << number;
    if (!high) lines &= ~bit;
    else if (!(lines & bit)) {
      lines |= bit;
      pend(bit);
    }
  };
  const pend = (bits) => {
    if (bits === 0) return;
    core.pendingInterrupts |= bits;
    core.interruptsUpdated = true;
    core.onPending();
  };

  const enter = core.exceptionEntry;
  core.exceptionEntry = (number) => {
    if (number >= FIRST_INTERRUPT) {
      const bit = 1 << (number - FIRST_INTERRUPT);
      core.pendingInterrupts &= ~bit;
      active |= bit;
    }
    enter.call(core, number);
  };
  const leave = core.exceptionReturn;
  core.exceptionReturn = (value) => {
    const bit = core.IPSR >= FIRST_INTERRUPT ? 1 << (core.IPSR - FIRST_INTERRUPT) : 0;
    leave.call(core, value);
    active &= ~bit;
    pend(bit & lines); // the handler has not ended its cause
  };

  const read = ppb.readUint32;
  ppb.readUint32 = (offset) => {
    if (offset >= NVIC_FIRST && offset <= NVIC_LAST) return readNvic(offset);
    switch (offset) {
      case ICSR:
        return (read.call(ppb, offset) & ~0x401ff000 | (pendingEnabled() ? 1 << 22 : 0) | (firstPending() << 12)) >>> 0;
      case VTOR:
        return core.VTOR >>> 0;
      case AIRCR:
        return 0xfa050000;
      case SCR:
        return 0;
      case CCR:
        return 0x208; // STKALIGN, UNALIGN_TRP (B3.2.8)
      default:
        return read.call(ppb, offset);
    }
  };

  const pendingEnabled = () => core.pendingInterrupts & core.enabledInterrupts;
  /** VECTPENDING: of what is enabled, the highest priority, then the lowest number (B1.5.4). */
  const firstPending = () => {
    for (const priority of core.interruptPriorities) {
      const bits = pendingEnabled() & priority;
      if (bits) return FIRST_INTERRUPT + 31 - Math.clz32(bits & -bits);
    }
    return 0;
  };

  const readNvic = (offset) => {
    if (offset === ISER || offset === ICER) return core.enabledInterrupts >>> 0;
    if (offset === ISPR || offset === ICPR) return core.pendingInterrupts >>> 0;
    return read.call(ppb, offset) >>> 0;
  };

  const write = ppb.writeUint32;
  ppb.writeUint32 = (offset, value) => {
    switch (offset) {
      case ISPR:
        pend(value | 0);
        return;
      case ICPR:
        core.pendingInterrupts &= ~value;
        pend(value & lines & ~active); // a line that is high stays pending
        return;
      case ISER:
        core.enabledInterrupts |= value;
        pend(core.pendingInterrupts & value);
        return;
      case ICER:
        core.enabledInterrupts &= ~value;
        return;
      case VTOR:
        core.VTOR = (value & ~0xff) >>> 0;
        return;
      case AIRCR:
      case SCR:
        if (offset === SCR && value === 0) return;
        note('2.4.8', `${offset === SCR ? 'SCR' : 'AIRCR'} is not modelled: 0x${value.toString(16)}`);
        return;
      case SHPR2:
      case SHPR3:
        write.call(ppb, offset, (value & (offset === SHPR2 ? 0xc0000000 : 0xc0c00000)) >>> 0);
        return;
      default:
        if (offset >= IPR0 && offset <= NVIC_LAST) write.call(ppb, offset, (value & PRIORITY_BITS) >>> 0);
        else write.call(ppb, offset, value);
    }
  };
}
