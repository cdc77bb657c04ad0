# SPDX-License-Identifier: MIT
# A real board on USB, by PyUSB, with the face of the emulated one: BOARD=usb:SERIAL, or BOARD=usb: for the only one.
import errno

import pytest
import usb.core
import usb.util

from ols_board import wire
from ols_board.board import BoardError, Link
from ols_board.usb import BULK_IN, BULK_OUT, DISCONNECTED, OK, STALL, TIMED_OUT

VENDOR, PRODUCT, NAME = 0x1209, 0x0001, "light stage sequencer"


def find(serial, backend=None):
    """The board of that serial number, any if it is empty. Fails with what is plugged in."""
    boards = [device for device in usb.core.find(True, backend=backend, idVendor=VENDOR, idProduct=PRODUCT)
              if usb.util.get_string(device, device.iProduct) == NAME]
    serials = {usb.util.get_string(device, device.iSerialNumber): device for device in boards}
    if serial in serials:
        return serials[serial]
    if not serial and len(boards) == 1:
        return boards[0]
    raise pytest.UsageError(f"BOARD=usb:{serial}: plugged in are {', '.join(f'usb:{s}' for s in serials) or 'no boards'}")


class PyUsb:
    """The transfers of ols_board.usb.Usb that a test can do one after the other, on a real cable."""

    def __init__(self, device):
        self.device = device
        device.set_configuration()  # a new session: what an earlier test left half said is forgotten

    def close(self):
        usb.util.dispose_resources(self.device)

    def _try(self, transfer):
        """A transfer's status as the emulated board gives it, and its result."""
        try:
            return OK, transfer()
        except usb.core.USBTimeoutError:
            return TIMED_OUT, b""
        except usb.core.USBError as error:
            return (STALL if error.errno == errno.EPIPE else DISCONNECTED), b""

    def control(self, setup, payload=b"", timeout_us=1_000_000):
        request_type, request = setup[:2]
        value, index, length = (setup[n] | setup[n + 1] << 8 for n in (2, 4, 6))
        what = length if request_type & 0x80 else payload
        status, data = self._try(
            lambda: self.device.ctrl_transfer(request_type, request, value, index, what, timeout_us // 1000))
        return status, bytes(data) if request_type & 0x80 else b""

    def write(self, payload, timeout_us=1_000_000):
        return self._try(lambda: self.device.write(BULK_OUT, payload, timeout_us // 1000))[0]

    def read(self, capacity=4096, timeout_us=1_000_000):
        status, data = self._try(lambda: self.device.read(BULK_IN, capacity, timeout_us // 1000))
        return status, bytes(data)

    def submit(self, *_, **__):
        pytest.skip("transfers under way at the same time are asked for only of the emulated board")


class UsbBoard:
    def __init__(self, serial, backend=None):
        self.serial, self.backend = serial, backend
        self.log = ""

    def plug(self):
        """A link to the board, which is idle: what an earlier test left is stopped, cleared and unloaded."""
        device = find(self.serial, self.backend)
        link = Link(PyUsb(device))
        state = link.status()["state"]
        if state == wire.FAULT:
            link.ask(wire.CLEAR_FAULT)
        elif state != wire.IDLE:
            link.ask(wire.STOP)
        if link.status()["state"] != wire.IDLE:
            # A program that is announced and never comes is refused at its end, and the one before it is gone.
            link.ask(wire.LOAD_BEGIN, wire.load_begin({"slots": [], "chain_bits": 0, "cycles": 0}, b"x"))
            with pytest.raises(BoardError):
                link.ask(wire.LOAD_END)
        return link

    def stop(self):
        pytest.skip("a real board has no trace to look at")

    def __exit__(self, *_):
        pass
