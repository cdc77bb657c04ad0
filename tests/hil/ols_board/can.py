# SPDX-License-Identifier: MIT
# A host on the CAN bus, whose ISO-TP is PyPI's can-isotp: independent of protocol/isotp.c.
import select
import socket
import struct
import time

import isotp

from ols_board.usb import DISCONNECTED, OK, TIMED_OUT

NOW_ID = 0xFFFFFFFF
ERROR_FLAG = 0x20000000
TICKS_PER_US = 125
STATE, CYCLE, FIRST_RISE, LAST_RISE, CYCLE_CRC, HEALTH = range(0x100, 0x106)
TO_BOARD, TO_HOST = 0x600, 0x608


class EmulatedBus:
    """A node of the emulated bus (docs/architecture.md, "CAN frames over a socket"). `tick` is the board's time."""

    def __init__(self, path):
        self.socket = socket.socket(socket.AF_UNIX)
        self.socket.settimeout(60)
        self.socket.connect(str(path))
        self.input = bytearray()
        self.tick = 0
        self.heard = []  # (tick, id, data) of everything

    def close(self):
        self.socket.close()

    def send(self, frame_id, data):
        self.socket.sendall(struct.pack("<IB3x8s", frame_id, len(data), bytes(data)))

    def send_all(self, frame_id, datas):
        """Hands all to the node's queue at once."""
        self.socket.sendall(b"".join(struct.pack("<IB3x8s", frame_id, len(data), data) for data in datas))

    def break_next_frame(self):
        """Raises an error flag while the next frame is on the bus."""
        self.send(ERROR_FLAG, b"")

    def receive(self, wait=True):
        """The next frame (id, data), or None when only time has passed; without `wait`, or nothing has come."""
        while len(self.input) < 16:
            if not wait and not select.select([self.socket], [], [], 0)[0]:
                return None
            part = self.socket.recv(65536)
            if not part:
                raise ConnectionError("the bus has gone")
            self.input += part
        frame_id, length = struct.unpack_from("<IB", self.input)
        data = bytes(self.input[8 : 8 + length])
        del self.input[:16]
        if frame_id == NOW_ID:
            (self.tick,) = struct.unpack("<Q", data)
            return None
        self.heard.append((self.tick, frame_id, data))
        return frame_id, data


class SocketCanBus:
    """An interface of this machine; its tick is made from the monotonic clock."""

    def __init__(self, interface):
        self.socket = socket.socket(socket.PF_CAN, socket.SOCK_RAW, socket.CAN_RAW)
        self.socket.bind((interface,))
        self.heard = []

    @property
    def tick(self):
        return time.monotonic_ns() // 8

    def close(self):
        self.socket.close()

    def send(self, frame_id, data):
        self.socket.send(struct.pack("<IB3x8s", frame_id, len(data), bytes(data)))

    def send_all(self, frame_id, datas):
        for data in datas:
            self.send(frame_id, data)

    def receive(self, wait=True):
        if not select.select([self.socket], [], [], 0.01 if wait else 0)[0]:
            return None
        frame_id, length, data = struct.unpack("<IB3x8s", self.socket.recv(16))
        self.heard.append((self.tick, frame_id, data[:length]))
        return frame_id, data[:length]


class Can:
    """A cable for Link: messages to and from one board, with time-outs in its time."""

    def __init__(self, bus, number=0):
        self.bus = bus
        self.errors = []
        address = isotp.Address(isotp.AddressingMode.Normal_11bits, txid=TO_BOARD + 16 * number,
                                rxid=TO_HOST + 16 * number)
        # can-isotp's own time-outs are the wall's: long ones, for the board's time decides here.
        params = {"stmin": 0, "blocksize": 0, "rx_flowcontrol_timeout": 60_000, "rx_consecutive_frame_timeout": 60_000,
                  "tx_padding": None, "max_frame_size": 4095}
        self.layer = isotp.TransportLayerLogic(self._take, self._put, address, self.errors.append, params)
        self.waiting = []

    def close(self):
        self.bus.close()

    def _take(self, _timeout):
        return self.waiting.pop(0) if self.waiting else None

    def _put(self, frame):
        self.bus.send(frame.arbitration_id, frame.data)

    def _step(self):
        """Until something has come or time has passed."""
        got = self.bus.receive()
        while got is not None:
            self.waiting.append(isotp.CanMessage(arbitration_id=got[0], dlc=len(got[1]), data=got[1]))
            got = self.bus.receive(wait=False)
        self.layer.process()

    def _until(self, done, timeout_us):
        self.layer.process()
        if done():
            return OK
        self.bus.receive(wait=False)
        begin = None
        try:
            while not done():
                self._step()
                begin = self.bus.tick if begin is None else begin
                if timeout_us and self.bus.tick - begin > timeout_us * TICKS_PER_US:
                    return TIMED_OUT
        except (ConnectionError, OSError):
            return DISCONNECTED
        return OK

    def write(self, payload, timeout_us=1_000_000):
        self.layer.send(bytes(payload))
        status = self._until(lambda: not self.layer.transmitting(), timeout_us)
        if status != OK:
            self.layer.stop_sending()
        return status

    def read(self, capacity=4096, timeout_us=1_000_000):
        status = self._until(self.layer.available, timeout_us)
        return (status, bytes(self.layer.recv()) if status == OK else b"")
