// SPDX-License-Identifier: MIT
// PIO instructions as words (RP2040 datasheet 3.4), `field` being the delay and side-set bits 12:8.
const word = (kind, field, low) => (kind << 13) | (field << 8) | low;

export const JMP = { always: 0, notX: 1, xDec: 2, notY: 3, yDec: 4, xNotY: 5, pin: 6, notOsre: 7 };
export const SRC = { pins: 0, x: 1, y: 2, null: 3, status: 5, isr: 6, osr: 7 };
export const OUT = { pins: 0, x: 1, y: 2, null: 3, pindirs: 4, pc: 5, isr: 6, exec: 7 };
export const MOV = { pins: 0, x: 1, y: 2, exec: 4, pc: 5, isr: 6, osr: 7 };
export const SET = { pins: 0, x: 1, y: 2, pindirs: 4 };

export const jmp = (condition, address, field = 0) => word(0, field, (condition << 5) | address);
export const waitGpio = (level, gpio, field = 0) => word(1, field, (level << 7) | gpio);
export const waitPin = (level, pin, field = 0) => word(1, field, (level << 7) | (1 << 5) | pin);
export const waitIrq = (level, flag, field = 0) => word(1, field, (level << 7) | (2 << 5) | flag);
export const shiftIn = (source, bits, field = 0) => word(2, field, (source << 5) | (bits & 31));
export const out = (destination, bits, field = 0) => word(3, field, (destination << 5) | (bits & 31));
export const push = ({ ifFull = 0, block = 1 } = {}, field = 0) => word(4, field, (ifFull << 6) | (block << 5));
export const pull = ({ ifEmpty = 0, block = 1 } = {}, field = 0) => word(4, field, 0x80 | (ifEmpty << 6) | (block << 5));
export const mov = (destination, source, field = 0, operation = 0) =>
  word(5, field, (destination << 5) | (operation << 3) | source);
export const irqSet = (flag, field = 0) => word(6, field, flag);
export const irqWait = (flag, field = 0) => word(6, field, 0x20 | flag);
export const irqClear = (flag, field = 0) => word(6, field, 0x40 | flag);
export const set = (destination, value, field = 0) => word(7, field, (destination << 5) | value);
export const nop = (field = 0) => mov(MOV.y, SRC.y, field);
