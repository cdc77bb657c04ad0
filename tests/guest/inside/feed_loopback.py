# SPDX-License-Identifier: MIT
"""Feeds a v4l2loopback device by write(), as an mmap writer leaves `sequence` 0: frames from standard input, or numbered ones.

usage: feed_loopback.py DEVICE FOURCC WIDTH HEIGHT BYTES [COUNT RATE_HZ]
BYTES is a sample's. Frames on standard input have their time before them (copy_ring.cpp): each is shown so long after the first as it was
exposed after it, by this machine's clock, and the first is held back so that later ones may come late. A numbered frame has its number, from
0, in its first and last sample, as far as it goes in. Says "ready" once the device has its format, waits for a line of standard input if
frames are to be numbered, and at the end says how many it has written, and how many came too late to be shown in time.
"""
import fcntl
import os
import struct
import sys
import time

HELD_BACK_S = 3.0
VIDIOC_S_FMT, OUTPUT, FIELD_NONE = 0xC0D05605, 2, 1  # videodev2.h


def main():
    device, fourcc, *numbers = sys.argv[1:]
    width, height, sample_bytes = map(int, numbers[:3])
    size = width * height * sample_bytes
    fd = os.open(device, os.O_RDWR)
    pix = struct.pack("<II4sIII", width, height, fourcc.encode(), FIELD_NONE, width * sample_bytes, size)
    taken = bytearray(struct.pack("<I4x", OUTPUT) + pix.ljust(200, b"\0"))
    fcntl.ioctl(fd, VIDIOC_S_FMT, taken)
    got = struct.unpack_from("<II4s", taken, 8)
    if got != (width, height, fourcc.encode()):
        sys.exit(f"the device took {got}")
    os.write(fd, bytes(size))  # a first frame: until then nobody may set the device up to read
    os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(1))  # a frame's time is that of its write
    print("ready", flush=True)
    written, latest_s = 1, 0.0
    if len(numbers) > 3:
        count, rate_hz = int(numbers[3]), float(numbers[4])
        sys.stdin.readline()
        begin = time.monotonic()
        for number in range(count):
            time.sleep(max(0.0, begin + number / rate_hz - time.monotonic()))
            mark = (number % 256**sample_bytes).to_bytes(sample_bytes, "little")
            written += os.write(fd, mark + bytes(size - 2 * sample_bytes) + mark) == size
    else:
        begin = None
        while len(record := sys.stdin.buffer.read(8 + size)) == 8 + size:
            exposed_s = int.from_bytes(record[:8], "little") * 1e-9
            if begin is None:
                begin = time.monotonic() + HELD_BACK_S - exposed_s
            time.sleep(max(0.0, begin + exposed_s - time.monotonic()))
            written += os.write(fd, record[8:]) == size
            latest_s = max(latest_s, time.monotonic() - begin - exposed_s)
    print(f"written {written}, the latest {latest_s:.3f} s late", flush=True)
    sys.stdin.read()  # the format goes with the last who has the device open


main()
