# SPDX-License-Identifier: MIT
"""What a USB3 Vision camera sends: bulk endpoints of SuperSpeed, and an image as leader, payload and trailer (USB3 Vision 1.0.1, "Image
leader", "Image trailer", "Image extended chunk"). Packing by PFNC 2.4."""
import collections
import dataclasses
import struct
import time

import numpy

from u3v_descriptors import PACKET_BYTES
from usb_port import CANCELLED

OK, STALL, OVERFLOW = 0, -1, -5
IMAGE, IMAGE_WITH_CHUNKS = 0x0001, 0x4001
CHUNK_IMAGE, CHUNK_TIME, CHUNK_HEAD_BYTES, CHUNK_TIME_BYTES = 0x4000, 0x4001, 8, 8


class BulkIn:
    """A bulk IN endpoint: packets wait for transfers, transfers for packets. A transfer ends with a packet that is not full, or when
    it is; a packet that is more than it has room for is lost with it (USB 3.2 8.10.2, xHCI 1.2 4.10.2.4.1: babble)."""

    def __init__(self):
        self.transfers, self.packets = collections.deque(), collections.deque()  # transfers: [tag, capacity, bytes]
        self.asked_at = 0.0  # when the last one came
        self.is_halted, self.is_silent = False, False

    def ask(self, tag, capacity):
        self.transfers.append([tag, capacity, b""])
        self.asked_at = time.monotonic()

    def give(self, data, room):
        """One transfer of the device's, which the host has asked `room` bytes for: shorter ones end with a short packet, be it empty."""
        self.packets.extend(data[n : n + PACKET_BYTES] for n in range(0, len(data), PACKET_BYTES))
        if len(data) < room and len(data) % PACKET_BYTES == 0:
            self.packets.append(b"")

    def cancel(self, tag):
        found = [one for one in self.transfers if one[0] == tag]
        for one in found:
            self.transfers.remove(one)
        return [(tag, CANCELLED, b"")] if found else []

    def advance(self):
        """The transfers that have ended: (tag, status, data)."""
        ended = []
        while self.transfers and not self.is_silent:
            tag, capacity, data = self.transfers[0]
            if self.is_halted:
                ended.append((tag, STALL, b""))
            elif not self.packets:
                break
            else:
                packet = self.packets.popleft()
                self.transfers[0][2] = data = data + packet
                if len(data) > capacity:
                    ended.append((tag, OVERFLOW, b""))
                elif len(packet) == PACKET_BYTES and len(data) < capacity:
                    continue
                else:
                    ended.append((tag, OK, data))
            self.transfers.popleft()
        return ended


def packed(samples, pixel_format):
    """As such a camera sends them: unpacked, the lowest bits first in two bytes, or one behind the other ("p")."""
    if pixel_format.endswith("p"):
        bits = int("".join(filter(str.isdigit, pixel_format)))
        every = (samples[:, None] >> numpy.arange(bits, dtype=samples.dtype)) & 1
        return numpy.packbits(every.astype("u1").ravel(), bitorder="little").tobytes()
    return samples.astype("u1" if pixel_format.endswith("8") else "<u2").tobytes()


@dataclasses.dataclass
class Block:
    """An exposure on its way. What is to be wrong with it a test says by these."""
    id: int
    time_ns: int
    samples: numpy.ndarray
    pixel_code: int
    region: tuple  # width, height, offset x, offset y
    payload: bytes
    chunk_time_ns: int | None = None  # the leader's is that of readout then
    status: int = 0
    sent_bytes: int | None = None  # of the payload, when it is cut short
    has_leader: bool = True
    has_trailer: bool = True

    def with_chunks(self):
        """The payload as chunks: data before identifier and length, which are little-endian here. The time is as the description says."""
        return (self.payload + struct.pack("<II", CHUNK_IMAGE, len(self.payload)) + struct.pack(">Q", self.chunk_time_ns)
                + struct.pack("<II", CHUNK_TIME, CHUNK_TIME_BYTES))

    def leader(self):
        kind = IMAGE if self.chunk_time_ns is None else IMAGE_WITH_CHUNKS
        return struct.pack("<4sHHQHHQI4IHH", b"U3VL", 0, 52, self.id, 0, kind, self.time_ns, self.pixel_code, *self.region, 0, 0)

    def data(self):
        whole = self.payload if self.chunk_time_ns is None else self.with_chunks()
        return whole[: self.sent_bytes]

    def trailer(self, valid_bytes):
        size = 32 if self.chunk_time_ns is None else 36
        head = struct.pack("<4sHHQHHQI", b"U3VT", 0, size, self.id, self.status, 0, valid_bytes, self.region[1])
        return head.ljust(size, b"\0")

    def give(self, endpoint, registers):
        """In transfers as the host has programmed them. A payload that is shorter ends the one that it ends in."""
        if self.has_leader:
            endpoint.give(self.leader(), registers["SI_MAXIMUM_LEADER"])
        rooms = [registers["SI_PAYLOAD_SIZE"]] * registers["SI_PAYLOAD_COUNT"]
        rooms += [room for room in (registers["SI_TRANSFER1"], registers["SI_TRANSFER2"]) if room]
        data, done = self.data(), 0
        for room in rooms:
            part = data[done : done + room]
            endpoint.give(part, room)
            done += len(part)
            if len(part) < room:
                break
        if self.has_trailer:
            endpoint.give(self.trailer(done), registers["SI_MAXIMUM_TRAILER"])
