# SPDX-License-Identifier: MIT
# PIO against an emulator that is not ours: PyPI rp2040-pio-emulator, pin change by pin change, on random programs of
# the instructions that both know. It has no flags, dividers, OUT PC, EXEC or STATUS, writes all pins in MOV PINS, and
# refills an empty OSR in OUT alone, not in the background (RP2040 datasheet 3.5.4.2): with autopull, programs begin
# with an OUT and have no PULL. Then the board's own programs on it (oracle.py says how): a few slots of each kind, and the
# debouncing of edges.
import collections
import json
import random
import subprocess

import pytest

import check_trace
from ols_board import claims, wire
from ols_board.board import EMULATOR

pioemu = pytest.importorskip("pioemu", reason="needs PyPI rp2040-pio-emulator")
from ols_board import oracle  # noqa: E402, needs pioemu

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


def slot(kind, exposure_ticks, period_ticks, seed, **more):
    pick = random.Random(seed)
    bits = [0] * 176 if kind == wire.DARK else [pick.randint(0, 1) for _ in range(156)] + [0] * 20
    return {"kind": kind, "trigger_mask": 15, "exposure_ticks": exposure_ticks, "period_ticks": period_ticks,
            "bits": bits, **more}


def grey_slot(planes, unit_ticks, period_ticks, seed):
    pick = random.Random(seed)
    levels = [pick.randrange(1 << planes) for _ in range(156)] + [0] * 20
    return {"kind": wire.BASIS, "trigger_mask": 1, "planes": planes, "exposure_ticks": unit_ticks * ((1 << planes) - 1),
            "period_ticks": period_ticks, "levels": levels}


KINDS = {
    "on/off": {"slots": [slot(wire.BASIS, 40, 1400, 1), slot(wire.TRACKING, 1240, 2000, 2), slot(wire.DARK, 900, 1500, 3),
                         slot(wire.MATTE, 1300, 1700, 4)]},
    "grey": {"slots": [grey_slot(4, 10, 5500, 5), slot(wire.BASIS, 700, 1500, 6), grey_slot(2, 500, 3500, 7)]},
    "offsets": {"slots": [slot(wire.BASIS, 1000, 3000, 8, trigger_offset_ticks=-150), slot(wire.DARK, 900, 2600, 9),
                          slot(wire.TRACKING, 100, 4000, 10, trigger_offset_ticks=90), slot(wire.DARK, 900, 2800, 11)],
                "lead_ticks": 1100,
                "triggers": [{"offset_ticks": -808}, {"offset_ticks": 212, "width_ticks": 16},
                             {"skip_kinds": 0b1101, "offset_ticks": -40, "width_ticks": 1500},
                             {"offset_ticks": 500, "width_ticks": 300, "active_low": 1}]},
}


@pytest.mark.parametrize("start", (wire.BY_COMMAND, wire.BY_EDGE), ids=("command", "genlock"))
@pytest.mark.parametrize("kind", KINDS)
def test_slots_of_each_kind_change_every_pin_when_an_independent_emulator_does(emulated, kind, start, tmp_path):
    program = {"cycles": 2 if start == wire.BY_COMMAND else 1, "chain_bits": 176, **KINDS[kind]}
    edge = 400 * 125_000
    board = emulated(*(["--inject", f"genlock@{edge}"] if start == wire.BY_EDGE else []), trace=True)
    board.plug().play_to_the_end(program, start)
    board.stop()

    genlock_tick = 3700 if start == wire.BY_EDGE else None
    wanted = oracle.play(program, oracle.cycle_words(program, tmp_path), genlock_tick)
    changes = [change for change in check_trace.read_vcd(board.trace) if change[0] > 0]
    first_latch = next(tick for tick, name, level in changes if name == "LATCH" and level)
    assert wanted["LATCH"][0][1] == 1
    shift = first_latch - wanted["LATCH"][0][0]
    if genlock_tick is not None:
        assert shift == edge - genlock_tick
    for name, edges in wanted.items():
        low = name.startswith("TRIG") and check_trace.trigger_of(program | {"triggers": program.get("triggers", [])},
                                                                 int(name[4])).get("active_low", 0)
        found = [(tick - shift, level ^ low) for tick, which, level in changes if which == name]
        # Arming, long before, sends the first pattern, and takes an inverted pad to its idle level.
        if name in ("DATA", "CLK"):
            edges, found = ([edge for edge in some if edge[0] > 3000] for some in (edges, found))
        assert found[low:] == edges, name
    count = sum(map(len, wanted.values()))
    assert count > 1500
    claims.measured(f"{kind} slots, started by {'command' if start == wire.BY_COMMAND else 'genlock'}: {count} edges at the ticks of an "
                    "independent emulator")


@pytest.mark.parametrize("debounce_ticks", (4, 6, 50))
def test_an_edge_gets_through_when_it_lasts_as_long_as_it_must_and_is_counted_once(debounce_ticks):
    pick = random.Random(debounce_ticks)
    genlock, tick, wanted = [], 100, []
    for _ in range(60):
        high = debounce_ticks + pick.randrange(-3, 4)
        genlock += [tick, tick + high]
        if high >= debounce_ticks:
            wanted.append(tick + debounce_ticks + 4)
            genlock[-1] += debounce_ticks  # and the fall, long enough to be one
        tick = genlock[-1] + 2 * debounce_ticks + pick.randrange(20, 40)
    edges, pushed = oracle.debounce(debounce_ticks, genlock, tick)
    assert edges == [edge for rise in zip(wanted, edges[1::2]) for edge in rise] and len(edges) == 2 * len(wanted)
    assert pushed == len(wanted) and 10 < len(wanted) < 50
