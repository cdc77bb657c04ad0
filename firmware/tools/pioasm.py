#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Assembles the PIO programs of one .pio file into a C header: what firmware/pulse.pio uses of the language of RP2040
datasheet 3.3, and nothing else. Addresses count from a program's start; the firmware relocates jumps when it loads one.

usage: pioasm.py [NAME=VALUE ...] pulse.pio > pulse.h        NAME=VALUE replaces the value that a .define gives
"""
import re
import sys

JMP_CONDITIONS = {'': 0, '!x': 1, 'x--': 2, '!y': 3, 'y--': 4, 'x!=y': 5, 'pin': 6, '!osre': 7}
WAIT_SOURCES = {'gpio': 0, 'pin': 1, 'irq': 2}
IN_SOURCES = {'pins': 0, 'x': 1, 'y': 2, 'null': 3, 'isr': 6, 'osr': 7}
OUT_DESTINATIONS = {'pins': 0, 'x': 1, 'y': 2, 'null': 3, 'pindirs': 4, 'pc': 5, 'isr': 6, 'exec': 7}
MOV_DESTINATIONS = {'pins': 0, 'x': 1, 'y': 2, 'exec': 4, 'pc': 5, 'isr': 6, 'osr': 7}
MOV_SOURCES = {'pins': 0, 'x': 1, 'y': 2, 'null': 3, 'status': 5, 'isr': 6, 'osr': 7}
SET_DESTINATIONS = {'pins': 0, 'x': 1, 'y': 2, 'pindirs': 4}


class AssemblyError(Exception):
    """A line that cannot be assembled; the message says where and why."""


def number(text, low, high, what):
    try:
        value = int(text, 0)
    except ValueError:
        raise AssemblyError(f'{what} "{text}" is not a number') from None
    if not low <= value <= high:
        raise AssemblyError(f'{what} {value} is not in {low}..{high}')
    return value


def lookup(table, key, what):
    if key not in table:
        raise AssemblyError(f'{what} "{key}" is not one of {", ".join(filter(None, table))}')
    return table[key]


class Program:
    """One .program: its lines first, its words once all labels are known."""

    def __init__(self, name):
        self.name = name
        self.side_set_bits = 0
        self.lines = []  # (line number, instruction text)
        self.labels = {}
        self.public_labels = []
        self.defines = {}
        self.wrap_target = 0
        self.wrap = None

    def assemble(self):
        if len(self.lines) > 32:
            raise AssemblyError(f'program {self.name} has {len(self.lines)} instructions, a block holds 32')
        if self.wrap is None:
            self.wrap = len(self.lines) - 1
        words = []
        for line_number, text in self.lines:
            try:
                words.append(self.encode(text))
            except AssemblyError as error:
                raise AssemblyError(f'line {line_number}: {error}') from None
        return words

    def encode(self, text):
        """`operation operands [side N] [[delay]]` as a 16-bit word (datasheet 3.4)."""
        match = re.fullmatch(r'(\w+)\s*(.*?)(?:\s+side\s+(\w+))?(?:\s*\[(.+)\])?', text.replace('nop', 'mov y, y'))
        operation, operands, side, delay = match.groups()
        delay_bits = 5 - self.side_set_bits
        delay = self.delay(delay, (1 << delay_bits) - 1) if delay else 0
        if bool(self.side_set_bits) != (side is not None):
            raise AssemblyError('each instruction needs "side" exactly when the program has .side_set')
        side = number(side, 0, (1 << self.side_set_bits) - 1, 'side') if side else 0
        encoder = getattr(self, 'encode_' + operation, None)
        if encoder is None:
            raise AssemblyError(f'unknown instruction "{operation}"')
        return encoder(operands.lower()) | (side << delay_bits | delay) << 8

    def delay(self, text, high):
        """A number, or a name of a .define less a number."""
        name, _, less = (part.strip() for part in text.partition('-'))
        value = self.defines.get(name, name)
        return number(str(int(value) - int(less)) if less else str(value), 0, high, 'delay')

    def encode_jmp(self, operands):
        condition, _, target = operands.replace(',', ' ').rpartition(' ')
        if target not in self.labels:
            raise AssemblyError(f'no label "{target}" in program {self.name}')
        return 0 << 13 | lookup(JMP_CONDITIONS, condition.replace(' ', ''), 'condition') << 5 | self.labels[target]

    def encode_wait(self, operands):
        polarity, source, index = operands.split()
        return (1 << 13 | number(polarity, 0, 1, 'polarity') << 7 | lookup(WAIT_SOURCES, source, 'source') << 5 |
                number(index, 0, 31 if source != 'irq' else 7, 'index'))

    def encode_in(self, operands):
        source, count = re.split(r'\s*,\s*', operands)
        return 2 << 13 | lookup(IN_SOURCES, source, 'source') << 5 | number(count, 1, 32, 'bit count') % 32

    def encode_out(self, operands):
        destination, count = re.split(r'\s*,\s*', operands)
        return 3 << 13 | lookup(OUT_DESTINATIONS, destination, 'destination') << 5 | number(count, 1, 32, 'count') % 32

    def encode_push(self, operands):
        return 4 << 13 | lookup({'': 1, 'block': 1, 'noblock': 0}, operands, 'option') << 5

    def encode_pull(self, operands):
        return 4 << 13 | 1 << 7 | lookup({'': 1, 'block': 1, 'noblock': 0}, operands, 'option') << 5

    def encode_mov(self, operands):
        destination, source = re.split(r'\s*,\s*', operands)
        operation = {'~': 1, ':': 2}.get(source[0], 0)
        return (5 << 13 | lookup(MOV_DESTINATIONS, destination, 'destination') << 5 | operation << 3 |
                lookup(MOV_SOURCES, source.lstrip('~: '), 'source'))

    def encode_irq(self, operands):
        mode, _, index = operands.rpartition(' ')
        clear_wait = lookup({'': 0, 'wait': 1, 'clear': 2}, mode.strip(), 'mode')
        return 6 << 13 | clear_wait << 5 | number(index, 0, 7, 'flag')

    def encode_set(self, operands):
        destination, value = re.split(r'\s*,\s*', operands)
        return 7 << 13 | lookup(SET_DESTINATIONS, destination, 'destination') << 5 | number(value, 0, 31, 'value')


def parse(source, replaced):
    """The programs of a .pio text, in order. `replaced` holds values of defines, by name, instead of the text's."""
    programs, replaced = [], dict(replaced)
    for line_number, line in enumerate(source.splitlines(), 1):
        text = re.sub(r'(;|//).*', '', line).strip()
        if not text:
            continue
        if match := re.fullmatch(r'\.program\s+(\w+)', text):
            programs.append(Program(match[1]))
            continue
        if not programs:
            raise AssemblyError(f'line {line_number}: begin with .program')
        program = programs[-1]
        if match := re.fullmatch(r'\.side_set\s+([1-5])', text):
            program.side_set_bits = int(match[1])
        elif match := re.fullmatch(r'\.define\s+public\s+(\w+)\s+(\w+)', text):
            program.defines[match[1]] = replaced.pop(match[1], int(match[2], 0))
        elif text == '.wrap_target':
            program.wrap_target = len(program.lines)
        elif text == '.wrap':
            program.wrap = len(program.lines) - 1
        elif match := re.fullmatch(r'(public\s+)?(\w+):', text):
            program.labels[match[2].lower()] = len(program.lines)
            if match[1]:
                program.public_labels.append(match[2])
        elif text.startswith('.'):
            raise AssemblyError(f'line {line_number}: unknown directive "{text}"')
        else:
            program.lines.append((line_number, text))
    if replaced:
        raise AssemblyError(f'nothing defines {", ".join(replaced)}')
    return programs


