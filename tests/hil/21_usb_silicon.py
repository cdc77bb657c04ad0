# SPDX-License-Identifier: MIT
# USB as the silicon has it: suspension at each plug-in, bus errors and lock-ups (erratum RP2040-E15), a B1 chip behind a busy
# hub (E5), data toggles that restart, control transfers given up. The emulated controller notes what a chip would not forgive.
import random

import check_trace
import pytest

from ols_board import board as board_of
from ols_board import wire
from ols_board.board import BoardError
from ols_board.program import PERIOD_TICKS, paper_program
from ols_board.stops import injected
from ols_board.usb import BULK, BULK_IN, CONTROL, DISCONNECTED, OK, STALL, TIMED_OUT

MS = 125_000  # ticks
LOCKED_UP_MS = 250  # firmware/usb_watch.c
BEHIND_A_BUSY_HUB = ("--chip-revision", "b1", "--busy-hub")
GET_DEVICE_DESCRIPTOR = bytes((0x80, 6, 0, 1, 0, 0, 18, 0))
GET_CONFIGURATION = bytes((0x80, 8, 0, 0, 0, 0, 1, 0))
GET_INTERFACE = bytes((0x81, 10, 0, 0, 0, 0, 1, 0))
CLEAR_HALT_IN = bytes((0x02, 1, 0, 0, BULK_IN, 0, 0, 0))


def set_interface(setting):
    return bytes((0x01, 11, setting, 0, 0, 0, 0, 0))


def set_configuration(value):
    return bytes((0x00, 9, value, 0, 0, 0, 0, 0))


def plays_on(link, milliseconds):
    """Plays for so long and stops; the board must not have found a fault."""
    link.play(paper_program(cycles=0, slots=18))
    link.usb.read(timeout_us=1000 * milliseconds)  # nothing comes: board time passes
    status = link.status()
    assert status["state"] == wire.PLAYING, wire.FAULTS[status["fault"]]
    assert status["triggers_fired"] >= milliseconds * MS // PERIOD_TICKS
    link.ask(wire.STOP)


def ask_until_answered(link, tries=20_000):
    """The first status that comes; a locked-up controller answers no transaction, and a detached one waits."""
    for _ in range(tries):
        try:
            link.stream.clear()
            return link.status()
        except ConnectionError:
            pass
    raise TimeoutError("the board answers nothing any more")


def test_a_board_that_suspended_before_its_host_came_plays_on(emulated):
    plays_on(emulated().plug(), 250)


def test_a_board_that_was_suspended_and_resumed_while_idle_plays_on(emulated):
    board = emulated("--inject", f"sleep@{300 * MS}", "--inject", f"resume@{330 * MS}")
    link = board.plug()
    link.status()
    link.usb.read(timeout_us=300_000)
    plays_on(link, 100)


def test_a_suspension_ends_play(emulated):
    board = emulated("--inject", "sleep@trigger:101", "--inject", f"resume@{900 * MS}")
    link = board.plug()
    link.play(paper_program(cycles=0, slots=18))
    link.usb.read(timeout_us=900_000)
    status = link.status()
    assert wire.FAULTS[status["fault"]] == "host lost"


def test_bus_errors_at_random_moments_lose_nothing_and_lock_nothing_up(emulated):
    pick = random.Random(21)
    moments = sorted(pick.sample(range(200 * MS, 700 * MS), 60))
    board = emulated(*(part for tick in moments for part in ("--inject", f"buserror@{tick}")))
    link = board.plug()
    link.load(paper_program(cycles=40, slots=18))
    link.arm()
    link.ask(wire.START)
    while link.status()["state"] == wire.PLAYING:
        pass
    entries, lost = link.trigger_log()
    assert lost == 0 and [entry[1] for entry in entries] == list(range(720))
    board.stop()
    assert board.log.count(": buserror") >= 30, "they fell into the play"


def test_a_lock_up_in_play_is_dark_as_host_lost_in_its_time_and_the_board_comes_back(emulated):
    board = emulated("--inject", "fatalbuserror@trigger:101", trace=True)
    link = board.plug()
    link.play(paper_program(cycles=0, slots=18))
    with pytest.raises(ConnectionError):
        while True:
            link.status()
    status = ask_until_answered(link)
    assert (status["state"], wire.FAULTS[status["fault"]]) == (wire.FAULT, "host lost")
    link.ask(wire.CLEAR_FAULT)
    plays_on(link, 50)
    board.stop()
    rises = [tick for tick, name, level in check_trace.read_vcd(board.trace) if name == "TRIG0" and level]
    (at, _), = injected(board, {"fatalbuserror"})
    silent_ms = (status["fault_ticks"] - (at - rises[0])) / MS
    assert LOCKED_UP_MS <= silent_ms < LOCKED_UP_MS + 10


