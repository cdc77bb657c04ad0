# SPDX-License-Identifier: MIT
# OpenEXR files byte by byte (openexr.com/en/latest/OpenEXRFileLayout.html): uncompressed rows, and whatever header a test asks for.
import struct

import numpy as np

KINDS = {np.dtype(np.uint32): 0, np.dtype(np.float16): 1, np.dtype(np.float32): 2}
LONG_NAMES, MULTI_PART = 0x400, 0x1000


def attribute(name, kind, value):
    return name.encode() + b"\0" + kind.encode() + b"\0" + struct.pack("<i", len(value)) + value


def chromaticities(*eight):
    return ("chromaticities", "chromaticities", struct.pack("<8f", *eight))


def text(name, value):
    return (name, "string", value.encode())


def channel_list(channels, sampling):
    entries = b""
    for name in sorted(channels):
        x, y = sampling.get(name, (1, 1))
        entries += name.encode() + b"\0" + struct.pack("<i4xii", KINDS[channels[name].dtype], x, y)
    return entries + b"\0"


def header(channels, data, display, sampling={}, extra=(), compression=0, replaced={}, part=None):
    """`replaced` gives attributes other bytes than they should have; `part` is a name and a number of chunks."""
    values = {
        "channels": ("chlist", channel_list(channels, sampling)),
        "compression": ("compression", bytes([compression])),
        "dataWindow": ("box2i", struct.pack("<4i", *data)),
        "displayWindow": ("box2i", struct.pack("<4i", *display)),
        "lineOrder": ("lineOrder", b"\0"),
        "pixelAspectRatio": ("float", struct.pack("<f", 1)),
        "screenWindowCenter": ("v2f", struct.pack("<2f", 0, 0)),
        "screenWindowWidth": ("float", struct.pack("<f", 1)),
    }
    if part:
        values |= {"name": ("string", part[0].encode()), "type": ("string", b"scanlineimage"), "chunkCount": ("int", struct.pack("<i", part[1]))}
    for name, kind, value in extra:
        values[name] = (kind, value)
    for name, value in replaced.items():
        values[name] = (values[name][0], value)
    return b"".join(attribute(name, kind, value) for name, (kind, value) in values.items()) + b"\0"


def row_bytes(channels, sampling, y, first_y):
    row = b""
    for name in sorted(channels):
        step = sampling.get(name, (1, 1))[1]
        if y % step == 0:
            row += np.ascontiguousarray(channels[name][y // step - first_y // step]).tobytes()
    return row


def size_of(channels, sampling):
    name = next(n for n in channels if sampling.get(n, (1, 1)) == (1, 1))
    return channels[name].shape


def exr(channels, origin=(0, 0), display=None, sampling={}, extra=(), replaced={}):
    """One part. `origin` is the data window's first pixel, `display` (min_x, min_y, max_x, max_y)."""
    return multi_part_exr([dict(channels=channels, origin=origin, display=display, sampling=sampling, extra=extra, replaced=replaced)], False)


def multi_part_exr(parts, multi=True):
    headers, rows = b"", []
    for number, p in enumerate(parts):
        channels, sampling = p["channels"], p.get("sampling", {})
        height, width = size_of(channels, sampling)
        x, y = p.get("origin", (0, 0))
        data = (x, y, x + width - 1, y + height - 1)
        headers += header(channels, data, p.get("display") or (0, 0, width - 1, height - 1), sampling, p.get("extra", ()),
                          replaced=p.get("replaced", {}), part=(p["name"], height) if multi else None)
        rows.append([(struct.pack("<i", number) if multi else b"") + struct.pack("<ii", y + i, len(row)) + row
                     for i in range(height) for row in [row_bytes(channels, sampling, y + i, y)]])
    start = struct.pack("<ii", 20000630, 2 | (MULTI_PART if multi else 0)) + headers + (b"\0" if multi else b"")
    at = len(start) + 8 * sum(map(len, rows))
    tables, body = b"", b""
    for part in rows:
        for row in part:
            tables += struct.pack("<Q", at + len(body))
            body += row
    return start + tables + body
