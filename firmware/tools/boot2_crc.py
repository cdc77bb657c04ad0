#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Appends to the 252 bytes of boot2 the CRC-32 that the boot ROM checks before running it (RP2040 datasheet 2.8.1.3.1:
polynomial 0x04c11db7, start 0xffffffff, no reflection, no final inversion), as an assembler source.

usage: boot2_crc.py boot2.bin > boot2_padded.S
"""
import sys

CODE_BYTES = 252


def crc32_mpeg2(data):
    crc = 0xffffffff
    for byte in data:
        crc ^= byte << 24
        for _ in range(8):
            crc = (crc << 1 ^ (0x04c11db7 if crc & 0x80000000 else 0)) & 0xffffffff
    return crc


def main(arguments):
    if len(arguments) != 1:
        raise SystemExit(__doc__)
    with open(arguments[0], 'rb') as file:
        code = file.read()
    if len(code) > CODE_BYTES:
        raise SystemExit(f'{arguments[0]}: {len(code)} bytes, and the boot ROM loads {CODE_BYTES}: shorten boot2.S')
    code = code.ljust(CODE_BYTES, b'\0')
    code += crc32_mpeg2(code).to_bytes(4, 'little')
    print('// Made by boot2_crc.py.\n    .section .boot2, "ax"\n    .global boot2\nboot2:')
    for offset in range(0, len(code), 16):
        print('    .byte ' + ', '.join(f'0x{byte:02x}' for byte in code[offset:offset + 16]))


if __name__ == '__main__':
    main(sys.argv[1:])
