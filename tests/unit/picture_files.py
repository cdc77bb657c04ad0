# SPDX-License-Identifier: MIT
# Picture files byte by byte, where no library writes what is wanted.
import struct
import zlib

import numpy as np
import tifffile


def png_chunk(kind, data):
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))


def png(codes, *chunks, bits=16):
    """A PNG file of R G B or grey codes [height, width(, 3)] with further chunks before the pixels."""
    height, width = codes.shape[:2]
    rows = b"".join(b"\0" + row.astype(">u2" if bits == 16 else "u1").tobytes() for row in codes)
    head = struct.pack(">IIBBBBB", width, height, bits, 2 if codes.ndim == 3 else 0, 0, 0, 0)
    body = png_chunk(b"IHDR", head) + b"".join(png_chunk(*c) for c in chunks) + png_chunk(b"IDAT", zlib.compress(rows))
    return b"\x89PNG\r\n\x1a\n" + body + png_chunk(b"IEND", b"")


def tga(codes, right_to_left=False, top_to_bottom=True):
    """Truevision TGA 2.0, 24 bits; `codes` upright."""
    height, width = codes.shape[:2]
    stored = codes[:, ::-1] if right_to_left else codes
    stored = stored if top_to_bottom else stored[::-1]
    flags = 0x10 * right_to_left | 0x20 * top_to_bottom
    return struct.pack("<BBBHHBHHHHBB", 0, 0, 2, 0, 0, 0, 0, 0, width, height, 24, flags) + stored[:, :, ::-1].tobytes()


def bmp(codes, top_to_bottom):
    height, width = codes.shape[:2]
    rows = codes[:, :, ::-1] if top_to_bottom else codes[::-1, :, ::-1]
    data = b"".join(row.tobytes() + b"\0" * (-3 * width % 4) for row in rows)
    head = struct.pack("<IiiHHIIiiII", 40, width, -height if top_to_bottom else height, 1, 24, 0, len(data), 2835, 2835, 0, 0)
    return struct.pack("<2sIHHI", b"BM", 54 + len(data), 0, 0, 54) + head + data


def write_dng(path, mosaic, pattern=(0, 1, 1, 2), black=64, white=4095, crop=None, orientation=1, is_dng=True):
    """A preview in the first directory, the raw mosaic in its sub-directory (DNG 1.4). Camera colours are CIE XYZ."""
    one, zero = (10000, 10000), (0, 10000)
    head = [(274, "H", 1, orientation, True)]
    if is_dng:
        head += [(50706, "B", 4, bytes([1, 4, 0, 0]), True), (50708, "s", 0, "Test Camera", True), (50778, "H", 1, 21, True),
                 (50721, "2i", 9, sum([one, zero, zero, zero, one, zero, zero, zero, one], ()), True),
                 (50728, "2I", 3, (1, 1) * 3, True)]
    raw = [(33421, "H", 2, (2, 2), True), (33422, "B", 4, bytes(pattern), True), (50714, "H", 1, black, True),
           (50717, "H", 1, white, True)]
    if crop:
        raw += [(50719, "H", 2, crop[:2], True), (50720, "H", 2, crop[2:], True)]
    preview = np.full((mosaic.shape[0] // 8, mosaic.shape[1] // 8, 3), 128, np.uint8)
    with tifffile.TiffWriter(path) as file:
        file.write(preview, photometric="rgb", subfiletype=1, subifds=1, extratags=head, metadata=None)
        file.write(mosaic, photometric=32803, extratags=raw, metadata=None)
