# SPDX-License-Identifier: MIT
"""Writes Phantom .cine files from the format's description (Vision Research, "Cine File Format", July 2017), by its structures."""
import struct

import numpy as np

SETUP_BYTES = 12288


def time64(ns):
    """32.32 seconds; the two lowest bits of the fraction are flags (here: not synchronised, event input open)."""
    seconds, rest = divmod(int(ns), 10**9)
    return struct.pack("<II", (rest << 32) // 10**9 & ~3 | 3, seconds)


def setup(cfa, bits, black, white, rate, exposure_ns):
    """SETUP, packed to one byte. Offsets of the fields that are set follow from the sizes of those before."""
    block = bytearray(SETUP_BYTES)
    for offset, form, value in (
        (140, "<H", 0x5453), (142, "<H", SETUP_BYTES),  # Mark "ST", Length
        (737, "<H", 0), (743, "<I", 24110),  # ImWidth, Serial
        (768, "<I", rate), (792, "<I", 2012),  # FrameRate, CameraVersion
        (808, "<I", cfa), (896, "<I", bits),  # CFA, RealBPP
        (1568, "<I", exposure_ns),  # ShutterNs
        (5732, "<i", black), (5736, "<i", white),  # BlackLevel, WhiteLevel
    ):
        struct.pack_into(form, block, offset, value)
    return bytes(block)


def pack(frame, packing):
    if packing == "16":  # a bitmap: the lowest row first
        return frame[::-1].astype("<u2").tobytes()
    if packing == "8":
        return frame[::-1].astype("u1").tobytes()
    width = {"10": 10, "12": 12}[packing]  # a stream of bits, the highest first, the top row first
    bits = (frame.ravel()[:, None] >> np.arange(width - 1, -1, -1)) & 1
    return np.packbits(bits.astype(np.uint8)).tobytes()


def write_cine(path, frames, times_ns=None, packing="16", cfa=4, bits=12, black=64, white=4095, first=-100, rate=2160, annotation=b"", apart=0):
    """`frames`: [n, height, width] of counts; cfa 3: GBRG, 4: RGGB, 5: GRBG, 6: BGGR; first: the number of the first frame;
    apart: from one frame to the next, in bytes, where that is more than it takes (the file has holes there)."""
    count, height, width = frames.shape
    block = setup(cfa, bits, black, white, rate, 412000)
    images = [struct.pack("<I", 8 + len(annotation)) + annotation + struct.pack("<I", len(image)) + image
              for image in (pack(frame, packing) for frame in frames)]
    blocks = b""
    if times_ns is not None:
        stamps = b"".join(time64(t) for t in times_ns)
        blocks += struct.pack("<IHH", 8 + len(stamps), 1002, 0) + stamps
        blocks += struct.pack("<IHH", 8 + 4 * count, 1003, 0) + struct.pack("<I", 412 * 4295) * count
    offsets_at = 44 + 40 + len(block) + len(blocks)
    at, offsets = offsets_at + 8 * count, []
    for image in images:
        offsets.append(at)
        at += max(len(image), apart)
    header = struct.pack("<HHHHiIiIIII", 0x4943, 44, 2, 1, first - 7, count + 50, first, count, 44, 84, offsets_at) + time64(10**18)
    compression = {"16": 0, "8": 0, "10": 256, "12": 1024}[packing]
    depth = 8 if packing == "8" else 16
    bitmap = struct.pack("<IiiHHIIiiII", 40, width, height, 1, depth, compression, len(pack(frames[0], packing)), 0, 0, 0, 4096)
    with open(path, "wb") as file:
        file.write(header + bitmap + block + blocks + struct.pack(f"<{count}q", *offsets))
        for offset, image in zip(offsets, images):
            file.seek(offset)
            file.write(image)
