# SPDX-License-Identifier: MIT
# The inputs that stop everything, and the host's silence: dark every time, with the right cause.
import os
import random
import re

import pytest

import check_trace
from ols_board import wire
from ols_board.board import BoardError
from ols_board.program import PERIOD_TICKS, paper_program

MS = 125_000  # ticks
GUARD_STOP_TICKS = 4  # pulse.pio
STOPS = int(os.environ.get("STOPS", 40))  # 1000 for the full count
CAUSES = {"estop": "emergency stop", "overtemperature": "over-temperature", "openlamp": "open lamp"}
LIT = ("LIGHT_EN", *check_trace.TRIGGERS, "SYNC", "LATCH")


def injected(board, names):
    """(tick, name) of the injections that the board's log tells of."""
    found = re.findall(r"injected at tick (\d+): (\w+)", board.log)
    return [(int(tick), name) for tick, name in found if name in names]


def levels_after(changes, tick):
    """Level of each pin at the end of `tick`."""
    level = {}
    for at, name, value in changes:
        if at > tick:
            break
        level[name] = value
    return level


def last_change_before(changes, begin, end):
    return max((at for at, name, _ in changes if name in LIT and begin <= at < end), default=begin)


def play_until_stopped(link, program):
    """Plays until a fault, clears it, and returns the status that told of it."""
    while True:
        try:
            link.play(program)
            break
        except BoardError as refused:  # still pressed, or pressed just now
            if refused.code == wire.ERROR_FAULT_LATCHED:
                return clear(link)
            assert refused.code == wire.ERROR_NOT_SAFE, refused
    link.wait_until([wire.FAULT], polls=2000)
    return clear(link)


def clear(link):
    status = link.status()
    link.ask(wire.CLEAR_FAULT)
    return status


def test_emergency_stops_at_random_ticks_are_dark_at_once_every_time_with_the_right_cause(emulated):
    pick = random.Random(5)
    names = [pick.choice(list(CAUSES)) for _ in range(STOPS)]
    ticks = [(300 + 100 * n) * MS + pick.randrange(40 * MS) for n in range(STOPS)]
    arguments = []
    for name, tick in zip(names, ticks):
        arguments += ["--inject", f"{name}@{tick}", "--inject", f"release@{tick + 4 * MS + pick.randrange(MS)}"]
    board = emulated(*arguments, trace=True)
    link = board.plug()
    program = paper_program(cycles=0, slots=18)
    told = [play_until_stopped(link, program) for _ in range(STOPS)]
    board.stop()
    assert [wire.FAULTS[status["fault"]] for status in told] == [CAUSES[name] for name in names]
    changes = check_trace.read_vcd(board.trace)
    pressed = injected(board, CAUSES)
    assert [name for _, name in pressed] == names
    playing, guarded_ticks, processor_ticks = 0, [], []
    for tick, name in pressed:
        dark_from = last_change_before(changes, tick, tick + 4 * MS) - tick
        (processor_ticks if name == "openlamp" else guarded_ticks).append(dark_from)
        after = levels_after(changes, tick + 3 * MS)
        assert not any(after[pin] for pin in LIT), f"{name} at {tick}"
        playing += any(levels_after(changes, tick - 1)[pin] for pin in LIT)
    # PIO decides for the first two inputs; the processor, which looks each millisecond or two, for the third.
    assert max(guarded_ticks) <= GUARD_STOP_TICKS
    assert max(processor_ticks) <= 2 * MS
    assert playing > STOPS / 2, "most of the stops were to fall into light"
    print(f"{STOPS} stops: dark after {max(guarded_ticks)} ticks, open lamp {max(processor_ticks)} ticks")


@pytest.mark.parametrize("input_name, cause", CAUSES.items())
def test_a_stop_names_slot_and_tick_and_holds_until_it_is_cleared_and_released(emulated, input_name, cause):
    board = emulated("--inject", f"{input_name}@trigger:50")
    link = board.plug()
    program = paper_program(cycles=0, slots=18)
    link.play(program)
    status = link.wait_until([wire.FAULT])
    assert wire.FAULTS[status["fault"]] == cause
    assert status["fault_slot"] == 49 % 18
    assert 0 <= status["fault_ticks"] - 49 * PERIOD_TICKS <= 2 * MS
    with pytest.raises(BoardError) as refused:
        link.load(program)
    assert refused.value.code == wire.ERROR_FAULT_LATCHED
    link.ask(wire.CLEAR_FAULT)
    link.load(program)
    with pytest.raises(BoardError, match="emergency stop|driver") as refused:
        link.arm()
    assert refused.value.code == wire.ERROR_NOT_SAFE


def test_a_stop_as_short_as_a_tick_is_enough(emulated):
    board = emulated("--inject", "estop@trigger:20", "--inject", "release@trigger:20", trace=True)
    link = board.plug()
    link.play(paper_program(cycles=0, slots=18))
    status = link.wait_until([wire.FAULT])
    assert wire.FAULTS[status["fault"]] == "emergency stop"


def test_a_silent_host_is_noticed_at_the_time_chosen(emulated):
    board = emulated(trace=True)
    link = board.plug()
    heartbeat = 30 * MS
    link.play(paper_program(cycles=0, slots=18), heartbeat_ticks=heartbeat)
    for _ in range(20):
        heard = link.status()
        assert heard["state"] == wire.PLAYING
        link.usb.read(timeout_us=10_000)  # nothing comes: board time passes
    link.usb.read(timeout_us=60_000)
    status = link.status()
    assert wire.FAULTS[status["fault"]] == "heartbeat"
    board.stop()
    changes = check_trace.read_vcd(board.trace)
    rises = [tick for tick, name, level in changes if name == "TRIG0" and level]
    last = max(tick for tick, name, _ in changes if name in LIT)
    # The board heard the last message some microseconds before it read its time for the answer.
    assert -MS // 50 <= status["fault_ticks"] - heard["now_ticks"] - heartbeat <= MS // 1000
    assert last - rises[0] <= status["fault_ticks"] + MS // 100  # dark within 10 us of noticing


def test_a_program_beyond_what_lamps_or_supply_stand_is_refused(emulated):
    link = emulated().plug()
    hello = link.hello(0)
    program = paper_program(cycles=1, slots=18)
    slot = program["slots"][3]
    slot["bits"] = [1] * (hello["lamps_lit_max"] + 1) + [0] * (175 - hello["lamps_lit_max"])
    with pytest.raises(BoardError, match="supply") as refused:
        link.load(program)
    assert (refused.value.code, refused.value.slot) == (wire.ERROR_OVER_LIMIT, 3)
    program = paper_program(cycles=1, slots=18)
    for slot in program["slots"]:
        if slot["kind"] != wire.DARK:
            slot["bits"][7] = 1
    busy = sum(slot["exposure_ticks"] for slot in program["slots"] if slot["kind"] != wire.DARK)
    assert busy / (18 * PERIOD_TICKS) < 0.75
    link.load(program)
    for slot in program["slots"]:
        slot["exposure_ticks"], slot["kind"] = 56_000, wire.BASIS
        slot["bits"] = [int(n == 7) for n in range(176)]
    with pytest.raises(BoardError, match="chain bit 7") as refused:
        link.load(program)
    assert refused.value.code == wire.ERROR_OVER_LIMIT
