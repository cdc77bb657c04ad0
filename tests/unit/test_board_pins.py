# SPDX-License-Identifier: MIT
"""The pin tables of the boards: made from one source, in step with what is committed, and refused when they cannot be right."""
import copy
import json
import re
import struct
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / 'firmware' / 'tools'))
import board_pins  # noqa: E402

BOARDS = sorted((ROOT / 'firmware' / 'boards').glob('*.toml'))
BOARD_IDS = [path.stem for path in BOARDS]

# Raspberry Pi Pico datasheet, figure 2: GPIO 0 to 22 on pins 1 to 29, those ending in 3 and 8 being grounds; 30 is RUN.
PICO_PIN = dict(enumerate(pin for pin in range(1, 30) if pin % 5 != 3)) | {26: 31, 27: 32, 28: 34}
# Adafruit's schematic of the Feather RP2040 CAN, sheet 1: headers JP1 and JP3.
FEATHER_PIN = {'TX': 0, 'RX': 1, 'SDA': 2, 'SCL': 3, 'D4': 4, 'D5': 5, 'D6': 6, 'MISO': 8, 'D9': 9, 'D10': 10, 'D11': 11,
               'D12': 12, 'D13': 13, 'SCK': 14, 'MOSI': 15, 'D24': 24, 'D25': 25, 'A0': 26, 'A1': 27, 'A2': 28, 'A3': 29}
FEATHER_ON_BOARD = {'CAN_STANDBY': 16, 'CAN_RESET': 18, 'CAN_CS': 19, 'CAN_INTERRUPT': 22}


def pins_of(board):
    pins = {**board['outputs'], **board['stop_inputs'], **board['inputs']}
    return {**pins, **board.get('can', {'pins': {}})['pins']}


@pytest.fixture
def pico():
    return board_pins.read_board(ROOT / 'firmware/boards/pico.toml')


def test_the_committed_tables_of_the_emulated_board_are_those_of_the_source():
    committed = (ROOT / 'tools/stagesim/board/boards.json').read_text()
    assert committed == board_pins.boards_json([board_pins.read_board(path) for path in BOARDS]), \
        'run: python3 firmware/tools/board_pins.py write-json tools/stagesim/board/boards.json firmware/boards/*.toml'


def test_the_tables_of_the_hardware_manual_are_those_of_the_source():
    committed = (ROOT / 'docs/hardware.md').read_text()
    assert committed == board_pins.with_table(committed, [board_pins.read_board(path) for path in BOARDS]), \
        'run: python3 firmware/tools/board_pins.py write-table docs/hardware.md firmware/boards/*.toml'


def test_every_board_is_named_as_its_file():
    assert [board_pins.read_board(path)['name'] for path in BOARDS] == BOARD_IDS


def test_the_picos_connector_pins_are_those_of_its_datasheet(pico):
    for name, pin in pins_of(pico).items():
        assert pin['connector'] == f'pin {PICO_PIN[pin["gpio"]]}', name


def test_the_feathers_header_pins_are_those_of_its_schematic():
    for name, pin in pins_of(board_pins.read_board(ROOT / 'firmware/boards/feather_can.toml')).items():
        expected = FEATHER_ON_BOARD[name] if pin['connector'] == 'on board' else FEATHER_PIN[pin['connector']]
        assert pin['gpio'] == expected, name


@pytest.mark.parametrize('change, message', [
    (lambda b: b['outputs']['TRIG2'].update(gpio=24), 'consecutive'),
    (lambda b: b['stop_inputs']['OPEN_LAMP'].update(gpio=24), 'consecutive'),
    (lambda b: b['inputs']['GENLOCK'].update(gpio=5), 'GPIO 5 is both LIGHT_EN and GENLOCK'),
    (lambda b: b['inputs']['GENLOCK'].update(gpio=30), 'GPIO 0 to 29'),
    (lambda b: b['outputs'].pop('SYNC'), r'\[outputs\] must name'),
    (lambda b: b['outputs'].pop('PHOTO'), r'\[outputs\] must name'),
    (lambda b: b['outputs']['READY'].update(gpio=23), 'consecutive'),
    (lambda b: b.update(name='a_name_of_more_than_15'), 'longer than the 15 bytes'),
    (lambda b: b['outputs'].pop('HEALTHY'), r'\[outputs\] must name'),
    (lambda b: b['shift'].update(chain_bits=257), '1 to 256'),
    (lambda b: b['cables'].update(trigger_m=11), '0 to 10 m'),
    (lambda b: b['cables'].update(trigger_m=-1), '0 to 10 m'),
    (lambda b: b['cables'].update(tirgger_m=3), r'\[cables\] must name trigger_m'),
    (lambda b: b['cables'].clear(), r'\[cables\] must name trigger_m'),
])
def test_pins_that_no_firmware_could_drive_are_refused(pico, change, message):
    board_pins.check(pico)
    wrong = copy.deepcopy(pico)
    change(wrong)
    with pytest.raises(board_pins.BoardError, match=message):
        board_pins.check(wrong)


