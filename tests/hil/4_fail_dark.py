# SPDX-License-Identifier: MIT
# Whatever goes wrong while a program plays: dark, triggers idle, a latched fault that names its cause.
import threading

import pytest

import check_trace
from ols_board import wire
from ols_board.board import BoardError
from ols_board.program import PERIOD_TICKS, paper_program

MS = 125_000  # ticks


def broken_play(emulated, fault):
    """Plays an endless program until `fault` at trigger 50; returns the board and the tick of trigger 50."""
    board = emulated("--inject", f"{fault}@trigger:50", trace=True)
    link = board.plug()
    try:
        link.play(paper_program(cycles=0))
        status = link.wait_until([wire.FAULT])
    except ConnectionError:
        link = board.plug()
        status = link.status()
    return board, link, status


def last_edges(board):
    """After the board has ended: the tick of trigger 50, the last edge of the lights and triggers, the last levels."""
    board.stop()
    changes = check_trace.read_vcd(board.trace)
    rises = [tick for tick, name, level in changes if name == "TRIG0" and level]
    last = {}
    for tick, name, level in changes:
        last[name] = (tick, level)
    assert not any(level for _, level in last.values()), "the board is not dark"
    lit = max(last[name][0] for name in ("LIGHT_EN", *check_trace.TRIGGERS, "SYNC", "LATCH"))
    return rises[49], lit, len(rises)


@pytest.mark.parametrize(
    "fault, cause, within_ticks",
    [
        ("unplug", "host lost", 6 * MS),  # the bus must be idle for 3 ms, and the loop wakes every millisecond
        ("starve", "shifter starved", 4 * PERIOD_TICKS),  # what is in the FIFOs still plays: at most 8 events
        ("hang", "watchdog", 21 * MS),  # the watchdog's 20 ms; PIO plays on until then
        ("hardfault", "processor", 1 * MS),
    ],
)
def test_a_fault_in_play_ends_dark_with_its_cause(emulated, fault, cause, within_ticks):
    board, link, status = broken_play(emulated, fault)
    assert (status["state"], wire.FAULTS[status["fault"]]) == (wire.FAULT, cause)
    # Nothing plays before the fault is cleared, not even after loading.
    with pytest.raises(BoardError) as refused:
        link.load(paper_program(cycles=1, slots=18))
    assert refused.value.code == wire.ERROR_FAULT_LATCHED
    link.ask(wire.CLEAR_FAULT)
    assert link.status()["state"] == wire.IDLE
    at, lit, _ = last_edges(board)
    assert lit - at <= within_ticks


def test_a_reset_in_play_is_dark_at_once_and_tells_the_virtual_stage(emulated):
    board = emulated("--inject", "reset@trigger:50", trace=True, exposures=True)
    received = []
    reader = threading.Thread(target=lambda: received.extend(board.exposures_until("reset", 1)))
    reader.start()
    link = board.plug()
    with pytest.raises(ConnectionError):
        link.play(paper_program(cycles=0))
        link.wait_until([wire.FAULT])
    assert board.plug().status()["state"] == wire.IDLE
    reader.join(timeout=30)
    assert received[-1] == {"type": "reset", "cause": "run pin"}
    at, lit, rises = last_edges(board)
    assert rises == 50 and lit - at <= 2


def test_faults_leave_no_trigger_shorter_or_later_than_the_program_says_before_them(emulated):
    board, _, _ = broken_play(emulated, "starve")
    last_edges(board)
    triggers = check_trace.pulses(check_trace.read_vcd(board.trace), "TRIG0")
    periods = {b[0] - a[0] for a, b in zip(triggers, triggers[1:])}
    assert periods == {PERIOD_TICKS}
    program = paper_program(cycles=1)
    widths = [fall - rise for rise, fall in triggers[:-1]]
    assert widths == [slot["exposure_ticks"] for slot in program["slots"][: len(widths)]]
