# SPDX-License-Identifier: MIT
"""Joins the guest's CAN interface to the emulated board's bus. `to_board` and `from_board` stand between: each gets a frame and
returns those that take its place, so that a test can lose or damage some."""
import socket
import struct
import threading

NOW_ID = 0xFFFFFFFF
FRAME = struct.Struct("<IB3x8s")


def frame(can_id, data):
    return FRAME.pack(can_id, len(data), bytes(data))


def fields(record):
    can_id, length, data = FRAME.unpack(record)
    return can_id, data[:length]


class CanJoin:
    """A handler for Guest.channel(), to be attached to a board; without one it is a bus on which nobody answers."""

    def __init__(self):
        self.near = self.far = None
        self.lock = threading.Lock()
        self.detach()

    def __call__(self, connection):
        self.near = connection
        self._pump(connection, self._to_board)

    def attach(self, path):
        self.far = socket.socket(socket.AF_UNIX)
        self.far.connect(str(path))
        threading.Thread(target=self._pump, args=(self.far, self._to_guest), daemon=True).start()

    def detach(self):
        self.to_board = self.from_board = lambda record: [record]
        if self.far:
            self.far.close()
        self.far = None

    def put(self, can_id, data):
        """A frame of another node onto the guest's bus."""
        with self.lock:
            self.near.sendall(frame(can_id, data))

    @staticmethod
    def _pump(source, take):
        waiting = b""
        try:
            while part := source.recv(65536):
                waiting += part
                whole = len(waiting) // FRAME.size * FRAME.size
                take([waiting[n : n + FRAME.size] for n in range(0, whole, FRAME.size)])
                waiting = waiting[whole:]
        except OSError:
            pass

    def _to_board(self, records):
        out = b"".join(one for record in records for one in self.to_board(record))
        far = self.far
        if far and out:
            far.sendall(out)

    def _to_guest(self, records):
        frames = [record for record in records if fields(record)[0] != NOW_ID]
        out = b"".join(one for record in frames for one in self.from_board(record))
        if out:
            with self.lock:
                self.near.sendall(out)
