# SPDX-License-Identifier: MIT
# PIO against an emulator that is not ours: PyPI rp2040-pio-emulator, pin change by pin change, on random programs of
# the instructions that both know. It has no flags, dividers, OUT PC, EXEC or STATUS, writes all pins in MOV PINS, and
# refills an empty OSR in OUT alone, not in the background (RP2040 datasheet 3.5.4.2): with autopull, programs begin
# with an OUT and have no PULL.
import collections
import json
import random
import subprocess

import pytest

from ols_board.board import EMULATOR

pioemu = pytest.importorskip("pioemu", reason="needs PyPI rp2040-pio-emulator")

CYCLES = 400
PROGRAMS = 150
JMP, OUT, PULL, MOV, SET = 0, 3, 4, 5, 7
OUT_NULL_1 = OUT << 13 | 3 << 5 | 1


def random_instruction(pick, side_bits, autopull):
    """Delays are short, so that much happens; side-set bits are random."""
    delay_bits = 5 - side_bits
    field = pick.getrandbits(side_bits) << delay_bits | (pick.randrange(4) if pick.random() < 0.3 else 0)
    kind = pick.choice((JMP, JMP, OUT, OUT, OUT if autopull else PULL, MOV, SET, SET))
    low = {
        JMP: lambda: pick.choice((0, 1, 2, 3, 4, 5)) << 5 | pick.randrange(16),
        OUT: lambda: pick.choice((0, 1, 2, 3)) << 5 | pick.randrange(32),
        PULL: lambda: 0x80 | pick.choice((0, 1)) << 5,
        MOV: lambda: pick.choice((1, 2)) << 5 | pick.choice((0, 1, 2)) << 3 | pick.choice((1, 2, 3)),
        SET: lambda: pick.choice((0, 1, 2)) << 5 | pick.randrange(32),
    }[kind]()
    return kind << 13 | field << 8 | low


def random_case(seed):
    pick = random.Random(seed)
    side, autopull = pick.randrange(3), pick.random() < 0.5
    program = [random_instruction(pick, side, autopull) for _ in range(16)]
    if autopull:
        program[0] = OUT_NULL_1
    return {"program": program, "words": [pick.getrandbits(32) for _ in range(4)], "autopull": autopull,
            "threshold": pick.randint(1, 32), "outRight": pick.random() < 0.5, "side": side, "cycles": CYCLES}


def oracle_edges(case):
    """(cycle, pins) for each change. An instruction's pins change one cycle after it began."""
    start = pioemu.State(pin_directions=0xFFFFFFFF, transmit_fifo=collections.deque(case["words"]))
    steps = pioemu.emulate(
        case["program"], stop_when=lambda _, state: state.clock >= CYCLES, initial_state=start,
        auto_pull=case["autopull"], pull_threshold=case["threshold"], shift_osr_right=case["outRight"],
        out_base=0, out_count=8, set_base=8, set_count=5, side_set_base=16, side_set_count=case["side"])
    return [[before.clock + 1, after.pin_values] for before, after in steps if before.pin_values != after.pin_values]


def test_random_programs_change_pins_as_an_independent_emulator_has_it():
    cases = [random_case(seed) for seed in range(PROGRAMS)]
    player = EMULATOR.parent / "test/play_programs.mjs"
    answer = subprocess.run(["node", player], input=json.dumps(cases), capture_output=True, text=True, check=True)
    changes = 0
    for seed, (case, edges) in enumerate(zip(cases, json.loads(answer.stdout))):
        assert edges == oracle_edges(case), f"seed {seed}"
        changes += len(edges)
    assert changes > 20 * PROGRAMS
