# SPDX-License-Identifier: MIT
"""The layout hash changes with the wire format and with nothing else."""
import importlib.util
import re
import subprocess
from pathlib import Path

import pytest

PROTOCOL = Path(__file__).resolve().parents[2] / 'protocol'
spec = importlib.util.spec_from_file_location('layout_hash', PROTOCOL / 'layout_hash.py')
layout_hash = importlib.util.module_from_spec(spec)
spec.loader.exec_module(layout_hash)
WIRE = (PROTOCOL / 'wire.h').read_text(encoding='utf-8')


def changed(pattern, replacement):
    source, count = re.subn(pattern, replacement, WIRE, count=1)
    assert count == 1, f'wire.h no longer has {pattern}'
    return layout_hash.layout_hash(source)


@pytest.mark.parametrize('pattern, replacement', [
    (r'// of this board\'s shift chain', '// something else; struct fake { uint8_t a; };'),
    (r'uint32_t tick_hz;', 'uint32_t   tick_hz ;\n\n'),
    (r'uint32_t tick_hz;', '/* a comment\n over lines */ uint32_t tick_hz;'),
])
def test_comments_and_white_space_leave_the_hash(pattern, replacement):
    assert changed(pattern, replacement) == layout_hash.layout_hash(WIRE)


@pytest.mark.parametrize('pattern, replacement', [
    (r'uint32_t tick_hz;', 'uint32_t tick_rate_hz;'),
    (r'uint32_t tick_hz;', 'int32_t tick_hz;'),
    (r'uint32_t tick_hz;', 'uint32_t tick_hz;\n    uint8_t spare;'),
    (r'char firmware_version\[24\]', 'char firmware_version[20]'),
    (r'(uint32_t boot_nonce;[^\n]*\n)(\s*uint32_t tick_hz;)', r'\2\n\1'),
    (r'OLS_ARM = 0x05', 'OLS_ARM = 0x15'),
    (r'OLS_STATE_DONE = 4', 'OLS_STATE_FINISHED = 4'),
    (r'#define OLS_FRAME_SYNC 0x534c', '#define OLS_FRAME_SYNC 0x534d'),
])
def test_a_changed_field_enumerator_or_constant_changes_the_hash(pattern, replacement):
    assert changed(pattern, replacement) != layout_hash.layout_hash(WIRE)


def test_the_order_of_definitions_does_not_matter():
    struct = re.search(r'struct ols_load_chunk \{.*?\};', WIRE, re.S)[0]
    moved = WIRE.replace(struct, '') + struct
    assert layout_hash.layout_hash(moved) == layout_hash.layout_hash(WIRE)


def test_offsets_and_sizes_are_those_of_the_compiler(tmp_path):
    """The script's own reckoning of packed structs against offsetof and sizeof of a C compiler."""
    lines = [line.split() for line in layout_hash.layout(WIRE) if line.startswith('struct')]
    checks = []
    for _, name, offset, *field in lines:
        if field == ['end']:
            checks.append(f'_Static_assert(sizeof(struct {name}) == {offset}, "{name}");')
        else:
            checks.append(f'_Static_assert(offsetof(struct {name}, {field[1].split("[")[0]}) == {offset}, "{name}");')
    assert len(checks) > 50
    source = tmp_path / 'check.c'
    source.write_text('#include <stddef.h>\n#include "wire.h"\n' + '\n'.join(checks))
    subprocess.run(['cc', '-std=c11', '-fsyntax-only', f'-I{PROTOCOL}', source], check=True)


@pytest.mark.parametrize('text, message', [
    ('struct s { float x; };', 'use a fixed-size integer'),
    ('struct s { uint8_t a, b; };', 'cannot read the field'),
    ('enum e { A };', 'explicit number'),
])
def test_what_the_script_cannot_read_is_an_error_and_no_hash(text, message):
    with pytest.raises(SystemExit, match=message):
        layout_hash.layout_hash(text)
