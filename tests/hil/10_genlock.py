# SPDX-License-Identifier: MIT
# A start by an edge on GENLOCK: to the tick, by a rise and not by a level, and by no edge before the start command.
import random
import re

import check_trace
from ols_board import claims, wire
from ols_board.program import paper_program

MS = 125_000  # ticks
LATCH_TICKS = 12


def wait_for(link, state, polls=500):
    for _ in range(polls):
        if link.status()["state"] == state:
            return
        link.usb.read(timeout_us=1_000)  # nothing comes: board time passes
    raise TimeoutError(f"state {state} did not come")


def edges(board, name):
    return [int(tick) for tick in re.findall(rf"injected at tick (\d+): {name}\n", board.log)]


def test_play_begins_the_stated_ticks_after_the_edge_every_time_and_the_log_counts_from_it(emulated):
    pick = random.Random(7)
    starts = 12
    arguments = []
    for n in range(starts):
        rise = (300 + 150 * n) * MS + pick.randrange(50 * MS)
        arguments += ["--inject", f"genlock@{rise}", "--inject", f"genlockfall@{rise + 20 * MS}"]
    board = emulated(*arguments, trace=True)
    link = board.plug()
    latency = link.hello(0)["edge_start_ticks"]
    program = paper_program(cycles=1, slots=18)
    first_rises = []
    for _ in range(starts):
        link.load(program)
        link.arm(start=wire.BY_EDGE)
        link.ask(wire.START)
        assert link.status()["state"] == wire.WAITING
        wait_for(link, wire.DONE)
        entries, _ = link.trigger_log()
        assert [entry[3] for entry in entries] == list(range(18))
        first_rises.append(entries[0][0])
    board.stop()
    changes = check_trace.read_vcd(board.trace)
    latches = [tick for tick, name, level in changes if name == "LATCH" and level]
    begins = latches[::18]
    rises = edges(board, "genlock")
    assert len(begins) == len(rises) == starts
    assert {begin - rise for begin, rise in zip(begins, rises)} == {latency}
    claims.measured(f"genlock: the first event {latency} ticks after the pad's rise, {starts} times")
    # The trigger rises a latch after the begin; the witness's own delay is a few ticks more, and the same each time.
    assert max(first_rises) - min(first_rises) <= 2
    assert abs(first_rises[0] - (latency + LATCH_TICKS)) <= 4


def test_a_level_that_is_high_already_does_not_start(emulated):
    board = emulated("--inject", f"genlock@{1 * MS}", "--inject", f"genlockfall@{600 * MS}",
                     "--inject", f"genlock@{700 * MS}", trace=True)
    link = board.plug()
    link.load(paper_program(cycles=1, slots=18))
    link.arm(start=wire.BY_EDGE)
    link.ask(wire.START)
    wait_for(link, wire.DONE)
    board.stop()
    latches = [tick for tick, name, level in check_trace.read_vcd(board.trace) if name == "LATCH" and level]
    assert latches[0] > edges(board, "genlock")[1]


def test_a_waiting_board_can_be_stopped(emulated):
    link = emulated().plug()
    link.load(paper_program(cycles=1, slots=18))
    link.arm(start=wire.BY_EDGE)
    link.ask(wire.START)
    link.ask(wire.STOP)
    assert link.status()["state"] == wire.LOADED
