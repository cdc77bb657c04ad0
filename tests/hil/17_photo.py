# SPDX-License-Identifier: MIT
# Photo-receptor mode: each debounced edge of GENLOCK starts a cycle after a stated delay; glitches start none; an edge that
# comes while a cycle plays is counted as missed. Every tick is checked against the edges that were injected.
import random
import re

import pytest

import check_trace
from ols_board import claims, wire
from ols_board.board import BoardError
from ols_board.log import TriggerStream
from ols_board.program import CHAIN_BITS

MS = 125_000  # ticks
LATCH_TICKS = 12
DEBOUNCE_TICKS = 1250  # 10 us
BEGIN_TICKS = 400 * MS  # by when the board is armed


def projector_program(cycles, period_ticks=100_000):
    """Two exposures of the camera for each edge (Tariq, section 4), no lamp lit: the projector is the light."""
    exposures = (20_000, 60_000)
    slots = [{"kind": wire.DARK, "trigger_mask": 1, "exposure_ticks": ticks, "period_ticks": period_ticks,
              "bits": [0] * CHAIN_BITS} for ticks in exposures]
    return {"cycles": cycles, "chain_bits": CHAIN_BITS, "slots": slots, "lead_ticks": 500,
            "triggers": [{"offset_ticks": 3000}]}


def injections(edges):
    """The arguments that make GENLOCK change at these ticks, rising first."""
    names = ("genlock", "genlockfall")
    return [part for n, tick in enumerate(edges) for part in ("--inject", f"{names[n % 2]}@{tick}")]


def injected(board):
    """(tick, level) of GENLOCK's changes, as the emulator says that they came."""
    found = re.findall(r"injected at tick (\d+): (genlock|genlockfall)\n", board.log)
    return [(int(tick), name == "genlock") for tick, name in found]


def debounced_rises(changes, debounce_ticks):
    """When GENLOCK has been high for the debounce time, having been low for as long before: by definition, edge by edge."""
    rises, is_high = [], False
    for (tick, level), (next_tick, _) in zip(changes, changes[1:] + [(10**12, None)]):
        if next_tick - tick < debounce_ticks or level == is_high:
            continue
        is_high = level
        if level:
            rises.append(tick)
    return rises


def edge_ticks(trace, name, level):
    changes = check_trace.read_vcd(trace)
    return [tick for tick, which, value in changes if which == name and value == level and tick > 0]


def play(board, program, debounce_ticks=DEBOUNCE_TICKS):
    """Plays to the end; returns the last status, the hello and all log entries."""
    link = board.plug()
    hello = link.hello(0)
    link.load(program)
    link.arm(start=wire.EACH_CYCLE_BY_EDGE, debounce_ticks=debounce_ticks)
    link.ask(wire.START)
    while (status := link.status())["state"] in (wire.WAITING, wire.PLAYING):
        link.usb.read(timeout_us=1_000)  # nothing comes: board time passes
    stream = TriggerStream(link)
    while stream.poll():
        pass
    board.stop()
    assert status["fault"] == 0, wire.FAULTS[status["fault"]]
    return status, hello, stream.entries


def bouncing_edges(pick, count, pause_ticks):
    """Rises and falls that bounce: glitches of up to the debounce time around every edge, and some alone."""
    edges, tick = [], BEGIN_TICKS

    def glitches():
        nonlocal tick
        for _ in range(pick.randrange(4)):
            width = pick.choice((1, 2, 3, pick.randrange(4, DEBOUNCE_TICKS - 2)))
            edges.extend((tick, tick + width))
            tick += width + pick.randrange(1, DEBOUNCE_TICKS - 2)

    for _ in range(count):
        for _ in range(2):  # up, then down
            glitches()
            edges.append(tick)
            tick += pick.randrange(DEBOUNCE_TICKS + 2, 20_000)
            glitches_after = pick.random() < 0.5
            if glitches_after:
                edges.extend((tick, tick + pick.randrange(1, DEBOUNCE_TICKS - 2)))
                tick = edges[-1] + DEBOUNCE_TICKS + 2
        tick += pick.choice((5_000, pause_ticks))
    return edges


