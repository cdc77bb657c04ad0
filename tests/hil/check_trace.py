#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Checks a trace of the board against the program it played, twice: by our own reading of the VCD and by sigrok-cli.

usage: check_trace.py TRACE.vcd PROGRAM.json [PROGRAM.json ...]

The programs were played one after the other. PROGRAM.json holds
{"cycles": n, "slots": [{"kind", "trigger_mask", "exposure_ticks", "period_ticks", "bits"}, ...]}: kind 3 is dark, bits are
a list of 0 and 1 in chain order; a grey slot has "planes" and "levels" instead, and its "span_ticks"; a slot may have
"trigger_offset_ticks", the program up to four "triggers" [{"offset_ticks", "width_ticks", "skip_kinds", "active_low"},
...]. Prints JSON, errors in ticks of 8 ns. Exits with 1 if anything is wrong, or if sigrok-cli is not there to check.
"""
import json
import re
import shutil
import subprocess
import sys
from collections import deque

TICK_NS = 8
LATCH_TICKS = 12  # from LATCH to the light
DARK = 3
TRIGGERS = ("TRIG0", "TRIG1", "TRIG2", "TRIG3")


def read_vcd(path, healthy=False):
    """The value changes of a VCD with a time scale of 1 ns, as (tick, signal name, level) in order of time. HEALTHY, which
    beats as the main loop turns and not as a program plays, is left out unless asked for."""
    meanings, changes, tick = {}, [], 0  # meanings: of each line that says a level, which is most of a trace of millions
    with open(path) as lines:
        for line in lines:
            if line in meanings:
                if meanings[line]:
                    changes.append((tick, *meanings[line]))
            elif line[0] == "#":
                tick, rest = divmod(int(line[1:]), TICK_NS)
                if rest:
                    raise SystemExit(f"{path}: the time {line.strip()} is not a whole tick")
            elif line.startswith("$var"):
                _, _, _, identifier, name, _ = line.split()
                for level in (0, 1):
                    meanings[f"{level}{identifier}\n"] = (name, level) if healthy or name != "HEALTHY" else None
            elif line[0] in "01":
                raise SystemExit(f"{path}: the line {line.strip()} is of no signal that was declared")
    if not changes:
        raise SystemExit(f"{path}: no value changes; is this a VCD of the board?")
    return changes


def pulses(changes, name, active_low=0):
    """The stretches in which a signal is active, as (begin, end); the last may lack its end."""
    # The first edge is the initial low, and an active-low signal goes to its idle level when the board is armed.
    edges = [tick for tick, which, _ in changes if which == name][2 if active_low else 1 :]
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


def patterns(slot):
    """A slot's words on the chain: its bits, or its levels' bits from the most significant plane on."""
    if "levels" not in slot:
        return [slot["bits"]]
    return [[level >> plane & 1 for level in slot["levels"]] for plane in reversed(range(slot["planes"]))]


def chain_bits_of(slots):
    return len(patterns(slots[0])[0])


def expected_slots(programs):
    """Every slot that is played, in order, each with its program's number and triggers, and its start in ticks after that
    program's first."""
    slots = []
    for play, program in enumerate(programs):
        start = 0
        for _ in range(program["cycles"]):
            for slot in program["slots"]:
                slots.append({**slot, "play": play, "triggers": program.get("triggers", []), "start": start})
                start += slot["period_ticks"]
    return slots


def trigger_of(slot, n):
    return (slot["triggers"] + [{}] * 4)[n]


def expected_pulses(slots, n):
    """(play, rise, fall) of trigger n, in ticks after its play's first light, for every slot in which it fires."""
    for slot in slots:
        trigger = trigger_of(slot, n)
        if slot["trigger_mask"] >> n & 1 and not trigger.get("skip_kinds", 0) >> slot["kind"] & 1:
            rise = slot["start"] + slot.get("trigger_offset_ticks", 0) + trigger.get("offset_ticks", 0)
            width = trigger.get("width_ticks", 0) or slot.get("span_ticks", slot["exposure_ticks"])
            yield slot["play"], rise, rise + width


