# SPDX-License-Identifier: MIT
"""A port of the guest's USB (vhci-hcd). For each line on standard input a device is plugged in: its transfers go to the tests, as
USB/IP's messages after its import (Linux, Documentation/usb/usbip_protocol.rst). The device is unplugged when they hang up.

usage: usb_port.py CHANNEL
"""
import pathlib
import sys

from host import channel

HUB = pathlib.Path("/sys/devices/platform/vhci_hcd.0")
PORT, FULL_SPEED, DEVICE = 0, 2, 1  # usb_device_speed of include/uapi/linux/usb/ch9.h
FREE = 4  # VDEV_ST_NULL, told by status


def is_free():
    """Whether the hub has let go of what was plugged in before."""
    line = (HUB / "status").read_text().splitlines()[1 + PORT].split()
    return int(line[2]) == FREE


def main():
    for _ in sys.stdin:
        while not is_free():
            pass
        with channel(sys.argv[1]) as far:
            (HUB / "attach").write_text(f"{PORT} {far.fileno()} {DEVICE} {FULL_SPEED}")
        print("plugged", flush=True)


if __name__ == "__main__":
    main()