def header(programs):
    lines = ['// SPDX-License-Identifier: MIT', '// Made by pioasm.py from pulse.pio.', '#ifndef OLS_PULSE_H',
             '#define OLS_PULSE_H', '', '#include <stdint.h>']
    for program in programs:
        words = program.assemble()
        upper = program.name.upper()
        lines += ['', f'enum {{', f'    {upper}_WORDS = {len(words)},',
                  f'    {upper}_WRAP_TARGET = {program.wrap_target},', f'    {upper}_WRAP = {program.wrap},']
        lines += [f'    {upper}_{label.upper()} = {program.labels[label.lower()]},' for label in program.public_labels]
        lines += [f'    {name} = {value},' for name, value in program.defines.items()]
        lines += ['};', f'#define {upper}_PROGRAM \\', '    { ' + ', '.join(f'0x{word:04x}' for word in words) + ' }']
    return '\n'.join(lines + ['', '#endif'])


def main(arguments):
    if not arguments or not all(re.fullmatch(r'\w+=\d+', argument) for argument in arguments[:-1]):
        raise SystemExit(__doc__)
    with open(arguments[-1], encoding='utf-8') as file:
        source = file.read()
    replaced = {name: int(value) for name, value in (argument.split('=') for argument in arguments[:-1])}
    try:
        print(header(parse(source, replaced)))
    except AssemblyError as error:
        raise SystemExit(f'{arguments[-1]}: {error}') from None


if __name__ == '__main__':
    main(sys.argv[1:])