def test_a_lock_up_without_a_bus_error_ends_when_the_host_has_reset_the_bus_in_vain(emulated):
    board = emulated("--pace", "wall", "--inject", f"usblockup@{300 * MS}", "--inject", f"busreset@{305 * MS}")
    link = board.plug()
    assert link.status()["state"] == wire.IDLE
    link.usb.read(timeout_us=1_000_000)  # until it has gone
    assert ask_until_answered(link)["state"] == wire.IDLE


@pytest.mark.parametrize("name", ["pico", "feather_can"])
def test_a_b1_chip_behind_a_busy_hub_is_found_and_plays(emulated, name):
    board = emulated(*BEHIND_A_BUSY_HUB, image=board_of.IMAGE.parent / name / "stage.elf")
    plays_on(board.plug_usb(), 50)


def test_a_b2_chip_behind_a_busy_hub_needs_nothing(emulated):
    plays_on(emulated("--busy-hub").plug(), 50)


def test_gpio_15_is_not_borrowed_from_a_board_that_waits_for_its_edge_and_usb_comes_later(emulated):
    board = emulated(*BEHIND_A_BUSY_HUB, can=True)
    over_can = board.plug_can()
    over_can.load(paper_program(cycles=0, slots=18))
    over_can.arm(start=wire.EACH_CYCLE_BY_EDGE, debounce_ticks=4)
    over_can.ask(wire.START)
    over_usb = board.plug_usb()
    wait = over_usb.usb.submit(CONTROL, 0, capacity=18, setup=GET_DEVICE_DESCRIPTOR)
    for _ in range(40):
        status = over_can.status()
        assert status["state"] == wire.WAITING and status["edges_seen"] == 0, "GENLOCK was forced high"
    over_can.ask(wire.STOP)
    over_can.usb.bus.close()
    ask_until_answered(over_usb)
    over_usb.arm(start=wire.BY_EDGE)
    over_usb.ask(wire.START)
    over_usb.usb.read(timeout_us=20_000)
    assert over_usb.status()["state"] == wire.WAITING
    assert over_usb.usb.reply(wait)[0] in (OK, DISCONNECTED)


def test_can_goes_on_while_gpio_15_is_borrowed_from_its_spi(emulated):
    board = emulated(*BEHIND_A_BUSY_HUB, can=True, image=board_of.IMAGE.parent / "feather_can" / "stage.elf")
    over_can, over_usb = board.plug_can(), board.plug_usb()
    found = over_usb.usb.submit(CONTROL, 0, capacity=18, setup=GET_DEVICE_DESCRIPTOR)
    for _ in range(60):
        assert over_can.status()["state"] == wire.IDLE
    assert over_usb.usb.reply(found)[0] == OK
    assert over_can.status()["state"] == over_usb.status()["state"] == wire.IDLE


def test_a_setting_of_the_interface_restarts_the_data_toggles(emulated):
    link = emulated().plug()
    for times in (1, 2, 3):
        for _ in range(times):
            link.status()
        assert link.usb.control(set_interface(0))[0] == OK
    assert link.status()["state"] == wire.IDLE
    assert link.usb.control(GET_INTERFACE) == (OK, b"\0")
    assert link.usb.control(set_interface(1))[0] == STALL
    assert link.status()["state"] == wire.IDLE


def test_a_reply_that_waits_to_be_fetched_survives_the_restart_of_its_toggle(emulated):
    link = emulated().plug()
    link.status()
    link.usb.write(wire.frame(wire.STATUS, 77))
    for _ in range(20):  # board time passes: the reply is ready
        assert link.usb.control(GET_DEVICE_DESCRIPTOR)[0] == OK
    assert link.usb.control(CLEAR_HALT_IN)[0] == OK
    link.stream.clear()
    status, data = link.usb.read()
    assert status == OK and wire.take_frame(bytearray(data))[1] == 77
    assert link.status()["state"] == wire.IDLE


def test_a_control_transfer_that_is_given_up_leaves_nothing_for_the_next(emulated):
    usb = emulated().plug().usb
    assert usb.control(GET_DEVICE_DESCRIPTOR)[0] == OK
    given_up = 0
    for timeout_us in range(20, 120, 4):
        given_up += usb.control(GET_DEVICE_DESCRIPTOR, timeout_us=timeout_us)[0] == TIMED_OUT
        assert usb.read(timeout_us=500)[0] == TIMED_OUT  # board time passes
        assert usb.control(GET_CONFIGURATION) == (OK, b"\1")
    assert given_up > 5


def test_configurations_that_there_are_not_are_refused_and_none_is_one(emulated):
    link = emulated().plug()
    assert link.usb.control(set_configuration(2))[0] == STALL
    assert link.status()["state"] == wire.IDLE
    assert link.usb.control(set_configuration(0))[0] == OK
    assert link.usb.reply(link.usb.submit(BULK, BULK_IN, capacity=64, timeout_us=10_000))[0] != OK
    assert link.usb.control(set_configuration(1))[0] == OK
    assert link.status()["state"] == wire.IDLE
