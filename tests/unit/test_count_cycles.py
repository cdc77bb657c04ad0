# SPDX-License-Identifier: MIT
"""The count of cycles from an interrupt to the dark: small functions counted by hand, and what it must refuse."""
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "firmware/tools"))
import count_cycles  # noqa: E402


def function(*lines, at=0x100):
    return {at + 2 * n: tuple(line.split(" ", 1) if " " in line else (line, "")) for n, line in enumerate(lines)}


def test_the_longer_of_two_branches_counts_with_every_access_at_its_worst():
    code = function("cmp r0, #0", "beq.n 106 <f+0x6>", "ldr r0, [r1, #0]", "bx lr")
    code = {at: (name.split(".")[0], operands) for at, (name, operands) in code.items()}
    # cmp 1, beq 2 (taken or not: the worst), ldr 6, bx 2
    assert count_cycles.Counter({"f": code}).longest("f") == 1 + 2 + 6 + 2


def test_calls_add_what_is_called_and_registers_pushed_are_words():
    called = function("movs r0, #1", "bx lr", at=0x200)
    code = function("push {r4, r5, r6, lr}", "bl 200 <g>", "pop {r4, r5, r6, pc}")
    assert count_cycles.Counter({"f": code, "g": called}).longest("f") == (1 + 8) + 3 + (1 + 2) + (1 + 8 + 3)


def test_a_path_that_stops_ends_in_the_dark_and_the_others_pass():
    functions = {"stop_now": function("bl 300 <board_dark>", "bx lr", at=0x200),
                 "board_dark": function("str r0, [r1, #0]", "bx lr", at=0x300),
                 "f": function("bne 104 <f+0x4>", "bl 200 <stop_now>", "nop", "nop", "bx lr")}
    counter = count_cycles.Counter(functions)
    assert counter.longest("f", True) == 2 + 3 + 3 + (6 + 2)
    assert counter.longest("f", False) == 2 + 1 + 1 + 2


def test_a_loop_whose_bound_nobody_gave_is_refused():
    code = function("subs r0, #1", "bne 100 <f>", "bx lr")
    with pytest.raises(SystemExit, match="loop"):
        count_cycles.Counter({"f": code}).longest("f")


def test_every_stopping_handler_of_the_image_is_dark_within_ten_microseconds():
    found, held = count_cycles.bounds(ROOT / "build/firmware/stage.elf")
    assert set(found) == set(count_cycles.HANDLERS) - {"interrupt_tick"}
    assert 0 < held < max(found.values()) <= 10 * count_cycles.TICKS_PER_US
