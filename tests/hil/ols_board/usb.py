# SPDX-License-Identifier: MIT
# A client for the board's USB transfers over a socket (docs/architecture.md).
import socket
import struct

OK, STALL, DISCONNECTED, TIMED_OUT, CANCELLED = 0, -1, -2, -3, -4
BULK_OUT, BULK_IN = 0x01, 0x82
CONTROL, BULK, CANCEL = 0, 1, 2


class Usb:
    """One plugged-in cable. Transfers wait for their reply; `submit` and `reply` let several be under way."""

    def __init__(self, path, wall_timeout_s=60):
        self.socket = socket.socket(socket.AF_UNIX)
        self.socket.settimeout(wall_timeout_s)
        self.socket.connect(str(path))
        self.tag = 0
        self.replies = {}

    def close(self):
        self.socket.close()

    def submit(self, kind, endpoint, payload=b"", capacity=0, timeout_us=0, setup=bytes(8), tag=None):
        if tag is None:
            self.tag += 1
            tag = self.tag
        length = len(payload) or capacity
        head = struct.pack("<IIBBHII8s", 0x54425355, tag, kind, endpoint, 0, length, timeout_us, setup)
        self.socket.sendall(head + payload)
        return tag

    def reply(self, tag):
        while tag not in self.replies:
            magic, found, status, length = struct.unpack("<IIiI", self._read(16))
            assert magic == 0x52425355
            self.replies[found] = (status, self._read(length))
        return self.replies.pop(tag)

    def _read(self, count):
        data = b""
        while len(data) < count:
            part = self.socket.recv(count - len(data))
            if not part:
                raise ConnectionError("the board has gone")
            data += part
        return data

    def control(self, setup, payload=b"", timeout_us=1_000_000):
        return self.reply(self.submit(CONTROL, 0, payload, setup[6] | setup[7] << 8, timeout_us, setup))

    def write(self, payload, timeout_us=1_000_000):
        status, _ = self.reply(self.submit(BULK, BULK_OUT, payload, timeout_us=timeout_us))
        return status

    def read(self, capacity=4096, timeout_us=1_000_000):
        return self.reply(self.submit(BULK, BULK_IN, capacity=capacity, timeout_us=timeout_us))
