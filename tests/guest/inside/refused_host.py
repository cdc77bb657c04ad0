# SPDX-License-Identifier: MIT
"""A program that tells the RP2040's boot loader a command it does not know, sees both of its endpoints stalled and goes, by the
kernel's own interface to USB (Linux, Documentation/driver-api/usb/usb.rst, "The USB character device nodes")."""
import ctypes
import errno
import fcntl
import pathlib
import struct

CLAIM_INTERFACE, BULK = 0x8004550F, 0xC0185502
INTERFACE, OUT, IN = 1, 0x03, 0x84


def bulk(file, endpoint, data):
    """The error number that the transfer ends with, 0 for none."""
    buffer = ctypes.create_string_buffer(data, len(data))
    try:
        fcntl.ioctl(file, BULK, bytearray(struct.pack("IIIxxxxP", endpoint, len(data), 3000, ctypes.addressof(buffer))))
    except OSError as error:
        return error.errno
    return 0


def main():
    device, = (path.parent for path in pathlib.Path("/sys/bus/usb/devices").glob("*/idVendor") if path.read_text() == "2e8a\n")
    bus, address = (int((device / name).read_text()) for name in ("busnum", "devnum"))
    with open(f"/dev/bus/usb/{bus:03}/{address:03}", "r+b", buffering=0) as file:
        fcntl.ioctl(file, CLAIM_INTERFACE, struct.pack("I", INTERFACE))
        assert bulk(file, OUT, struct.pack("<IIBBHI16x", 0x431FD10B, 1, 0x7F, 0, 0, 0)) == 0
        assert [bulk(file, endpoint, bytes(64)) for endpoint in (IN, OUT)] == [errno.EPIPE, errno.EPIPE]


if __name__ == "__main__":
    main()
