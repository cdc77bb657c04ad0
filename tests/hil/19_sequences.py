# SPDX-License-Identifier: MIT
# The examples of sequence.toml that are more than a capture basis, played by `stagectl play`: the pins are held against the
# file as it is read here, not by stagectl.
import json
import os
import subprocess
import tomllib

import check_trace
from ols_board import wire
from ols_board.board import ROOT
from ols_board.program import CHAIN_BITS

STAGECTL = ROOT / "build/host/bin/stagectl"
KINDS = {"basis": wire.BASIS, "tracking": wire.TRACKING, "matte": wire.MATTE, "dark": wire.DARK}
EDGE = 400 * 125_000  # ticks


def ticks(us):
    return round(us * 125)


def example(name):
    with open(ROOT / "examples" / name, "rb") as file:
        return tomllib.load(file)


def trigger_of(table):
    kinds = [KINDS[kind] for kind in table.get("kinds", KINDS)]
    return {"offset_ticks": ticks(table.get("offset_us", 0)), "width_ticks": ticks(table.get("width_us", 0)),
            "skip_kinds": sum(1 << kind for kind in KINDS.values() if kind not in kinds),
            "active_low": int(table.get("active_low", False))}


def slot_of(table, period_us, offsets):
    kind = table.get("kind", "dark")
    slot = {"kind": KINDS[kind], "trigger_mask": sum(1 << line for line in table.get("triggers", [0])),
            "period_ticks": ticks(table.get("period_us", period_us)), "exposure_ticks": ticks(table["exposure_us"]),
            "trigger_offset_ticks": ticks(table.get("offset_us", 0)) + ticks(offsets.get(kind, 0))}
    levels = [0] * CHAIN_BITS
    for lamp, level in zip(table.get("lamps", []), table.get("levels", [1] * CHAIN_BITS)):
        levels[lamp] = level
    return slot | ({"planes": 8, "levels": levels, "span_ticks": span_ticks(slot)} if "levels" in table else {"bits": levels})


def span_ticks(slot, shift_ticks=1246):
    """From first light to last of eight planes (PROTOCOL.md, "Grey levels")."""
    unit, span = slot["exposure_ticks"] // 255, 0
    for plane in range(7, 0, -1):
        lit = unit << plane
        span += (lit if lit >= shift_ticks else max(lit + 8, shift_ticks)) + 8 + 12
    return span + unit


def program_of(table):
    """The program that an example with listed slots asks for."""
    triggers = [{}] * 4
    for trigger in table.get("trigger", []):
        triggers[trigger["line"]] = trigger_of(trigger)
    period_us = 1e6 / table.get("frame_rate_hz", 2160)
    return {"cycles": table["cycles"], "chain_bits": CHAIN_BITS, "lead_ticks": ticks(table.get("lead_us", 0)),
            "triggers": triggers,
            "slots": [slot_of(slot, period_us, table.get("offset_us", {})) for slot in table["slot"]]}


def play(board, name, *arguments):
    """Plays an example to its end; returns what stagectl printed."""
    command = [STAGECTL, "play", ROOT / "examples" / name, "--board", f"socket:{board.path}/board.sock", "--json", *arguments]
    for _ in range(500):
        if os.path.exists(board.path / "board.sock"):
            break
        board.process.poll()
        subprocess.run(["sleep", "0.02"], check=True)
    done = subprocess.run([str(part) for part in command], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return [json.loads(line) for line in done.stdout.splitlines()], done.stderr


def test_cameras_of_their_own_times_kinds_and_polarities_play_as_the_file_says_by_two_checkers(emulated):
    program = program_of(example("sequence_cameras.toml"))
    board = emulated("--inject", f"genlock@{EDGE}", trace=True)
    triggers, _ = play(board, "sequence_cameras.toml")
    board.stop()
    report = check_trace.check(board.trace, program)
    assert report["right"], report
    assert [(t["cycle"], t["slot"]) for t in triggers] == [divmod(n, 4) for n in range(8)]


def test_harmonics_light_each_lamp_for_its_level_and_the_parts_make_up_the_function(emulated):
    listed = subprocess.run([STAGECTL, "sequence", ROOT / "examples/sequence_harmonics.toml", "--json"], check=True,
                            capture_output=True, text=True)
    slots = []
    for slot in json.loads(listed.stdout)["slots"]:
        made = {"kind": KINDS[slot["kind"]], "trigger_mask": 1, "exposure_ticks": slot["exposure_ticks"],
                "period_ticks": slot["period_ticks"]}
        padding = [0] * (CHAIN_BITS - 162)
        if slot["planes"]:
            made |= {"planes": 8, "levels": slot["levels"] + padding, "span_ticks": span_ticks(made)}
        slots.append(made if slot["planes"] else made | {"bits": [0] * CHAIN_BITS})
    assert len(slots) == 2 * 9 - 1 + 1
    board = emulated(trace=True)
    play(board, "sequence_harmonics.toml")
    board.stop()
    report = check_trace.check(board.trace, {"cycles": 2, "chain_bits": CHAIN_BITS, "slots": slots})
    assert report["right"], report


def test_a_projectors_pictures_trigger_the_camera_after_the_set_delay_and_one_too_many_is_told(emulated):
    table = example("sequence_photo.toml")
    cycle_ticks = sum(slot["period_ticks"] for slot in program_of(table)["slots"])
    pictures = [EDGE + n * (cycle_ticks + 50_000) for n in range(3)]
    edges = sorted(pictures + [pictures[1] + cycle_ticks // 2])
    arguments = [part for edge in edges for part in ("--inject", f"genlock@{edge}", "--inject", f"genlockfall@{edge + 20_000}")]
    board = emulated(*arguments, trace=True)
    triggers, told = play(board, "sequence_photo.toml", "--cycles", 3)
    board.stop()
    assert "4 edges, 1 of them missed" in told
    assert [(t["cycle"], t["slot"]) for t in triggers] == [divmod(n, 2) for n in range(6)]
    found = [tick for tick, name, level in check_trace.read_vcd(board.trace) if name == "TRIG0" and level]
    # From the edge: debounced, 11 ticks to the cycle, a latch, and the trigger's offset (PROTOCOL.md).
    delay = ticks(table["debounce_us"]) + 11 + 12 + ticks(table["trigger"][0]["offset_us"])
    first_period = ticks(table["slot"][0]["period_us"])
    wanted = [picture + delay + later for picture in pictures for later in (0, first_period)]
    assert all(abs(tick - want) <= 1 for tick, want in zip(found, wanted)) and len(found) == 6  # injected to a tick or so