def expected_periods(wanted):
    """Ticks from each pulse's rise to the next one's, None where the next is of another play."""
    return [b[1] - a[1] if a[0] == b[0] else None for a, b in zip(wanted, wanted[1:])]


def expected_flashes(slot):
    """(play, begin, ticks) of each stretch of light of a slot; the begin of later planes is the board's choice, None."""
    planes = slot.get("planes", 0) or 1
    unit = slot["exposure_ticks"] // (2**planes - 1)
    for plane in range(planes):
        yield slot["play"], None if plane else slot["start"], unit << (planes - 1 - plane)


def play_origins(words, slots):
    """The tick of each play's first light, by the LATCH of its first slot."""
    origins, n = {}, 0
    for slot in slots:
        if n < len(words):
            origins.setdefault(slot["play"], words[n][0] + LATCH_TICKS)
        n += len(patterns(slot))
    return origins


def own_check(changes, slots):
    """Triggers, light and shift words as the edges have them, against the slots."""
    words = latched_words(changes, chain_bits_of(slots))
    origins = play_origins(words, slots)
    light = pulses(changes, "LIGHT_EN")
    lit = [flash for slot in slots if slot["kind"] != DARK for flash in expected_flashes(slot)]
    wrong = sum(fall - rise != ticks or begin not in (None, rise - origins.get(play, 0))
                for (rise, fall), (play, begin, ticks) in zip(light, lit))
    report = {"shift_words_checked": len(words), "shift_words_wrong": count_wrong([w for _, w in words], slots),
              "light_pulses": len(light), "light_pulses_wrong": wrong + abs(len(light) - len(lit)),
              "triggers": 0, "triggers_expected": 0}
    periods, offsets, widths = [0], [0], [0]
    for n, name in enumerate(TRIGGERS):
        found = pulses(changes, name, trigger_of(slots[0], n).get("active_low", 0))
        wanted = list(expected_pulses(slots, n))
        report["triggers"] += len(found)
        report["triggers_expected"] += len(wanted)
        steps = zip(found, found[1:], expected_periods(wanted))
        periods += [(b[0] - a[0]) - period for a, b, period in steps if period is not None]
        offsets += [a[0] - origins.get(play, 0) - rise for a, (play, rise, _) in zip(found, wanted)]
        widths += [(a[1] - a[0]) - (fall - rise) for a, (_, rise, fall) in zip(found, wanted)]
    report["trigger_period_error_ticks"] = max(map(abs, periods))
    report["trigger_offset_error_ticks"] = max(map(abs, offsets))
    report["exposure_error_ticks"] = max(map(abs, widths))
    return report


def count_wrong(words, slots):
    """Words that are not their slot's patterns, missing and surplus words among them."""
    wanted = [pattern for slot in slots for pattern in patterns(slot)]
    return sum(word != pattern for word, pattern in zip(words, wanted)) + abs(len(words) - len(wanted))


def sigrok_check(path, slots):
    """The same from sigrok's SPI and timing decoders, which know nothing of us; the chain must be whole bytes long."""
    chain_bits = chain_bits_of(slots)
    if chain_bits % 8:
        return {"error": "the chain is not whole bytes long, which sigrok's SPI decoder needs"}
    if shutil.which("sigrok-cli") is None:
        return {"error": "sigrok-cli is not installed"}
    spi = "spi:clk=CLK:mosi=DATA:cs=LATCH:cs_polarity=active-low:wordsize=8"
    transfers = [line.split(":")[1].split() for line in decode(path, spi, "spi=mosi-transfer")]
    words = [[int(bit) for byte in line for bit in f"{int(byte, 16):08b}"][-chain_bits:] for line in transfers]
    report = {"shift_words_checked": len(words), "shift_words_wrong": count_wrong(words, slots)}
    periods = expected_periods(list(expected_pulses(slots, 0)))
    edge = "falling" if trigger_of(slots[0], 0).get("active_low", 0) else "rising"
    found = [ticks_of(line) for line in decode(path, f"timing:data=TRIG0:edge={edge}", "timing=time")]
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
    first = len(list(expected_pulses(slots, 0)))
    report["right"] = (
        report["trigger_period_error_ticks"] == 0 == own["exposure_error_ticks"] == own["trigger_offset_error_ticks"]
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
