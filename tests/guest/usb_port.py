# SPDX-License-Identifier: MIT
"""The host's end of the guest's USB port: USB/IP's messages (Linux, Documentation/usb/usbip_protocol.rst) to and from a device.
The emulated board is one, over its socket (docs/architecture.md, "USB transfers over a socket")."""
import errno
import socket
import struct
import sys
import threading

from ols_board.usb import CANCEL, BULK, CONTROL

SUBMIT, UNLINK, SUBMITTED, UNLINKED = 1, 2, 3, 4
HEADER_BYTES = 48
OUT, IN = 0, 1
STATUSES = {0: 0, -1: -errno.EPIPE, -2: -errno.ESHUTDOWN, -3: -errno.ETIMEDOUT, -5: -errno.EOVERFLOW, -6: -errno.EBUSY}
CANCELLED, DISCONNECTED = -4, -2


def read_exactly(connection, count):
    data = b""
    while len(data) < count:
        part = connection.recv(count - len(data))
        if not part:
            raise ConnectionError
        data += part
    return data


class BoardCable:
    """The emulated board as a device: transfers go out with their tags, answers come in any order."""

    def __init__(self, board):
        self.socket = socket.socket(socket.AF_UNIX)
        self.socket.connect(str(board.path / "board.sock"))

    def start(self, answer, gone):
        """`answer` gets (tag, status, data) of each transfer; `gone` is called when the board has left the bus."""
        def listen():
            try:
                while True:
                    _, tag, status, length = struct.unpack("<IIiI", read_exactly(self.socket, 16))
                    answer(tag, status, read_exactly(self.socket, length))
            except OSError:
                gone()
        threading.Thread(target=listen, daemon=True).start()

    def submit(self, tag, endpoint, direction, setup, data, capacity):
        kind = BULK if endpoint else CONTROL
        address = endpoint | (0x80 if direction == IN and endpoint else 0)
        self.socket.sendall(struct.pack("<IIBBHII8s", 0x54425355, tag, kind, address, 0, len(data) or capacity, 0,
                                        setup if kind == CONTROL else bytes(8)) + data)

    def cancel(self, tag):
        self.socket.sendall(struct.pack("<IIBBHII8s", 0x54425355, tag, CANCEL, 0, 0, 0, 0, bytes(8)))

    def close(self):
        """Pulls the cable."""
        try:
            self.socket.shutdown(socket.SHUT_RDWR)
        except OSError:
            pass


PATIENCE_S = 180
FULL_SPEED, SUPER_SPEED = 2, 5  # usb_device_speed of include/uapi/linux/usb/ch9.h


class Attachment:
    """A device in the port, from the plug to the unplugging: USB/IP's messages to it, and its answers."""

    def __init__(self, device):
        self.device = device
        self.lock = threading.Lock()
        self.pending, self.sizes = {}, {}
        self.connection, self.server = None, None
        self.begun, self.over = threading.Event(), threading.Event()

    def serve(self, connection):
        self.connection, self.server = connection, threading.current_thread()
        self.device.start(self._answer, self._hang_up)
        self.begun.set()
        try:
            while True:
                self._take(read_exactly(connection, HEADER_BYTES))
        except OSError:
            self.device.close()
        connection.close()
        self.over.set()

    def end(self):
        """Pulls the cable; returns once nothing of it is left, unless the device itself has it pulled."""
        assert self.begun.wait(PATIENCE_S)
        self.device.close()
        self._hang_up()
        assert threading.current_thread() is self.server or self.over.wait(PATIENCE_S)

    def _hang_up(self):
        try:
            self.connection.shutdown(socket.SHUT_RDWR)
        except OSError:
            pass

    def _take(self, header):
        command, number, _, direction, endpoint = struct.unpack_from(">5I", header)
        if command == UNLINK:
            (other,) = struct.unpack_from(">I", header, 20)
            with self.lock:
                is_pending = other in self.pending
                if is_pending:
                    self.pending[other] = number
            if is_pending:
                self.device.cancel(other)
            else:
                self._send(UNLINKED, number, 0)
            return
        _, length = struct.unpack_from(">Ii", header, 20)
        setup = header[40:48]
        data = read_exactly(self.connection, length) if direction == OUT and length else b""
        with self.lock:
            self.pending[number] = None
            self.sizes[number] = len(data)
        self.device.submit(number, endpoint, direction, setup, data, length)

    def _answer(self, tag, status, data):
        with self.lock:
            unlinked_by = self.pending.pop(tag, None)
            sent = self.sizes.pop(tag, 0)
        if unlinked_by is not None:
            # Cancelled, or too late for that: then the transfer's own end counts.
            if status == CANCELLED:
                self._send(UNLINKED, unlinked_by, -errno.ECONNRESET)
                return
            self._send(SUBMITTED, tag, STATUSES[status], data, sent)
            self._send(UNLINKED, unlinked_by, 0)
            return
        self._send(SUBMITTED, tag, STATUSES[status], data, sent)

    def _send(self, command, number, status, data=b"", sent=0):
        actual = len(data) or (sent if status == 0 else 0)
        message = struct.pack(">5Ii", command, number, 0, 0, 0, status)
        message += struct.pack(">iiii", actual, 0, 0, 0) if command == SUBMITTED else b""
        message = message.ljust(HEADER_BYTES, b"\0") + data
        try:
            with self.lock:
                self.connection.sendall(message)
        except OSError:
            pass  # unplugged meanwhile


class UsbPort:
    """One port of the guest's USB; `speed` is that of whatever is plugged in."""

    def __init__(self, guest, inside, number=0, speed=FULL_SPEED):
        self.guest = guest
        guest.load("vhci-hcd")
        channel = f"usb{speed}.{number}"
        guest.channel(channel, lambda connection: self.attached.serve(connection))
        self.process = guest.start([sys.executable, inside / "usb_port.py", channel, number, speed])
        self.attached = None
        self.plugged = 0

    @property
    def device(self):
        return self.attached.device

    def plug(self, device):
        """Plugs the device in; returns when the guest's hub has it."""
        self.attached = Attachment(device)
        self.plugged += 1
        while self.process.input is None:
            self.process.wait_for("")
        self.process.input.sendall(b"plug\n")
        with self.process.changed:
            self.process.changed.wait_for(lambda: self.process.output.count("plugged") == self.plugged, PATIENCE_S)
        assert self.process.output.count("plugged") == self.plugged, self.process.errors

    def wait_until_empty(self, process):
        """Until the device has left by itself, as `process` in the guest is to bring it to."""
        while not self.attached.over.wait(0.05):
            assert process.returncode is None, process.output + process.errors

    def unplug(self):
        if self.attached:
            self.attached.end()
