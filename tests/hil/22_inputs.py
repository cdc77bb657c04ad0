# SPDX-License-Identifier: MIT
# Inputs that change as fast as they like: the board answers, is not reset, and keeps most of its processor's time.
import pytest

from ols_board import wire
from ols_board.program import paper_program

MS = 125_000  # ticks
FROM_TICK = 250 * MS
HALF_PERIODS = {"100 kHz": 625, "2 MHz": 31}
STATUS_ROUNDS = 40


def statistics(board):
    """What the emulator counted, when it has ended."""
    told = board.stop()
    assert "reset at tick" not in board.log, "the board was reset"
    return told


def handler_share(board):
    """Entries of the inputs' handler (exception 29) a millisecond of board time since the input began to change."""
    told = statistics(board)
    count = told["handlers"].get("29", {"count": 0})["count"]
    return count / max(1, (told["ticks"] - FROM_TICK) / MS)


def pass_time(link, rounds=STATUS_ROUNDS):
    """Asks and waits, so that board time passes well beyond the begin of the changes; returns the last status."""
    for _ in range(rounds):
        status = link.status()
        link.usb.read(timeout_us=8_000)  # nothing comes
    return status


def prepare(link, state):
    """Brings the board into a state, with each start source where that matters."""
    if state == "idle":
        return wire.IDLE
    link.load(paper_program(cycles=0, slots=18))
    if state == "playing":
        link.arm()
        link.ask(wire.START)
        return wire.PLAYING
    link.arm(start=wire.BY_EDGE)
    return wire.ARMED


@pytest.mark.parametrize("half_period", HALF_PERIODS.values(), ids=HALF_PERIODS)
@pytest.mark.parametrize("state", ["idle", "armed", "playing"])
def test_a_genlock_of_any_frequency_costs_next_to_nothing_while_nobody_waits_for_it(emulated, state, half_period):
    board = emulated("--inject", f"genlockclock:{half_period}@{FROM_TICK}")
    link = board.plug()
    wanted = prepare(link, state)
    status = pass_time(link)
    assert (status["state"], status["fault"]) == (wanted, 0)
    # None at all: nothing is enabled.
    assert handler_share(board) < 0.1


@pytest.mark.parametrize("half_period", HALF_PERIODS.values(), ids=HALF_PERIODS)
def test_a_board_that_waits_answers_whatever_the_frequency_and_each_debounced_edge_is_counted(emulated, half_period):
    board = emulated("--inject", f"genlockclock:{half_period}@{FROM_TICK}")
    link = board.plug()
    link.load(paper_program(cycles=0, slots=18))
    # Too fast for the debounce: the board waits on.
    link.arm(start=wire.EACH_CYCLE_BY_EDGE, debounce_ticks=2000)
    link.ask(wire.START)
    status = pass_time(link)
    assert (status["state"], status["fault"], status["edges_seen"]) == (wire.WAITING, 0, 0)
    link.ask(wire.STOP)
    # Slow enough: each one is seen, by hardware, and begins a cycle or is missed.
    link.arm(start=wire.EACH_CYCLE_BY_EDGE, debounce_ticks=4)
    link.ask(wire.START)
    first, second = pass_time(link, 3), pass_time(link, 3)
    edges = second["edges_seen"] - first["edges_seen"]
    assert second["fault"] == 0 and edges > 1000
    assert second["edges_missed"] > 0
    statistics(board)


def test_the_first_edge_of_a_fast_genlock_starts_and_the_others_cost_nothing(emulated):
    board = emulated("--inject", f"genlockclock:31@{FROM_TICK}")
    link = board.plug()
    link.load(paper_program(cycles=0, slots=18))
    link.arm(start=wire.BY_EDGE)
    link.ask(wire.START)
    status = pass_time(link)
    assert (status["state"], status["fault"]) == (wire.PLAYING, 0)
    assert handler_share(board) < 0.1


@pytest.mark.parametrize("half_period", HALF_PERIODS.values(), ids=HALF_PERIODS)
@pytest.mark.parametrize("state", ["idle", "playing"])
def test_an_oscillating_lamp_line_stops_what_plays_and_takes_no_time_from_the_board(emulated, state, half_period):
    board = emulated("--inject", f"openlampclock:{half_period}@{FROM_TICK}")
    link = board.plug()
    prepare(link, state)
    status = pass_time(link)
    assert wire.FAULTS[status["fault"]] == ("open lamp" if state == "playing" else "none")
    assert handler_share(board) < 0.1


@pytest.mark.parametrize("half_period", HALF_PERIODS.values(), ids=HALF_PERIODS)
def test_an_oscillating_interrupt_line_of_the_can_controller_leaves_usb_its_turn(emulated, half_period):
    board = emulated("--inject", f"canclock:{half_period}@{FROM_TICK}", can=True)
    link = board.plug_usb()
    link.play(paper_program(cycles=0, slots=18))
    status = pass_time(link)
    assert (status["state"], status["fault"]) == (wire.PLAYING, 0)
    statistics(board)
