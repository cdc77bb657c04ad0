# SPDX-License-Identifier: MIT
# The inputs that stop everything, and the host's silence: dark every time, with the right cause.
import os
import random

import pytest

import check_trace
from ols_board import claims, wire
from ols_board.board import BoardError
from ols_board.program import PERIOD_TICKS, paper_program
from ols_board.stops import (LIT, MS, clear, injected, last_change_before, levels_after, play_until_stopped,
                             wait_for_fault)

GUARD_STOP_TICKS = 4  # pulse.pio
HANDLER_TICKS_MAX = 1250  # 10 us
STOPS = int(os.environ.get("STOPS", 40))  # 1000 for the full count
STOPS_A_BOARD = 250  # so that traces stay short
CAUSES = {"estop": "emergency stop", "overtemperature": "over-temperature", "openlamp": "open lamp"}


def stop_at_random_ticks(emulated, pick, count):
    """Plays and stops `count` times; returns (name, ticks from the input's fall to the dark, was it lit) for each."""
    names = [pick.choice(list(CAUSES)) for _ in range(count)]
    arguments = []
    for n, name in enumerate(names):
        # Counted in triggers, so that each falls into a play, 6 to 36 slots long: at any tick of a slot.
        trigger, tick = 36 * n + 6 + pick.randrange(30), pick.randrange(PERIOD_TICKS)
        arguments += ["--inject", f"{name}@trigger:{trigger}+{tick}",
                      "--inject", f"release@trigger:{trigger}+{tick + 4 * MS + pick.randrange(MS)}"]
    board = emulated(*arguments, trace=True)
    link = board.plug()
    program = paper_program(cycles=0, slots=18)
    told = [play_until_stopped(link, program) for _ in range(count)]
    board.stop()
    assert [wire.FAULTS[status["fault"]] for status in told] == [CAUSES[name] for name in names]
    changes = check_trace.read_vcd(board.trace)
    pressed = injected(board, CAUSES)
    assert [name for _, name in pressed] == names
    return list(measured(changes, pressed))


def measured(changes, pressed):
    """The trace is read once, along with the stops."""
    level, at = {}, 0
    for tick, name in pressed:
        while at < len(changes) and changes[at][0] < tick:
            level[changes[at][1]] = changes[at][2]
            at += 1
        was_lit, dark = any(level.get(pin) for pin in LIT), tick
        while at < len(changes) and changes[at][0] <= tick + 3 * MS:
            level[changes[at][1]] = changes[at][2]
            if changes[at][1] in LIT:
                dark = changes[at][0]
            at += 1
        assert not any(level.get(pin) for pin in LIT), f"{name} at {tick}"
        yield name, dark - tick, was_lit


def test_emergency_stops_at_random_ticks_are_dark_at_once_every_time_with_the_right_cause(emulated):
    pick = random.Random(5)
    stops = []
    while len(stops) < STOPS:
        stops += stop_at_random_ticks(emulated, pick, min(STOPS_A_BOARD, STOPS - len(stops)))
    guarded = [ticks for name, ticks, _ in stops if name != "openlamp"]
    handled = [ticks for name, ticks, _ in stops if name == "openlamp"]
    lit = sum(was_lit for _, _, was_lit in stops)
    # PIO decides for the first two inputs, a handler for the third.
    assert max(guarded) <= GUARD_STOP_TICKS
    assert max(handled) <= HANDLER_TICKS_MAX
    assert lit > STOPS / 2, "most of the stops were to fall into light"
    claims.measured(f"{STOPS} stops, {lit} while lit: dark at most {max(guarded)} ticks after the pad falls, by PIO")
    claims.counted(f"open lamps among them: dark at most {max(handled)} ticks after the pad falls, by a handler")


@pytest.mark.parametrize("input_name, cause", CAUSES.items())
def test_a_stop_names_slot_and_tick_and_holds_until_it_is_cleared_and_released(emulated, input_name, cause):
    board = emulated("--inject", f"{input_name}@trigger:50")
    link = board.plug()
    program = paper_program(cycles=0, slots=18)
    link.play(program)
    status = link.wait_until([wire.FAULT])
    assert wire.FAULTS[status["fault"]] == cause
    assert status["fault_slot"] == 49 % 18
    assert 0 <= status["fault_ticks"] - 49 * PERIOD_TICKS <= MS // 100
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
