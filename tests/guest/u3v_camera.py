# SPDX-License-Identifier: MIT
"""A USB3 Vision camera with a trigger line, as a device for the guest's USB port: every exposure, packet and failure of it is in a
test's hand. Its features and their registers are those of tests/gige/device_description.cpp.

By the standard 1.0.1, its GenCP 1.1 and USB 3.2, whose numbers and layouts are also in Wireshark's packet-u3v.c: descriptors
(u3v_descriptors.py), registers (u3v_registers.py), control channel with PENDING_ACK, stream of images with and without chunks
(u3v_stream.py). A payload that is cut short ends with a short packet, be it empty. Block ids begin at 0 with each acquisition.

Aravis 0.8.26 asks for more: one number for both endpoints of the control channel, a file in the manifest's first entry, a stream
endpoint that takes SET_FEATURE(ENDPOINT_HALT); it reads the stream in transfers that wait for MAXIMUM_DEVICE_RESPONSE_TIME.

Left out: events, the heartbeat and who has the device, zipped descriptions, other speeds, link power, and the camera's own limits of
memory and time: a frame is exposed and sent at once, and waits for its reader for as long as it takes."""
import itertools
import struct
import subprocess
import threading
import time

import numpy

import u3v_descriptors
from u3v_descriptors import CONTROL, STREAM
from u3v_registers import Refused, Registers, Status
from u3v_stream import (CHUNK_HEAD_BYTES, CHUNK_TIME_BYTES, OK, STALL, Block, BulkIn, packed)

MAKER, MODEL = "OLS", "Line"
MAGIC = b"U3VC"
HEADER = struct.Struct("<4sHHHH")  # prefix, flags or status, command, length, request
WANTS_ACKNOWLEDGEMENT = 1 << 14
READ_MEMORY, WRITE_MEMORY, PENDING_ACKNOWLEDGEMENT = 0x0800, 0x0802, 0x0805
CHUNK_FEATURES = ("ChunkModeActive", "ChunkSelector", "ChunkEnable", "ChunkTimestamp")
READOUT_NS = 1_000_000
TIMESTAMP_NS = 7_000_000_000  # its clock is not the host's


def description(program, formats=(), lacks=()):
    return subprocess.run([program, ",".join(formats), ",".join(lacks)], check=True, capture_output=True).stdout


