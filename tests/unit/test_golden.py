# SPDX-License-Identifier: MIT
"""The bytes of protocol/golden/ by an encoder that shares nothing with wire.h: struct formats and zlib's CRC-32.

`python tests/unit/test_golden.py --write` writes the files anew after a wanted change of the wire format.
"""
import struct
import sys
import zlib
from pathlib import Path

import pytest

GOLDEN = Path(__file__).resolve().parents[2] / 'protocol' / 'golden'
REPLY = 0x80
HASH = 0x0123456789abcdef


def fixed(text, size):
    return text.encode().ljust(size, b'\0')


def slot(kind, triggers, planes, exposure_ticks, period_ticks, offset_ticks):
    return struct.pack('<BBBBIIi', kind, triggers, planes, 0, exposure_ticks, period_ticks, offset_ticks)


def trigger(offset_ticks, width_ticks, skip_kinds, active_low):
    return struct.pack('<iIBBH', offset_ticks, width_ticks, skip_kinds, active_low, 0)


# Lamps 0 to 157 at level 128 of 8 planes, and lamp 0 at 1 more; then a dark slot.
PROGRAM = (slot(1, 0x3, 8, 51000, 57870, -500) + slot(3, 0x1, 0, 51500, 57870, 0) +
           struct.pack('<54I', *[0xffffffff] * 4, 0xfffffffc, *[0] * 37, 0x80000000, *[0] * 11))
TRIGGERS = trigger(-2000, 0, 0, 0) + trigger(100, 6250, 0b1101, 1) + 2 * trigger(0, 0, 0, 0)
# name: (type, payload), all with request id 0x1234.
MESSAGES = {
    'hello': (0x01, struct.pack('<Q', HASH)),
    'hello_reply': (0x01 | REPLY, struct.pack('<Q24s8sIIIHHIIHHII16s', HASH, fixed('1.2.3', 24), bytes(range(0xe0, 0xe8)),
                                              0xdeadbeef, 125_000_000, 1, 176, 1024, 1259, 27, 171, 750, 7, 11,
                                              fixed('pico', 16))),
    'load_begin': (0x02, struct.pack('<HHIIII', 2, 176, 1000, len(PROGRAM), zlib.crc32(PROGRAM), 2500) + TRIGGERS),
    'load_begin_reply': (0x02 | REPLY, b''),
    'load_chunk': (0x03, struct.pack('<I', 0) + PROGRAM),
    'load_end': (0x04, b''),
    'arm': (0x05, struct.pack('<IB3xI', 12500000, 2, 1250)),
    'start': (0x06, b''),
    'stop': (0x07, b''),
    'status': (0x08, b''),
    'status_reply': (0x08 | REPLY, struct.pack('<BBHIQQIIIIB3xII', 5, 2, 179, 0xdeadbeef, 0x1_0000_0001, 0x2_0000_0002,
                                               1234567, 6858, 17, zlib.crc32(PROGRAM), 2, 400, 3)),
    'read_trigger_log': (0x09, struct.pack('<IHH', 358, 48, 0)),
    'trigger_log_reply': (0x09 | REPLY, struct.pack('<IIIHH', 358, 360, 3, 2, 0) +
                          struct.pack('<QIIHBB', 20717472, 358, 1, 178, 1, 0) +
                          struct.pack('<QIIHBB', 20775342, 359, 1, 179, 3, 2)),
    'read_digests': (0x0c, struct.pack('<IHH', 17, 31, 0)),
    'digests_reply': (0x0c | REPLY, struct.pack('<IIIHH', 17, 19, 2, 1, 0) +
                      struct.pack('<QQIIIHBB', 0x1_0000_0000, 0x1_009e_0fe8, 3060, 17, 0x363d6b0e, 180, 1, 1)),
    'clear_fault': (0x0a, b''),
    'swap': (0x0b, b''),
    'swap_reply': (0x0b | REPLY, struct.pack('<IB3x', 1234, 2)),
    'reboot_to_bootloader': (0x0d, b''),
    'error_reply': (0x7f | REPLY, struct.pack('<HH116s', 6, 7, fixed('slot 7: trigger mask 16: 15 at most', 116))),
}


def frame(kind, payload, request_id=0x1234):
    head = struct.pack('<HHHH', 0x534c, len(payload), kind, request_id)
    covered = head + struct.pack('<H', zlib.crc32(head) & 0xffff) + payload
    return covered + struct.pack('<I', zlib.crc32(covered))


def hex_lines(data):
    return ''.join(data[i:i + 16].hex(' ') + '\n' for i in range(0, len(data), 16))


@pytest.mark.parametrize('name', MESSAGES)
def test_golden_bytes_are_what_the_protocol_says(name):
    assert (GOLDEN / f'{name}.hex').read_text(encoding='ascii') == hex_lines(frame(*MESSAGES[name]))


def test_no_golden_file_is_left_over():
    assert {path.stem for path in GOLDEN.glob('*.hex')} == set(MESSAGES)


if __name__ == '__main__' and sys.argv[1:] == ['--write']:
    for message in MESSAGES:
        (GOLDEN / f'{message}.hex').write_text(hex_lines(frame(*MESSAGES[message])), encoding='ascii')