@pytest.mark.parametrize('metres, ticks', [(0, 0), (0.5, 1), (0.8, 1), (0.81, 2), (3, 4), (10, 13)])
def test_an_echo_takes_the_cable_there_and_back_in_whole_ticks(pico, metres, ticks):
    pico['cables']['trigger_m'] = metres
    assert f'BOARD_CABLE_TRIGGER_ECHO_TICKS = {ticks},' in board_pins.header(pico)


@pytest.mark.parametrize('path', BOARDS, ids=BOARD_IDS)
def test_what_ends_the_light_does_not_touch_healthy(path):
    board = board_pins.read_board(path)
    assert board['outputs']['HEALTHY']['gpio'] == 26
    pins = re.search(r'BOARD_OUTPUT_PINS \{(.*?)\}', board_pins.header(board))[1].split(', ')
    assert len(pins) == len(board['outputs']) - 2 and '26' not in pins


def test_a_board_may_have_no_ready(pico):
    del pico['outputs']['READY']
    board_pins.check(pico)
    assert 'READY' not in board_pins.header(pico) + board_pins.table([pico]) + board_pins.boards_json([pico])


@pytest.mark.parametrize('path', BOARDS, ids=BOARD_IDS)
def test_the_compiler_reads_the_header_as_the_source_says(path, tmp_path):
    board = board_pins.read_board(path)
    names = ['DATA', 'CLK', 'LATCH', 'LIGHT_EN', 'TRIG0', 'SYNC', 'TIMELINE', 'STOP_INPUTS', 'GENLOCK', 'PHOTO',
             'HEALTHY']
    program = tmp_path / 'print.c'
    (tmp_path / 'board_pins.h').write_text(board_pins.header(board))
    program.write_text('#include <stdio.h>\n#include "board_pins.h"\n'
                       'int main(void) { const int outputs[] = BOARD_OUTPUT_PINS; unsigned mask = 0;'
                       'for (unsigned n = 0; n < sizeof outputs / sizeof *outputs; n++) mask |= 1u << outputs[n];'
                       'printf("[\\"%s\\", %u' + ', %d' * len(names) + ']", BOARD_NAME, mask, ' +
                       ', '.join(f'BOARD_PIN_{name}' for name in names) + '); }\n')
    subprocess.run(['cc', '-o', tmp_path / 'print', program], check=True)
    name, mask, *gpios = json.loads(subprocess.run([tmp_path / 'print'], check=True, capture_output=True).stdout)
    pins = pins_of(board)
    pins.update(TIMELINE=pins['LATCH'], STOP_INPUTS=pins['ESTOP'])
    assert (name, gpios) == (path.stem, [pins[signal]['gpio'] for signal in names])
    assert {gpio for gpio in range(32) if mask >> gpio & 1} == \
        {pin['gpio'] for signal, pin in board['outputs'].items() if signal not in ('PHOTO', 'HEALTHY')}  # which the other PIO block and the main loop drive


@pytest.mark.parametrize('name', BOARD_IDS)
def test_each_image_says_at_its_fixed_place_which_board_it_is_for(name):
    data = (ROOT / 'build/firmware' / name / 'stage.uf2').read_bytes()
    second = data[512:1024]  # the 256 bytes behind boot2
    assert struct.unpack_from('<I', second, 12)[0] == 0x10000100
    magic, size, _, board, version = struct.unpack_from('<4sIQ16s24s', second, 32 + 8)
    assert (magic, size, board.rstrip(b'\0')) == (b'OLab', 56, name.encode())
    assert version.rstrip(b'\0').decode().count('.') == 2
