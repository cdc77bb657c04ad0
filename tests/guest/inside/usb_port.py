# SPDX-License-Identifier: MIT
"""A port of the guest's USB (vhci-hcd). For each line on standard input a device is plugged in: its transfers go to the tests, as
USB/IP's messages after its import (Linux, Documentation/usb/usbip_protocol.rst). The device is unplugged when they hang up.

usage: usb_port.py CHANNEL NUMBER SPEED
"""
import pathlib
import sys

from host import channel

HUB = pathlib.Path("/sys/devices/platform/vhci_hcd.0")
DEVICE, SUPER_SPEED = 1, 5  # usb_device_speed of include/uapi/linux/usb/ch9.h
FREE = 4  # VDEV_ST_NULL, told by status


def ports(hub):
    """Of the hub "hs" or "ss": (number among all ports, state)."""
    lines = [line.split() for line in (HUB / "status").read_text().splitlines()[1:]]
    return [(int(line[1]), int(line[2])) for line in lines if line[0] == hub]


def main():
    number, speed = int(sys.argv[2]), int(sys.argv[3])
    hub = "ss" if speed == SUPER_SPEED else "hs"
    for _ in sys.stdin:
        while ports(hub)[number][1] != FREE:
            pass  # the hub has not let go of what was plugged in before
        with channel(sys.argv[1]) as far:
            (HUB / "attach").write_text(f"{ports(hub)[number][0]} {far.fileno()} {DEVICE} {speed}")
        print("plugged", flush=True)


if __name__ == "__main__":
    main()