class U3vCamera:
    def __init__(self, description, serial="OLS1", response_ms=2000):
        self.lock, self.serial = threading.RLock(), serial
        texts = {"MANUFACTURER_NAME": MAKER, "MODEL_NAME": MODEL, "DEVICE_VERSION": "1", "MANUFACTURER_INFO": "of the tests", "SERIAL_NUMBER": serial}
        guid = f"{u3v_descriptors.VENDOR:04X}{sum(serial.encode()) * 0x9E3779B1 & 0xFFFFFFFF:08X}"
        self.strings = u3v_descriptors.strings(MAKER, MODEL, serial, guid)
        self.registers = Registers(description, texts, self._refresh, self._wrote)
        self.registers["MAXIMUM_DEVICE_RESPONSE_TIME"] = response_ms
        for name, value in (("WidthMax", 2048), ("HeightMax", 2048), ("Width", 64), ("Height", 48), ("BlackLevel", 64)):
            self.registers[name] = value
        self.registers["PixelFormat"] = next(iter(self.registers.choices["PixelFormat"]))
        # A user left it as it is no good for a take.
        for name, value in ((("TriggerMode", "AcquisitionStart"), "On"), ("ExposureAuto", "Continuous"), ("TriggerSource", "Line2")):
            if (name[0] if isinstance(name, tuple) else name) in self.registers:
                self.registers[name] = value
        self.is_acquiring, self.next_id, self.last_ns = False, 0, 0
        self.pending_ms = {}  # how long a write to a register of that name takes; it is announced
        self.written, self.refused = [], []  # registers' names; of commands (status, address)
        self.answers = True  # on its control channel
        self.requires_payload = True  # says how large a payload is
        self.is_plugged = False

    # ---- What tests do with it.

    def now_ns(self):
        return time.monotonic_ns() + TIMESTAMP_NS

    def _next_ns(self):
        self.last_ns = max(self.now_ns(), self.last_ns + 1)
        return self.last_ns

    def expose(self, samples=None, **wrong):
        """A pulse on Line1. The Block that leaves, with what is to be wrong with it; None where the camera does not take it."""
        with self.lock:
            time_ns, registers = self._next_ns(), self.registers
            is_on = [registers["TriggerMode", of] == "On" for of in registers.choices["TriggerSelector"]] == [True, False, False]
            if not (is_on and registers["TriggerSource"] == "Line1" and self.is_acquiring and registers["SI_CONTROL"] & 1):
                return None
            number, self.next_id = self.next_id, self.next_id + 1
            region = tuple(registers[name] for name in ("Width", "Height", "OffsetX", "OffsetY"))
            pixel_format = registers["PixelFormat"]
            if samples is None:
                samples = self.picture(number, region[0] * region[1], pixel_format)
            block = Block(number, time_ns, samples, registers.choices["PixelFormat"][pixel_format], region,
                          packed(samples, pixel_format), **wrong)
            if self._has_chunks():
                block.time_ns, block.chunk_time_ns = time_ns + READOUT_NS, time_ns
            block.give(self.stream, registers)
            self._advance()
            return block

    def lose(self, count=1):
        """Exposures that never leave it, and have ids."""
        self.next_id += count

    @staticmethod
    def picture(number, pixels, pixel_format):
        """Every bit of it moves, from pixel to pixel and from frame to frame."""
        bits = int("".join(filter(str.isdigit, pixel_format)))
        mixed = (numpy.arange(pixels, dtype="u8") * 2654435761 + number * 40503) >> 7
        return (mixed & ((1 << bits) - 1)).astype("u2")

    def is_asked(self):
        """Whether a transfer waits for a frame, and for a good while yet: Aravis drops what comes while one times out."""
        left_s = self.stream.asked_at + self.registers["MAXIMUM_DEVICE_RESPONSE_TIME"] / 1000 - time.monotonic()
        return bool(self.stream.transfers) and left_s > 1

    def has_sent_all(self):
        return not self.stream.packets

    def hang(self):
        """It answers nothing more, and stays on the bus."""
        with self.lock:
            self.answers, self.stream.is_silent = False, True

    # ---- The port's device.

    def start(self, answer, gone):
        self.answer, self.is_plugged = answer, True
        self.acknowledgements, self.stream = BulkIn(), BulkIn()
        self.configuration = 0

    def close(self):
        self.is_plugged = False

    def submit(self, tag, endpoint, direction, setup, data, capacity):
        with self.lock:
            if endpoint == 0:
                reply = self._request(*struct.unpack("<BBHHH", setup))
                self.answer(tag, STALL if reply is None else OK, (reply or b"")[:capacity])
            elif (endpoint, direction) == (CONTROL, 0):
                self.answer(tag, OK, b"")
                if self.answers:
                    self._command(data)
            elif (endpoint, direction) in self._pipes():
                self._pipes()[endpoint, direction].ask(tag, capacity)
            else:
                self.answer(tag, STALL, b"")
            self._advance()

    def cancel(self, tag):
        with self.lock:
            for pipe in self._pipes().values():
                for ended in pipe.cancel(tag):
                    self.answer(*ended)

    def _pipes(self):
        return {(CONTROL, 1): self.acknowledgements, (STREAM, 1): self.stream}

    def _advance(self):
        for pipe in self._pipes().values():
            for ended in pipe.advance():
                self.answer(*ended)

    # ---- Standard requests: USB 3.2 9.4; None stalls.

    def _request(self, kind, request, value, index, _length):
        if (kind, request) == (0x80, 6):
            if value >> 8 == 3:
                return u3v_descriptors.string_descriptor(self.strings, value & 0xFF)
            return {1: u3v_descriptors.DEVICE, 2: u3v_descriptors.CONFIGURATION, 15: u3v_descriptors.BOS}.get(value >> 8)
        if (kind, request) == (0x80, 8):
            return bytes([self.configuration])
        if (kind, request) == (0x00, 9):
            self.configuration = value
            return b""
        if (kind, request) in ((0x80, 0), (0x81, 0), (0x82, 0)):
            return bytes(2)
        if (kind, request) in ((0x00, 0x30), (0x00, 0x31), (0x01, 11)):  # SET_SEL, SET_ISOCH_DELAY, SET_INTERFACE
            return b""
        pipe = self._pipes().get((index & 0x0F, index >> 7))
        if (kind, value) == (0x02, 0) and request in (1, 3) and pipe:  # ENDPOINT_HALT, cleared and set
            pipe.is_halted = request == 3
            return b""
        return b"" if (kind, request, index) == (0x02, 1, CONTROL) else None

    # ---- Control channel.

    def _command(self, packet):
        if len(packet) < HEADER.size or packet[:4] != MAGIC:
            return
        _, flags, command, length, request = HEADER.unpack_from(packet)
        body, status, data, takes_ms = packet[HEADER.size :], Status.SUCCESS, b"", 0
        address = struct.unpack_from("<Q", body)[0] if len(body) >= 8 else None
        try:
            if address is None or length != len(body):
                raise Refused(Status.INVALID_PARAMETER)
            if command == READ_MEMORY:
                data = self.registers.read(address, *struct.unpack_from("<2xH", body, 8))
            elif command == WRITE_MEMORY:
                self.registers.write(address, body[8:])
                data = struct.pack("<2xH", len(body) - 8)
                takes_ms = sum(ms for name, ms in self.pending_ms.items() if self.registers.ranges[name].address == address)
            else:
                raise Refused(Status.NOT_IMPLEMENTED)
        except Refused as refusal:
            status, data = refusal.status, b""
            self.refused.append((status, address))
        if not flags & WANTS_ACKNOWLEDGEMENT:
            return
        if takes_ms:
            self._acknowledge(Status.SUCCESS, PENDING_ACKNOWLEDGEMENT, request, struct.pack("<2xH", 2 * takes_ms))
            threading.Timer(takes_ms / 1000, self._acknowledge, (status, command + 1, request, data)).start()
        else:
            self._acknowledge(status, command + 1, request, data)

    def _acknowledge(self, status, command, request, data):
        with self.lock:
            packet = HEADER.pack(MAGIC, status, command, len(data), request) + data
            self.acknowledgements.give(packet, room=len(packet) + 1)
            self._advance()

    # ---- Registers with something behind them.

    def _has_chunks(self):
        registers = self.registers
        return "ChunkModeActive" in registers and registers["ChunkModeActive"] and registers["ChunkEnable"]

    def _payload_bytes(self):
        registers = self.registers
        pixel_bits = registers.choices["PixelFormat"][registers["PixelFormat"]] >> 16 & 0xFF
        image = (registers["Width"] * registers["Height"] * pixel_bits + 7) // 8
        return image + (2 * CHUNK_HEAD_BYTES + CHUNK_TIME_BYTES if self._has_chunks() else 0)

    def _refresh(self, name):
        if name == "PayloadSize":
            self.registers[name] = self._payload_bytes()
        elif name == "SI_REQUIRED_PAYLOAD":
            self.registers[name] = self._payload_bytes() if self.requires_payload else 0
        elif name == "AcquisitionStatus":
            self.registers[name] = self.is_acquiring

    def _wrote(self, name):
        registers = self.registers
        self.written.append(name)
        if name in ("Width", "Height") and not 0 < registers[name] <= registers[name + "Max"]:
            raise Refused(Status.INVALID_PARAMETER)
        if name == "AcquisitionStart":
            self.is_acquiring, self.next_id = True, 0
        elif name == "AcquisitionStop":
            self.is_acquiring = False
        elif name == "TimestampLatch":
            registers["TimestampLatchValue"] = self._next_ns()
        elif name == "TIMESTAMP_LATCH":
            registers["TIMESTAMP"] = self._next_ns()
        elif name == "SI_CONTROL" and not registers[name] & 1:
            self.stream.packets.clear()
