# SPDX-License-Identifier: MIT
# For random valid programs, the lamps and times decoded from the pins are the program's. PROGRAMS=n plays n of them, from
# seed SEED on.
import os
import random

import pytest

import check_trace
from ols_board import claims, wire
from ols_board.random_program import random_program

FIRST = int(os.environ.get("SEED", 1))
SEEDS = range(FIRST, FIRST + int(os.environ.get("PROGRAMS", 5)))
EDGE = 400 * 125_000  # ticks


@pytest.mark.parametrize("seed", SEEDS)
def test_what_the_pins_do_is_what_a_random_program_says_by_two_checkers(emulated, seed):
    pick = random.Random(seed)
    start = pick.choice((wire.BY_COMMAND, wire.BY_EDGE))
    board = emulated(*(["--inject", f"genlock@{EDGE}"] if start == wire.BY_EDGE else []), trace=True)
    link = board.plug()
    program = random_program(pick, link.hello(0))
    link.play_to_the_end(program, start)
    board.stop()
    report = check_trace.check(board.trace, program)
    assert report["right"], report
    kinds = [("grey" if "levels" in slot else "on/off", slot["kind"]) for slot in program["slots"]]
    claims.measured(f"random program, seed {seed}: {program['cycles']} cycles of {kinds}, {report['own']['triggers']} triggers")


def test_random_programs_mix_all_that_a_board_plays():
    hello = {"shift_ticks": 1246, "slot_gap_ticks": 28, "lamp_duty_max_permille": 750}
    programs = [random_program(random.Random(seed), hello) for seed in range(40)]
    slots = [slot for program in programs for slot in program["slots"]]
    triggers = [trigger for program in programs for trigger in program["triggers"]]
    assert {slot["kind"] for slot in slots} == {wire.BASIS, wire.TRACKING, wire.MATTE, wire.DARK}
    assert {slot.get("planes", 1) for slot in slots} == set(range(1, 7))
    assert {program["lead_ticks"] > 0 for program in programs} == {True, False}
    for key in ("width_ticks", "skip_kinds", "active_low"):
        assert {trigger[key] > 0 for trigger in triggers} == {True, False}, key
    assert {(trigger["offset_ticks"] > 0) - (trigger["offset_ticks"] < 0) for trigger in triggers} == {-1, 0, 1}
    assert {slot["trigger_offset_ticks"] > 0 for slot in slots} == {True, False}
