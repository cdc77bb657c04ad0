#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Checks a trace of the board against the program it played, twice: by our own reading of the VCD and by sigrok-cli.

usage: check_trace.py TRACE.vcd PROGRAM.json [PROGRAM.json ...]

The programs were played one after the other. PROGRAM.json holds {"cycles": n, "slots": [{"kind", "trigger_mask", "exposure_ticks", "period_ticks", "bits"}, ...]}:
kind 3 is dark, bits are a list of 0 and 1 in chain order. Prints JSON, errors in ticks of 8 ns. Exits with 1 if
anything is wrong, or if sigrok-cli is not there to check.
"""
import json
import re
import shutil
import subprocess
import sys
from collections import deque

TICK_NS = 8
DARK = 3
TRIGGERS = ("TRIG0", "TRIG1", "TRIG2", "TRIG3")


def read_vcd(path):
    """The value changes of a VCD with a time scale of 1 ns, as (tick, signal name, level) in order of time."""
    names, changes, tick = {}, [], 0
    with open(path) as lines:
        for line in lines:
            if line.startswith("$var"):
                _, _, _, identifier, name, _ = line.split()
                names[identifier] = name
            elif line[0] == "#":
                tick, rest = divmod(int(line[1:]), TICK_NS)
                if rest:
                    raise SystemExit(f"{path}: the time {line.strip()} is not a whole tick")
            elif line[0] in "01" and names:
                changes.append((tick, names[line[1:].strip()], int(line[0])))
    if not changes:
        raise SystemExit(f"{path}: no value changes; is this a VCD of the board?")
    return changes


def pulses(changes, name):
    """The stretches in which a signal is high, as (rise, fall); the last may lack its end."""
    edges = [tick for tick, which, _ in changes if which == name][1:]  # the first is the initial low
    return list(zip(edges[0::2], edges[1::2]))


def latched_words(changes, chain_bits):
    """(tick, the chain's bits, which are the last that were shifted in) for each rise of LATCH."""
    level, shifted, words = {}, deque(maxlen=chain_bits), []
    for tick, name, value in changes:
        rises = value > level.get(name, 0)
        if name == "CLK" and rises:
            shifted.append(level["DATA"])
        if name == "LATCH" and rises:
            words.append((tick, list(shifted)))
        level[name] = value
    return words


def expected_slots(programs):
    """Every slot that is played, in order, each with its program's number and its start in ticks after the first."""
    slots = []
    for play, program in enumerate(programs):
        start = 0
        for _ in range(program["cycles"]):
            for slot in program["slots"]:
                slots.append({**slot, "play": play, "start": start})
                start += slot["period_ticks"]
    return slots


def expected_periods(slots):
    """Ticks from each slot to the next, None where the next begins another program."""
    return [b["start"] - a["start"] if a["play"] == b["play"] else None for a, b in zip(slots, slots[1:])]


def own_check(changes, slots):
    """Triggers, light and shift words as the edges have them, against the slots."""
    words = latched_words(changes, len(slots[0]["bits"]))
    light = pulses(changes, "LIGHT_EN")
    report = {"shift_words_checked": len(words), "shift_words_wrong": count_wrong([w for _, w in words], slots)}
    report["triggers"] = report["triggers_expected"] = 0
    errors, exposure_errors = [0], [0]
    for n, name in enumerate(TRIGGERS):
        found = pulses(changes, name)
        wanted = [slot for slot in slots if slot["trigger_mask"] >> n & 1]
        report["triggers"] += len(found)
        report["triggers_expected"] += len(wanted)
        steps = zip(found, found[1:], expected_periods(wanted))
        errors += [(b[0] - a[0]) - period for a, b, period in steps if period is not None]
        exposure_errors += [fall - rise - slot["exposure_ticks"] for (rise, fall), slot in zip(found, wanted)]
        if n == 0:
            lit = [pulse for pulse, slot in zip(found, wanted) if slot["kind"] != DARK]
            report["light_pulses"] = len(light)
            report["light_pulses_wrong"] = sum(a != b for a, b in zip(light, lit)) + abs(len(light) - len(lit))
    report["trigger_period_error_ticks"] = max(map(abs, errors))
    report["exposure_error_ticks"] = max(map(abs, exposure_errors))
    return report


def count_wrong(words, slots):
    """Words that are not their slot's bits, missing and surplus words among them."""
    return sum(word != slot["bits"] for word, slot in zip(words, slots)) + abs(len(words) - len(slots))


def sigrok_check(path, slots):
    """The same from sigrok's SPI and timing decoders, which know nothing of us; the chain must be whole bytes long."""
    if len(slots[0]["bits"]) % 8:
        return {"error": "the chain is not whole bytes long, which sigrok's SPI decoder needs"}
    if shutil.which("sigrok-cli") is None:
        return {"error": "sigrok-cli is not installed"}
    spi = "spi:clk=CLK:mosi=DATA:cs=LATCH:cs_polarity=active-low:wordsize=8"
    transfers = [line.split(":")[1].split() for line in decode(path, spi, "spi=mosi-transfer")]
    chain_bits = len(slots[0]["bits"])
    words = [[int(bit) for byte in line for bit in f"{int(byte, 16):08b}"][-chain_bits:] for line in transfers]
    report = {"shift_words_checked": len(words), "shift_words_wrong": count_wrong(words, slots)}
    periods = expected_periods([slot for slot in slots if slot["trigger_mask"] & 1])
    found = [ticks_of(line) for line in decode(path, "timing:data=TRIG0:edge=rising", "timing=time")]
    report["triggers"] = len(found) + 1
    off = [abs(ticks - period) if abs(ticks - period) > unit / 2 else 0
           for (ticks, unit), period in zip(found, periods) if period is not None]
    report["trigger_period_error_ticks"] = round(max(off, default=0), 3)
    return report


def decode(path, decoder, annotation):
    command = ["sigrok-cli", "-i", path, "-I", f"vcd:downsample={TICK_NS}", "-P", decoder, "-A", annotation]
    return subprocess.run(command, check=True, capture_output=True, text=True).stdout.splitlines()


def ticks_of(line):
    """'timing-1: 462.960 μs (2.160 kHz)' as (ticks, ticks of the last digit shown)."""
    number, unit = re.search(r": ([\d.]+) (\S+)", line).groups()
    scale_ns = {"ns": 1, "μs": 1e3, "ms": 1e6, "s": 1e9}[unit]
    digits = len(number.partition(".")[2])
    return float(number) * scale_ns / TICK_NS, scale_ns / TICK_NS / 10**digits


def check(trace, *programs):
    slots = expected_slots(programs)
    changes = read_vcd(trace)
    report = {"own": own_check(changes, slots), "sigrok": sigrok_check(trace, slots)}
    own, sigrok = report["own"], report["sigrok"]
    report["trigger_period_error_ticks"] = max(own["trigger_period_error_ticks"],
                                               sigrok.get("trigger_period_error_ticks", float("inf")))
    first = sum(slot["trigger_mask"] & 1 for slot in slots)
    report["right"] = (
        report["trigger_period_error_ticks"] == 0 == own["exposure_error_ticks"]
        and own["triggers"] == own["triggers_expected"] and sigrok.get("triggers") == first
        and own["shift_words_wrong"] == own["light_pulses_wrong"] == sigrok.get("shift_words_wrong") == 0)
    return report


def main():
    if len(sys.argv) < 3:
        raise SystemExit(__doc__)
    programs = []
    for path in sys.argv[2:]:
        with open(path) as file:
            programs.append(json.load(file))
    report = check(sys.argv[1], *programs)
    print(json.dumps(report, indent=2))
    sys.exit(0 if report["right"] else 1)


if __name__ == "__main__":
    main()
