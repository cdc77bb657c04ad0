#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Writes a flash image as UF2, the format the RP2040's boot ROM takes over USB (datasheet 2.8.4.2; the block layout is
that of the UF2 specification: 512-byte blocks of 256 bytes of payload).

usage: uf2.py image.bin image.uf2
"""
import struct
import sys

FLASH = 0x10000000
RP2040_FAMILY = 0xe48bff56
FAMILY_PRESENT = 0x00002000
PAYLOAD_BYTES = 256


def blocks(image):
    """The UF2 blocks of an image that begins at the start of flash."""
    count = -(-len(image) // PAYLOAD_BYTES)
    for number in range(count):
        payload = image[number * PAYLOAD_BYTES:(number + 1) * PAYLOAD_BYTES].ljust(PAYLOAD_BYTES, b'\0')
        yield (struct.pack('<8I', 0x0a324655, 0x9e5d5157, FAMILY_PRESENT, FLASH + number * PAYLOAD_BYTES,
                           PAYLOAD_BYTES, number, count, RP2040_FAMILY) +
               payload.ljust(476, b'\0') + struct.pack('<I', 0x0ab16f30))


def main(arguments):
    if len(arguments) != 2:
        raise SystemExit(__doc__)
    with open(arguments[0], 'rb') as file:
        image = file.read()
    with open(arguments[1], 'wb') as file:
        file.write(b''.join(blocks(image)))


if __name__ == '__main__':
    main(sys.argv[1:])
