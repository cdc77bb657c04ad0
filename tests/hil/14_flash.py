# SPDX-License-Identifier: MIT
# The board leaves to be flashed: dark, off the bus, and only when nothing is armed or plays.
import pytest

import check_trace
from ols_board import wire
from ols_board.board import BoardError
from ols_board.program import paper_program
from ols_board.usb import TIMED_OUT

GET_STRING_3 = bytes((0x80, 6, 3, 3, 9, 4, 255, 0))


def test_the_serial_number_on_the_bus_is_the_boards_id(emulated):
    link = emulated("--board-id", "00f1e2d3c4b5a697").plug()
    status, descriptor = link.usb.control(GET_STRING_3)
    assert (status, descriptor[0], descriptor[1]) == (0, 34, 3)
    assert descriptor[2:].decode("utf-16-le") == "00f1e2d3c4b5a697" == link.hello(0)["board_id"].hex()


@pytest.mark.parametrize("begin", ("armed", "playing"))
def test_a_board_that_is_armed_or_plays_does_not_leave_for_the_boot_loader(emulated, begin):
    link = emulated().plug()
    link.load(paper_program(cycles=0, slots=18))
    link.arm()
    if begin == "playing":
        link.ask(wire.START)
    with pytest.raises(BoardError, match="stop it") as refused:
        link.ask(wire.REBOOT_TO_BOOTLOADER)
    assert refused.value.code == wire.ERROR_BAD_STATE
    assert link.status()["state"] == (wire.PLAYING if begin == "playing" else wire.ARMED)


def test_a_board_leaves_for_the_boot_loader_dark_after_its_answer_and_comes_back_without_a_fault(emulated):
    board = emulated("--inject", "reset@250000000", trace=True)
    link = board.plug()
    link.play(paper_program(cycles=1, slots=18))
    link.wait_until([wire.DONE])
    assert link.ask(wire.REBOOT_TO_BOOTLOADER) == b""
    with pytest.raises(ConnectionError):
        link.status()
        link.status()
    # What is plugged in now is no longer this firmware: nothing enumerates until a reset.
    boot_loader = board.plug()
    assert boot_loader.usb.control(bytes((0x80, 6, 0, 1, 0, 0, 18, 0)), timeout_us=50_000)[0] == TIMED_OUT
    boot_loader.usb.close()
    link = board.plug()
    with pytest.raises(ConnectionError):
        while True:
            link.usb.control(bytes((0x80, 6, 0, 1, 0, 0, 18, 0)), timeout_us=500_000)
    status = board.plug().status()
    assert (status["state"], status["fault"]) == (wire.IDLE, 0)
    board.stop()
    assert "watchdog" in board.log and "in the USB boot loader" in board.log
    last = {name: level for _, name, level in check_trace.read_vcd(board.trace)}
    assert not any(last.values())
