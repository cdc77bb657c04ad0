# SPDX-License-Identifier: MIT
# The cable: transfers of every size, refusals, time-outs, and plugging.
import struct

import pytest

from ols_board import wire
from ols_board.program import paper_program
from ols_board.usb import BULK, BULK_IN, BULK_OUT, CANCEL, CANCELLED, OK, STALL, TIMED_OUT

GET_DEVICE_DESCRIPTOR = bytes((0x80, 6, 0, 1, 0, 0, 18, 0))
VENDOR_UNKNOWN = bytes((0xC0, 0x77, 0, 0, 0, 0, 4, 0))


def test_control_transfers_read_descriptors_and_unknown_requests_stall(emulated):
    usb = emulated().plug().usb
    status, descriptor = usb.control(GET_DEVICE_DESCRIPTOR)
    assert status == OK and len(descriptor) == 18 and descriptor[1] == 1
    assert usb.control(VENDOR_UNKNOWN)[0] == STALL
    assert usb.control(GET_DEVICE_DESCRIPTOR) == (OK, descriptor)  # a stall of endpoint 0 ends with the next setup
    short = GET_DEVICE_DESCRIPTOR[:6] + bytes((8, 0))
    assert usb.control(short) == (OK, descriptor[:8])


@pytest.mark.parametrize("size", (1, 63, 64, 65, 127, 128, 640, 1009))
def test_out_transfers_of_any_size_arrive_whole(emulated, size):
    link = emulated().plug()
    # Frames of a message that is refused, but whose length shows that every byte has come; then a good one.
    payload = bytes(n & 0xFF for n in range(size))
    link.usb.write(wire.frame(0x55, 1, payload))
    link.request_id = 1
    assert link.status()["state"] == wire.IDLE
    status = link.usb.write(b"")  # a packet of no bytes is a transfer too
    assert status == OK and link.status()["state"] == wire.IDLE


def test_one_transfer_may_hold_many_frames_and_a_frame_many_transfers(emulated):
    link = emulated().plug()
    link.usb.write(b"".join(wire.frame(wire.STATUS, n) for n in range(1, 6)))
    stream, found = bytearray(), []
    while len(found) < 5:
        stream += link.usb.read()[1]
        while (frame := wire.take_frame(stream)) is not None:
            found.append(frame[1])
    assert found == [1, 2, 3, 4, 5]
    whole = wire.frame(wire.STATUS, 9)
    for n in range(len(whole)):
        link.usb.write(whole[n : n + 1])
    stream += link.usb.read()[1]
    assert wire.take_frame(stream)[1] == 9


def test_a_read_with_nothing_to_read_times_out_in_board_time_and_can_be_cancelled(emulated):
    usb = emulated().plug().usb
    assert usb.read(timeout_us=20_000)[0] == TIMED_OUT
    tag = usb.submit(BULK, BULK_IN, capacity=64)
    usb.submit(CANCEL, 0, tag=tag)
    assert usb.reply(tag)[0] == CANCELLED
    usb.write(wire.frame(wire.STATUS, 3))
    assert usb.read()[0] == OK


def test_an_endpoint_that_is_not_there_stalls(emulated):
    usb = emulated().plug().usb
    assert usb.control(GET_DEVICE_DESCRIPTOR)[0] == OK
    assert usb.reply(usb.submit(BULK, 0x05, b"x", timeout_us=100_000))[0] == STALL


def test_replies_come_by_tag_while_a_read_waits(emulated):
    usb = emulated().plug().usb
    waiting = usb.submit(BULK, BULK_IN, capacity=4096)
    assert usb.control(GET_DEVICE_DESCRIPTOR)[0] == OK
    written = usb.submit(BULK, BULK_OUT, wire.frame(wire.STATUS, 1))
    status, data = usb.reply(waiting)
    assert status == OK and struct.unpack_from("<H", data)[0] == wire.SYNC
    assert usb.reply(written)[0] == OK


def test_unplugging_and_plugging_gives_a_fresh_link_with_the_program_still_loaded(emulated):
    board = emulated()
    link = board.plug()
    link.load(paper_program(cycles=1, slots=18))
    link.usb.write(wire.frame(wire.STATUS, 1)[:5])  # half a frame, whose rest never comes
    link.usb.close()
    link = board.plug()
    assert link.status()["state"] == wire.LOADED


def test_a_second_client_is_turned_away_and_the_first_goes_on(emulated):
    board = emulated()
    first = board.plug()
    first.status()
    with pytest.raises((ConnectionError, BrokenPipeError)):
        board.plug().status()
    assert first.status()["state"] == wire.IDLE


def test_garbage_on_the_socket_cuts_off_that_client_only(emulated):
    board = emulated()
    link = board.plug()
    link.usb.socket.sendall(b"GET / HTTP/1.1\r\n\r\n" + bytes(64))
    with pytest.raises(ConnectionError):
        link.usb.reply(1)
    assert board.plug().status()["state"] == wire.IDLE
