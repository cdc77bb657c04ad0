# SPDX-License-Identifier: MIT
"""The firmware's build tools against independent programs: pioasm.py against adafruit_pioasm, boot2's CRC against a
bit-reversed zlib, the UF2 file against the ELF file it was made from."""
import importlib.util
import re
import struct
import zlib
from pathlib import Path

import adafruit_pioasm
import pytest

ROOT = Path(__file__).resolve().parents[2]
IMAGE = ROOT / 'build' / 'firmware'
PULSE = (ROOT / 'firmware' / 'pulse.pio').read_text(encoding='utf-8')


def tool(name):
    spec = importlib.util.spec_from_file_location(name, ROOT / 'firmware' / 'tools' / f'{name}.py')
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


pioasm = tool('pioasm')


def independent(source):
    """Words by adafruit_pioasm, which takes one program at a time, and only the directives of the language's core."""
    source = re.sub(r'(;|//).*', '', source)
    defines = dict(re.findall(r'^\s*\.define\s+public\s+(\w+)\s+(\d+)', source, flags=re.M))
    source = re.sub(r'^\s*\.define.*$', '', source, flags=re.M).replace('public ', '')
    for name, value in defines.items():
        source = re.sub(rf'\[{name} - (\d+)\]', lambda match: f'[{int(value) - int(match[1])}]', source)
    return list(adafruit_pioasm.assemble(source))


@pytest.mark.parametrize('number, name', [(0, 'timeline'), (1, 'shifter'), (2, 'guard'), (3, 'witness'),
                                          (4, 'light_watch'), (5, 'receptor')])
def test_pulse_pio_assembles_to_the_words_of_an_independent_assembler(number, name):
    program = pioasm.parse(PULSE, {})[number]
    assert program.name == name
    source = '.program' + PULSE.split('.program')[number + 1]
    assert program.assemble() == independent(source)


EVERY_INSTRUCTION = [
    'jmp here', 'jmp !x here', 'jmp x-- here', 'jmp !y here', 'jmp y-- here', 'jmp x!=y here', 'jmp pin here',
    'jmp !osre here', 'wait 0 gpio 31', 'wait 1 pin 3', 'wait 1 irq 7', 'in pins, 32', 'in x, 1', 'in y, 8',
    'in null, 5', 'in isr, 31', 'in osr, 16', 'out pins, 1', 'out x, 19', 'out y, 32', 'out null, 4',
    'out pindirs, 2', 'out pc, 5', 'out isr, 3', 'out exec, 16', 'push block', 'push noblock', 'pull block',
    'pull noblock', 'mov pins, x', 'mov x, y', 'mov y, null', 'mov exec, isr', 'mov pc, osr', 'mov isr, pins',
    'mov osr, status', 'mov x, ~y', 'irq 0', 'irq wait 4', 'irq clear 7', 'set pins, 31',
    'set x, 0', 'set y, 7', 'set pindirs, 1', 'nop',
]


@pytest.mark.parametrize('instruction', EVERY_INSTRUCTION)
@pytest.mark.parametrize('suffix, directive', [('', ''), (' [31]', ''), (' side 1', '.side_set 1'),
                                               (' side 2 [7]', '.side_set 2')])
def test_each_instruction_encodes_as_an_independent_assembler_has_it(instruction, suffix, directive):
    source = f'.program p\n{directive}\nnop{" side 0" if directive else ""}\nhere:\n{instruction}{suffix}\n'
    assert pioasm.parse(source, {})[0].assemble() == independent(source)


@pytest.mark.parametrize('line, message', [
    ('jmp nowhere', 'no label "nowhere"'),
    ('set x, 32', '32 is not in 0..31'),
    ('out x, 0', '0 is not in 1..32'),
    ('mov nothing, x', '"nothing" is not one of'),
    ('frobnicate', 'unknown instruction'),
    ('nop side 1', 'needs "side" exactly when'),
    ('.lang_opt x', 'unknown directive'),
])
def test_a_wrong_line_is_named(line, message):
    with pytest.raises(pioasm.AssemblyError, match=f'line 3: .*{message}'):
        for program in pioasm.parse(f'.program p\n\n{line}\n', {}):
            program.assemble()


def test_a_define_can_be_replaced_and_an_unknown_one_is_refused():
    source = '.program p\n.define public WAIT_TICKS 4\nnop [WAIT_TICKS - 1]\n'
    (four,), (nine,) = (pioasm.parse(source, replaced)[0].assemble() for replaced in ({}, {'WAIT_TICKS': 9}))
    assert (four >> 8 & 31, nine >> 8 & 31) == (3, 8)
    with pytest.raises(pioasm.AssemblyError, match='nothing defines WAITING'):
        pioasm.parse(source, {'WAITING': 9})


def test_a_program_longer_than_the_block_is_refused():
    with pytest.raises(pioasm.AssemblyError, match='33 instructions'):
        pioasm.parse('.program p\n' + 'nop\n' * 33, {})[0].assemble()


# From here on: the built image.

def elf_segments(path):
    data = path.read_bytes()
    offset, size, count = struct.unpack_from('<I', data, 28)[0], *struct.unpack_from('<HH', data, 42)
    for header in range(offset, offset + size * count, size):
        kind, start, _, physical, bytes_in_file = struct.unpack_from('<5I', data, header)
        if kind == 1 and bytes_in_file:
            yield physical, data[start:start + bytes_in_file]


def flash_of_elf():
    flash = {}
    for address, data in elf_segments(IMAGE / 'stage.elf'):
        flash.update(enumerate(data, address))
    return flash


def test_boot2_carries_the_crc_that_the_boot_rom_checks():
    """zlib's CRC-32 with every byte and the result bit-reversed, and without the final inversion, is the boot ROM's."""
    flash = flash_of_elf()
    boot2 = bytes(flash[0x10000000 + i] for i in range(256))
    reverse = bytes(int(f'{byte:08b}'[::-1], 2) for byte in range(256))
    expected = int(f'{zlib.crc32(boot2[:252].translate(reverse)) ^ 0xffffffff:032b}'[::-1], 2)
    assert int.from_bytes(boot2[252:], 'little') == expected
    damaged = bytes([boot2[0] ^ 1]) + boot2[1:252]
    assert zlib.crc32(damaged.translate(reverse)) != zlib.crc32(boot2[:252].translate(reverse))


def test_the_vector_table_behind_boot2_leads_into_flash_and_the_stack_into_sram():
    flash = flash_of_elf()
    stack, reset = struct.unpack('<II', bytes(flash[0x10000100 + i] for i in range(8)))
    assert 0x20000000 < stack <= 0x20042000
    assert 0x10000100 < reset < 0x10000200 and reset & 1


def test_uf2_holds_the_bytes_of_the_elf_file_for_the_rp2040():
    flash = flash_of_elf()
    data = (IMAGE / 'stage.uf2').read_bytes()
    assert len(data) % 512 == 0
    written = {}
    for number in range(len(data) // 512):
        block = data[number * 512:(number + 1) * 512]
        magic0, magic1, flags, address, size, index, count, family = struct.unpack_from('<8I', block)
        assert (magic0, magic1, flags, family) == (0x0a324655, 0x9e5d5157, 0x2000, 0xe48bff56)
        assert struct.unpack_from('<I', block, 508)[0] == 0x0ab16f30
        assert (size, index, count) == (256, number, len(data) // 512)
        assert address % 256 == 0
        written.update(enumerate(block[32:32 + size], address))
    assert {address: written[address] for address in flash} == flash
    assert len(written) - len(flash) < 512