def test_each_edge_starts_a_cycle_the_stated_ticks_after_it_and_bounces_start_none(emulated):
    cycles, period_ticks = 25, 100_000
    program = projector_program(cycles, period_ticks)
    board = emulated(*injections(bouncing_edges(random.Random(3), 60, 3 * period_ticks)), trace=True)
    status, hello, entries = play(board, program)
    assert (status["state"], status["cycles_played"]) == (wire.DONE, cycles)

    changes = injected(board)
    wanted = [tick + DEBOUNCE_TICKS + 4 for tick in debounced_rises(changes, DEBOUNCE_TICKS)]
    ready = edge_ticks(board.trace, "READY", 1)
    photo = edge_ticks(board.trace, "PHOTO", 1)
    assert photo == wanted[:len(photo)] and len(photo) >= status["edges_seen"] > cycles
    assert len(changes) > 6 * len(photo)  # most of what was injected were bounces

    # A cycle begins with READY's fall, and the first latch comes a lead later.
    begins = edge_ticks(board.trace, "READY", 0)
    first_latches = edge_ticks(board.trace, "LATCH", 1)[::2]
    delay = hello["cycle_edge_ticks"] + DEBOUNCE_TICKS
    rises = [tick - DEBOUNCE_TICKS - 4 for tick in photo]
    started = [rise for rise in rises if rise + delay in begins]
    assert [rise + delay for rise in started] == begins and len(begins) == cycles
    assert [begin + 500 for begin in begins] == first_latches
    assert [begin + 2 * period_ticks for begin in begins[:-1]] == ready[1:]
    claims.measured(f"photo-receptor: {status['edges_seen']} edges, {status['edges_missed']} missed; {delay} ticks from edge to cycle")

    # What did not start a cycle came while one played, and was counted; counting ends with the last cycle.
    played_in = [any(begin < tick < begin + 2 * period_ticks for begin in begins) for tick in photo]
    seen = status["edges_seen"]
    assert sum(played_in[:seen]) == status["edges_missed"] == seen - cycles > 0

    # The camera's triggers: the set delay after the edge, counted and time-stamped.
    trigger = edge_ticks(board.trace, "TRIG0", 1)
    assert trigger[::2] == [begin + 500 + LATCH_TICKS + 3000 for begin in begins]
    assert [(entry[2], entry[3]) for entry in entries] == [divmod(n, 2) for n in range(2 * cycles)]
    stamps = [entry[0] - entries[0][0] for entry in entries]
    assert all(abs(stamp - (tick - trigger[0])) <= 2 for stamp, tick in zip(stamps, trigger))


def test_an_edge_at_the_end_of_a_cycle_starts_the_next_or_is_counted_as_missed_at_every_tick(emulated):
    program = projector_program(cycles=0, period_ticks=90_000)
    length = 2 * 90_000
    edges, offsets = [], list(range(-6, 7)) * 2
    for n, offset in enumerate(offsets):
        first = BEGIN_TICKS + n * 10 * length
        # PHOTO rises debounce + 4 ticks after GENLOCK, the cycle begins 7 later, READY rises a cycle's length after that.
        edges += [first, first + 5000, first + 7 + length + offset, first + 7 + length + offset + 5000]
    board = emulated(*injections(edges), trace=True)
    link = board.plug()
    link.load(program)
    link.arm(start=wire.EACH_CYCLE_BY_EDGE, debounce_ticks=DEBOUNCE_TICKS)
    link.ask(wire.START)
    while link.status()["edges_seen"] < 2 * len(offsets):
        link.usb.read(timeout_us=1_000)
    link.usb.read(timeout_us=5_000)
    status = link.status()
    link.ask(wire.STOP)
    assert link.status()["edges_seen"] == 2 * len(offsets)
    board.stop()
    rises = [tick for tick, level in injected(board) if level]
    offsets = [second - first - 7 - length for first, second in zip(rises[::2], rises[1::2])]  # as they came to be
    assert {-2, -1, 0, 1, 2} <= set(offsets)
    begins = edge_ticks(board.trace, "READY", 0)[:-1]  # the last one is the stop
    late_enough = sum(offset >= 0 for offset in offsets)
    assert len(begins) == len(offsets) + late_enough
    assert status["edges_missed"] == len(offsets) - late_enough


def test_arming_explains_what_debouncing_needs_and_a_swap_is_refused(emulated):
    board = emulated("--inject", f"genlock@{BEGIN_TICKS}")
    link = board.plug()
    link.load(projector_program(cycles=0))
    for source, ticks in ((wire.EACH_CYCLE_BY_EDGE, 2), (wire.EACH_CYCLE_BY_EDGE, 5), (wire.BY_EDGE, 8)):
        with pytest.raises(BoardError, match="debounce_ticks is even"):
            link.arm(start=source, debounce_ticks=ticks)
    link.arm(start=wire.EACH_CYCLE_BY_EDGE, debounce_ticks=4)
    link.ask(wire.START)
    assert link.status()["state"] == wire.WAITING
    while link.status()["state"] == wire.WAITING:
        link.usb.read(timeout_us=1_000)
    assert link.status()["state"] == wire.PLAYING
    link.load(projector_program(cycles=0))
    with pytest.raises(BoardError, match="not swapped"):
        link.swap()
