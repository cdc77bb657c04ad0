# SPDX-License-Identifier: MIT
"""A sequencer board on a Unix socket, written from PROTOCOL.md and architecture.md alone, that can be told to misbehave.

What it does wrong is a function of the FakeBoard: `spoil_reply(board, kind, request_id, payload)` gives the bytes of a message's
reply instead of the honest frame, `spoil_transfer(board, tag, wanted, payload)` those of a transfer's reply on the socket."""
import os
import socket
import struct
import threading
import time
import zlib

HELLO, LOAD_BEGIN, LOAD_CHUNK, LOAD_END, ARM, START, STOP, STATUS, LOG, CLEAR, SWAP, DIGESTS = range(1, 13)
REPLY, ERROR = 0x80, 0x7f
IDLE, LOADED, ARMED, PLAYING, DONE, FAULT = range(6)
TICKS = 57870  # a slot of 2160 Hz
USBR = 0x52425355


def frame(kind, request_id, payload=b""):
    head = struct.pack("<HHHH", 0x534c, len(payload), kind, request_id)
    covered = head + struct.pack("<H", zlib.crc32(head) & 0xffff) + payload
    return covered + struct.pack("<I", zlib.crc32(covered))


def reply_head(tag, status=0, length=0, magic=USBR):
    return struct.pack("<IIiI", magic, tag & 0xffffffff, status, length)


def entry(counter, tick=None, cycle=0, slot=0):
    tick = counter * TICKS if tick is None else tick
    return struct.pack("<QIIHBB", tick, counter & 0xffffffff, cycle, slot, 1, 0)


def log_reply(first, following, entries, lost=0, count=None):
    count = len(entries) if count is None else count
    return struct.pack("<IIIHH", first & 0xffffffff, following & 0xffffffff, lost, count, 0) + b"".join(entries)


def digest(first_counter, cycle=0, count=1, first_tick=0, last_tick=0):
    return struct.pack("<QQIIIHBB", first_tick, last_tick, first_counter, cycle, 0, count, 0, 0)


def digests_reply(first, following, digests, count=None):
    count = len(digests) if count is None else count
    return struct.pack("<IIIHH", first & 0xffffffff, following & 0xffffffff, 0, count, 0) + b"".join(digests)


class FakeBoard:
    """Serves one client after the other until closed. Plays `slots` triggers a cycle, as soon as it is asked for its log."""

    def __init__(self, path, spoil_reply=None, spoil_transfer=None, at=None):
        self.spoil_reply, self.spoil_transfer, self.at = spoil_reply, spoil_transfer, at
        self.state, self.slots, self.cycles, self.fired = IDLE, 180, 1, 0
        self.stops, self.ticks, self.asked, self.out, self.closed = 0, 0, 0, b"", False
        self.server = socket.socket(socket.AF_UNIX)
        self.server.bind(str(path))
        self.server.listen(4)
        self.thread = threading.Thread(target=self.serve, daemon=True)
        self.thread.start()

    def close(self):
        self.closed = True
        self.server.close()

    def serve(self):
        while not self.closed:
            try:
                client, _ = self.server.accept()
            except OSError:
                return
            self.out = b""
            try:
                while self.transfer(client):
                    pass
            except OSError:
                pass
            client.close()

    def receive(self, client, count):
        data = b""
        while len(data) < count:
            part = client.recv(count - len(data))
            if not part:
                return None
            data += part
        return data

    def transfer(self, client):
        head = self.receive(client, 28)
        if head is None:
            return False
        _, tag, _, endpoint, _, length, _, _ = struct.unpack("<IIBBHII8s", head)
        payload = b""
        if endpoint & 0x80:
            payload, self.out = self.out[:length], self.out[length:]
            wanted = length
        else:
            self.messages(self.receive(client, length))
            wanted = 0
        if self.spoil_transfer and self.is_reached():
            return self.send(client, self.spoil_transfer(self, tag, wanted, payload))
        status = -3 if endpoint & 0x80 and not payload else 0
        return self.send(client, [reply_head(tag, status, len(payload)) + payload])

    def send(self, client, pieces):
        """Pieces of bytes to send, numbers of seconds to wait; None closes."""
        for piece in pieces:
            if piece is None:
                return False
            if isinstance(piece, bytes):
                client.sendall(piece)
                continue
            until = time.monotonic() + piece
            while time.monotonic() < until and not self.closed:
                time.sleep(min(0.05, max(0, until - time.monotonic())))
            if self.closed:
                return False
        return True

    def is_reached(self):
        """Whether the board has come to where it is to misbehave: message `at` was asked for."""
        return self.at is None or self.asked & (1 << self.at)

    def messages(self, data):
        while len(data or b"") >= 14:
            _, size, kind, request_id, _ = struct.unpack_from("<HHHHH", data)
            payload, data = data[10:10 + size], data[14 + size:]
            self.asked |= 1 << kind
            honest = self.answer(kind, payload)
            if self.spoil_reply and (self.at is None or kind == self.at):
                self.out += self.spoil_reply(self, kind, request_id, payload)
            else:
                self.out += frame(kind | REPLY, request_id, honest)

    def answer(self, kind, payload):
        return {HELLO: self.hello, STATUS: self.status, LOG: self.log, DIGESTS: self.digests}.get(kind, self.command(kind))(payload)

    def command(self, kind):
        def work(payload):
            if kind == LOAD_BEGIN:
                self.slots, _, self.cycles = struct.unpack_from("<HHI", payload)
            self.stops += kind == STOP
            self.state = {LOAD_END: LOADED, ARM: ARMED, START: PLAYING, STOP: LOADED, CLEAR: IDLE}.get(kind, self.state)
            return b""

        return work

    def hello(self, payload, version=b"1.2.3", board=b"pico"):
        return payload[:8] + struct.pack("<24s8sIIIHHIIHHII16s", version, bytes(8), 7, 125_000_000, 0x5b, 176, 1024, 1259, 27,
                                         171, 1000, 7, 11, board)

    def status(self, _, state=None, nonce=7):
        self.ticks += 1000
        now = self.ticks if self.state == PLAYING else 0
        return struct.pack("<BBHIQQIIIIB3xII", self.state if state is None else state, 0, 0xffff, nonce, 0, now, self.fired, 0, 0,
                           0, 0, 0, 0)

    def total(self):
        return self.slots * self.cycles

    def log(self, payload):
        first, most, _ = struct.unpack("<IHH", payload)
        if self.state == PLAYING:
            self.fired = min(self.total(), self.fired + 48)
            if self.fired == self.total():
                self.state = DONE
        first = min(first, self.fired)
        counters = range(first, min(self.fired, first + most))
        return log_reply(first, self.fired, [entry(n, cycle=n // self.slots, slot=n % self.slots) for n in counters])

    def digests(self, payload):
        first, _, _ = struct.unpack("<IHH", payload)
        return digests_reply(first, first, [])


def remove(path):
    if os.path.exists(path):
        os.remove(path)
