# SPDX-License-Identifier: MIT
"""The USB descriptors of a USB3 Vision camera on SuperSpeed: USB 3.2 chapter 9.6, and the standard's own of its control interface
(USB3 Vision 1.0.1, "Device information descriptor")."""
import struct

PACKET_BYTES = 1024  # of bulk endpoints on SuperSpeed (USB 3.2 8.12.1.2)
CONTROL, STREAM = 1, 2  # numbers of endpoints; Aravis wants those of the control channel to have one number in both directions
CONTROL_INTERFACE, STREAM_INTERFACE = 0, 1
VENDOR, PRODUCT = 0x1209, 0x0002  # pid.codes' numbers for tests
U3V_CLASS = (0xEF, 0x05)  # and a protocol: 0 control, 1 events, 2 streaming
SUPER_SPEED = 1 << 3  # bmSpeedSupport

DEVICE = struct.pack("<BBHBBBBHHHBBBB", 18, 1, 0x0320, 0xEF, 0x02, 0x01, 9, VENDOR, PRODUCT, 0x0100, 1, 2, 3, 1)

LINK_POWER = struct.pack("<BBBI", 7, 16, 2, 2)
SUPER = struct.pack("<BBBBHBBH", 10, 16, 3, 0, 1 << 3, 3, 0, 0)
BOS = struct.pack("<BBHB", 5, 15, 5 + len(LINK_POWER + SUPER), 2) + LINK_POWER + SUPER


def strings(maker, model, serial, guid):
    """By their index; 0 is the list of languages."""
    return ("", maker, model, serial, guid, "1")


DEVICE_INFORMATION = struct.pack("<BBBIIBBBBBBBBB", 20, 0x24, 1, 0x00010001, 0x00010000, 4, 1, 2, 0, 5, 0, 3, 0, SUPER_SPEED)


def _endpoint(address):
    companion = struct.pack("<BBBBH", 6, 48, 0, 0, 0)
    return struct.pack("<BBBBHB", 7, 5, address, 2, PACKET_BYTES, 0) + companion


def _interface(number, protocol, endpoints, more=b""):
    return struct.pack("<9B", 9, 4, number, 0, len(endpoints), *U3V_CLASS, protocol, 0) + more + b"".join(map(_endpoint, endpoints))


ASSOCIATION = struct.pack("<8B", 8, 11, CONTROL_INTERFACE, 2, *U3V_CLASS, 0, 0)
INTERFACES = (ASSOCIATION + _interface(CONTROL_INTERFACE, 0, (CONTROL | 0x80, CONTROL), DEVICE_INFORMATION)
              + _interface(STREAM_INTERFACE, 2, (STREAM | 0x80,)))
CONFIGURATION = struct.pack("<BBHBBBBB", 9, 2, 9 + len(INTERFACES), 2, 1, 0, 0x80, 112) + INTERFACES  # 896 mA, in units of 8


def string_descriptor(texts, index):
    if index == 0:
        return struct.pack("<BBH", 4, 3, 0x0409)
    if index >= len(texts):
        return None
    text = texts[index].encode("utf-16-le")
    return bytes([2 + len(text), 3]) + text
