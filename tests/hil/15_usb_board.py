# SPDX-License-Identifier: MIT
# The way to a real board (BOARD=usb:SERIAL), tried on the emulated one: PyUSB with a backend that is its cable.
import errno
import struct
import types

import pytest
import usb.backend
import usb.core

import play
from ols_board import wire
from ols_board.board import EmulatedBoard
from ols_board.program import paper_program
from ols_board.usb import BULK, BULK_OUT, OK, STALL, TIMED_OUT, Usb
from ols_board.usb_board import UsbBoard

SERIAL = "00f1e2d3c4b5a697"


def named(layout, fields, data):
    """A descriptor's bytes as PyUSB wants them: an object with the names of USB 2.0 9.6."""
    values = dict(zip(fields.split(), struct.unpack_from(layout, data)))
    return types.SimpleNamespace(**values, bus=1, address=2, port_number=1, port_numbers=(1,), speed=2,
                                 extra_descriptors=[], bRefresh=0, bSynchAddress=0)


DEVICE = "<BBHBBBBHHHBBBB", ("bLength bDescriptorType bcdUSB bDeviceClass bDeviceSubClass bDeviceProtocol bMaxPacketSize0 idVendor idProduct "
          "bcdDevice iManufacturer iProduct iSerialNumber bNumConfigurations")
CONFIGURATION = "<BBHBBBBB", "bLength bDescriptorType wTotalLength bNumInterfaces bConfigurationValue iConfiguration bmAttributes bMaxPower"
INTERFACE = "<9B", ("bLength bDescriptorType bInterfaceNumber bAlternateSetting bNumEndpoints bInterfaceClass bInterfaceSubClass "
             "bInterfaceProtocol iInterface")
ENDPOINT = "<BBBBHB", "bLength bDescriptorType bEndpointAddress bmAttributes wMaxPacketSize bInterval"


class Cable(usb.backend.IBackend):
    """The emulated board's cable as a machine's USB with one device on it."""

    def __init__(self, path):
        self.usb = Usb(path)

    def _checked(self, status, data):
        if status == TIMED_OUT:
            raise usb.core.USBTimeoutError("timed out", errno=errno.ETIMEDOUT)
        if status != OK:
            raise usb.core.USBError("failed", errno=errno.EPIPE if status == STALL else errno.ENODEV)
        return data

    def _descriptor(self, kind, length):
        return self._checked(*self.usb.control(bytes((0x80, 6, 0, kind, 0, 0, length, 0))))

    def enumerate_devices(self):
        return iter([self])

    def get_device_descriptor(self, device):
        return named(*DEVICE, self._descriptor(1, 18))

    def get_configuration_descriptor(self, device, config):
        return named(*CONFIGURATION, self._descriptor(2, 32))

    def get_interface_descriptor(self, device, interface, alternate, config):
        if interface or alternate:
            raise IndexError
        return named(*INTERFACE, self._descriptor(2, 32)[9:])

    def get_endpoint_descriptor(self, device, endpoint, interface, alternate, config):
        return named(*ENDPOINT, self._descriptor(2, 32)[18 + 7 * endpoint :])

    def open_device(self, device):
        return self

    def close_device(self, handle):
        pass

    def set_configuration(self, handle, value):
        self._checked(*self.usb.control(bytes((0, 9, value, 0, 0, 0, 0, 0))))

    def get_configuration(self, handle):
        return self._checked(*self.usb.control(bytes((0x80, 8, 0, 0, 0, 0, 1, 0))))[0]

    def claim_interface(self, handle, interface):
        pass

    release_interface = claim_interface

    def bulk_write(self, handle, endpoint, interface, data, timeout):
        self._checked(self.usb.reply(self.usb.submit(BULK, BULK_OUT, bytes(data), timeout_us=timeout * 1000))[0], b"")
        return len(data)

    def bulk_read(self, handle, endpoint, interface, buffer, timeout):
        data = self._checked(*self.usb.read(len(buffer), timeout * 1000))
        buffer[: len(data)] = type(buffer)("B", data)
        return len(data)

    def ctrl_transfer(self, handle, request_type, request, value, index, data, timeout):
        setup = bytes((request_type, request, value & 255, value >> 8, index & 255, index >> 8, len(data) & 255,
                       len(data) >> 8))
        out = b"" if request_type & 0x80 else bytes(data)
        reply = self._checked(*self.usb.control(setup, out, timeout * 1000))
        if request_type & 0x80:
            data[: len(reply)] = type(data)("B", reply)
            return len(reply)
        return len(out)


@pytest.fixture
def cable():
    with EmulatedBoard("--board-id", SERIAL) as board:
        board.plug().usb.close()  # it is up
        backend = Cable(board.path / "board.sock")
        yield backend
        backend.usb.close()


def test_the_board_is_found_by_its_serial_number_and_plays(cable):
    link = UsbBoard(SERIAL, cable).plug()
    assert link.hello(0)["board_id"].hex() == SERIAL
    link.play(paper_program(cycles=1, slots=18))
    assert link.wait_until([wire.DONE])["triggers_fired"] == 18
    assert len(link.trigger_log()[0]) == 18


def test_what_an_earlier_test_left_is_gone_when_the_board_is_plugged_in_again(cable):
    link = UsbBoard("", cable).plug()
    link.play(paper_program(cycles=0, slots=18))
    assert link.usb.write(wire.frame(wire.STATUS, 9)[:5]) == OK  # half a frame
    link = UsbBoard("", cable).plug()
    assert link.status()["state"] == wire.IDLE


def test_control_transfers_and_time_outs_have_the_emulated_boards_statuses(cable):
    link = UsbBoard("", cable).plug()
    assert link.usb.control(bytes((0x80, 6, 0, 1, 0, 0, 18, 0)))[1][8:12] == bytes((9, 0x12, 1, 0))
    assert link.usb.control(bytes((0xC0, 0x77, 0, 0, 0, 0, 4, 0)))[0] == STALL
    assert link.usb.read(timeout_us=20_000)[0] == TIMED_OUT


def test_playing_by_hand_measures_one_single_period(cable, capsys):
    link = UsbBoard("", cable).plug()
    play.report(link, *play.play(link, paper_program(cycles=2, slots=36), wire.BY_COMMAND))
    assert capsys.readouterr().out.splitlines() == [
        "72 triggers measured, 0 lost; fault: none", "71 periods of 57870 ticks = 462.960 us (measured every second tick)"]


def test_another_serial_number_is_answered_with_the_one_that_is_there(cable):
    with pytest.raises(pytest.UsageError, match=f"plugged in are usb:{SERIAL}"):
        UsbBoard("ffff", cable).plug()
