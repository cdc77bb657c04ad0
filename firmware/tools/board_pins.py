#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""The pins of each board, from the one place where they stand, firmware/boards/BOARD.toml, to where they are used.

usage: board_pins.py header BOARD.toml            C header for the firmware
       board_pins.py json BOARD.toml...           boards.json of the emulated board
       board_pins.py table BOARD.toml...          tables of docs/hardware.md
       board_pins.py write-json|write-table FILE BOARD.toml...  brings the committed file up to date
"""
import json
import math
import sys
import tomllib

TIMELINE = ['LATCH', 'LIGHT_EN', 'TRIG0', 'TRIG1', 'TRIG2', 'TRIG3', 'SYNC', 'READY']  # bits 0 to 7 of an event's pins
PLAYER = ['DATA', 'CLK'] + TIMELINE  # of PIO block 0
OUTPUTS = PLAYER + ['PHOTO', 'HEALTHY']
OPTIONAL = ['READY']  # a board may not have it
STOP_INPUTS = ['ESTOP', 'OVER_TEMPERATURE', 'OPEN_LAMP']  # enum board_stop_input of board.h
INPUTS = ['GENLOCK']
CAN_PINS = ['CAN_MISO', 'CAN_SCK', 'CAN_MOSI', 'CAN_STANDBY', 'CAN_RESET', 'CAN_CS', 'CAN_INTERRUPT']
GPIOS = 30  # of the RP2040 (datasheet 1.4.3)
NAME_BYTES = 16  # with its zero, in ols_hello_reply
CABLES = ['trigger_m']
CABLE_M_MAX = 10
CABLE_NS_PER_M = 5  # 0.66 of the speed of light, as in polyethylene
TICK_NS = 8
BEGIN, END = '<!-- pins: made by firmware/tools/board_pins.py -->\n', '<!-- end of pins -->\n'


class BoardError(Exception):
    """A board file that cannot be right; the message says where and why."""


def consecutive(pins, names):
    first = pins[names[0]]['gpio']
    for place, name in enumerate(names):
        if pins[name]['gpio'] != first + place:
            raise BoardError(f'{", ".join(names)} must be on consecutive GPIOs in this order: PIO addresses them by number')


def present(board, names):
    return [name for name in names if name in board['outputs'] or name not in OPTIONAL]


def check(board):
    """Raises BoardError when no firmware could work with these pins."""
    groups = [('outputs', board['outputs'], present(board, OUTPUTS)), ('stop_inputs', board['stop_inputs'], STOP_INPUTS),
              ('inputs', board['inputs'], INPUTS)]
    if 'can' in board:
        groups.append(('can.pins', board['can']['pins'], CAN_PINS))
    owner = {}
    for group, pins, names in groups:
        if sorted(pins) != sorted(names):
            raise BoardError(f'[{group}] must name {", ".join(names)}')
        for name, pin in pins.items():
            if not 0 <= pin['gpio'] < GPIOS:
                raise BoardError(f'{name}: the RP2040 has GPIO 0 to {GPIOS - 1}, not {pin["gpio"]}')
            if pin['gpio'] in owner:
                raise BoardError(f'GPIO {pin["gpio"]} is both {owner[pin["gpio"]]} and {name}')
            owner[pin['gpio']] = name
    consecutive(board['outputs'], present(board, TIMELINE))
    consecutive(board['stop_inputs'], STOP_INPUTS)
    if len(board['name'].encode()) >= NAME_BYTES:
        raise BoardError(f'the name "{board["name"]}" is longer than the {NAME_BYTES - 1} bytes of a hello')
    if sorted(board['cables']) != sorted(CABLES):
        raise BoardError(f'[cables] must name {", ".join(CABLES)}')
    for name, metres in board['cables'].items():
        if not 0 <= metres <= CABLE_M_MAX:
            raise BoardError(f'[cables] {name}: a cable of 3.3 V logic has 0 to {CABLE_M_MAX} m, not {metres}')
    if not 1 <= board['shift']['chain_bits'] <= 256:
        raise BoardError('a chain has 1 to 256 bits: a whole pattern must fit the shifter\'s FIFO')


def read_board(path):
    with open(path, 'rb') as file:
        board = tomllib.load(file)
    try:
        check(board)
    except KeyError as key:
        raise BoardError(f'{path}: {key} is missing') from None
    except BoardError as error:
        raise BoardError(f'{path}: {error}') from None
    return board


def enum(pairs):
    return ['enum {'] + [f'    {name} = {value},' for name, value in pairs] + ['};']


def header(board):
    """What board.h includes: names as C knows them."""
    outputs, can = board['outputs'], board.get('can')
    pairs = [(f'BOARD_PIN_{name}', outputs[name]['gpio']) for name in present(board, OUTPUTS)]
    pairs += [('BOARD_PIN_TIMELINE', outputs['LATCH']['gpio']),
              ('BOARD_PIN_STOP_INPUTS', board['stop_inputs']['ESTOP']['gpio']),
              ('BOARD_PIN_GENLOCK', board['inputs']['GENLOCK']['gpio']),
              ('BOARD_LIGHT_EN_ACTIVE_LOW', int(board['light']['enable_active_low'])),
              ('BOARD_CHAIN_BITS', board['shift']['chain_bits']), ('BOARD_SHIFT_DIVIDER', board['shift']['divider'])]
    pairs += [(f'BOARD_{name.upper()}', value) for name, value in board['limits'].items()]
    pairs += [(f'BOARD_CABLE_{name.removesuffix("_m").upper()}_ECHO_TICKS', echo_ticks(board['cables'][name])) for name in CABLES]
    if can:
        pairs += [(f'BOARD_PIN_{name}', can['pins'][name]['gpio']) for name in CAN_PINS]
        pairs += [('BOARD_CAN_SPI', can['spi']), ('BOARD_CAN_OSCILLATOR_HZ', can['oscillator_hz'])]
    gpios = ', '.join(str(outputs[name]['gpio']) for name in present(board, PLAYER))
    lines = ['// SPDX-License-Identifier: MIT', f'// Made by board_pins.py from boards/{board["name"]}.toml.',
             '#ifndef OLS_BOARD_PINS_H', '#define OLS_BOARD_PINS_H', '', f'#define BOARD_NAME "{board["name"]}"',
             f'#define BOARD_HAS_CAN {int(bool(can))}',
             f'#define BOARD_OUTPUT_PINS {{{gpios}}}  // of PIO block 0', '']
    return '\n'.join(lines + enum(pairs) + ['', '#endif']) + '\n'


def boards_json(boards):
    """GPIOs by signal, for programs that cannot read TOML."""
    def gpios(pins):
        return {name: pin['gpio'] for name, pin in pins.items()}
    tables = {board['name']: {'title': board['title'], 'chainBits': board['shift']['chain_bits'],
                              'outputs': gpios({name: board['outputs'][name] for name in present(board, OUTPUTS)}),
                              'stopInputs': gpios(board['stop_inputs']), 'inputs': gpios(board['inputs']),
                              'can': {'spi': board['can']['spi'], 'pins': gpios(board['can']['pins'])} if 'can' in board else None}
              for board in boards}
    return json.dumps(tables, indent=2) + '\n'


def echo_ticks(metres):
    """How long what a far end sends back may take there and back, in whole ticks."""
    return math.ceil(2 * metres * CABLE_NS_PER_M / TICK_NS)


def rows(board):
    """(signal, pin, direction, pull, use): internal pulls as board_init sets them."""
    active_low = board['light']['enable_active_low']
    for name in present(board, OUTPUTS):
        up = name == 'LIGHT_EN' and active_low
        yield name, board['outputs'][name], 'out', 'up' if up else 'down'
    for name, pin in list(board['stop_inputs'].items()) + list(board['inputs'].items()):
        yield name, pin, 'in', 'down'
    for name, pin in board.get('can', {'pins': {}})['pins'].items():
        yield name, pin, 'in' if name in ('CAN_MISO', 'CAN_INTERRUPT') else 'out', '-'


def table(boards):
    lines = []
    for board in boards:
        lines += [f'**{board["title"]}** (`BOARD={board["name"]}`)', '',
                  '| signal | GPIO | on the board | direction | pull in the chip | use |', '| --- | --- | --- | --- | --- | --- |']
        lines += [f'| {name} | {pin["gpio"]} | {pin["connector"]} | {direction} | {pull} | {pin["use"]} |'
                  for name, pin, direction, pull in rows(board)]
        lines.append('')
    return '\n'.join(lines[:-1]) + '\n'


def with_table(text, boards):
    """`text` with what is between the two marks made anew."""
    before, begin, rest = text.partition(BEGIN)
    _, end, after = rest.partition(END)
    if not begin or not end:
        raise BoardError(f'no place for the pin tables: put {BEGIN.strip()} and {END.strip()} on lines of their own')
    return before + begin + table(boards) + end + after


def main(arguments):
    if len(arguments) < 2:
        raise SystemExit(__doc__)
    what, *paths = arguments
    target = paths.pop(0) if what.startswith('write-') else None
    boards = [read_board(path) for path in paths]
    if what == 'header' and len(boards) == 1:
        print(header(boards[0]), end='')
    elif what == 'json':
        print(boards_json(boards), end='')
    elif what == 'table':
        print(table(boards), end='')
    elif what in ('write-json', 'write-table'):
        with open(target, encoding='utf-8') as file:
            text = file.read()
        made = boards_json(boards) if what == 'write-json' else with_table(text, boards)
        with open(target, 'w', encoding='utf-8') as file:
            file.write(made)
    else:
        raise SystemExit(__doc__)


if __name__ == '__main__':
    try:
        main(sys.argv[1:])
    except BoardError as board_error:
        raise SystemExit(str(board_error)) from None
