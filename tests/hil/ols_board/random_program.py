# SPDX-License-Identifier: MIT
# Random programs that mix everything a board plays, and that are valid by the rules of protocol/PROTOCOL.md as read here,
# independently of the firmware.
import itertools

from ols_board import wire
from ols_board.program import CHAIN_BITS, LAMPS

LATCH, APART = 12, 8  # ticks
TRIES = 2000


def random_program(pick, hello):
    """One that keeps the rules; `hello` is the board's."""
    for _ in range(TRIES):
        program = _any_program(pick, hello)
        if _keeps_the_rules(program, hello):
            return program
    raise RuntimeError(f"none of {TRIES} random programs keeps the rules")


def _any_program(pick, hello):
    slots = [_any_slot(pick, hello) for _ in range(pick.randint(1, 8))]
    last = slots[-1]
    lead_max = last["period_ticks"] - hello["slot_gap_ticks"] - _busy_ticks(last, hello)
    lead = pick.choice((0, pick.randint(0, lead_max)))
    return {"cycles": pick.randint(1, 3), "chain_bits": CHAIN_BITS, "slots": slots, "lead_ticks": lead if lead >= 8 else 0,
            "triggers": [_any_trigger(pick) for _ in range(4)]}


def _any_trigger(pick):
    return {"offset_ticks": pick.choice((0, 0, pick.randint(-400, 800))),
            "width_ticks": pick.choice((0, pick.randint(8, 1500))),
            "skip_kinds": pick.choice((0, 0, pick.randrange(16))), "active_low": pick.randrange(2)}


def _any_slot(pick, hello):
    kind = pick.choice((wire.BASIS, wire.BASIS, wire.TRACKING, wire.MATTE, wire.DARK))
    slot = {"kind": kind, "trigger_mask": pick.choice((1, 15, pick.randrange(16))),
            "trigger_offset_ticks": pick.choice((0, 0, pick.randint(-300, 300)))}
    if kind != wire.DARK and pick.random() < 0.4:
        slot["planes"] = pick.randint(2, 6)
        slot["exposure_ticks"] = (2 ** slot["planes"] - 1) * pick.randint(8, 60)
        slot["levels"] = [pick.randrange(2 ** slot["planes"]) if n < LAMPS else 0 for n in range(CHAIN_BITS)]
    else:
        slot["exposure_ticks"] = pick.choice((pick.randint(8, 60), pick.randint(8, 4000)))
        slot["bits"] = [int(kind != wire.DARK and n < LAMPS and pick.random() < 0.3) for n in range(CHAIN_BITS)]
    slot["span_ticks"] = slot["exposure_ticks"]
    if "levels" in slot:
        slot["span_ticks"] = list(_flashes(slot, hello))[-1][1]
    shortest = max(_busy_ticks(slot, hello), slot["exposure_ticks"]) + hello["slot_gap_ticks"]
    slot["period_ticks"] = shortest + pick.choice((0, pick.randint(0, 3000)))
    return slot


def _flashes(slot, hello):
    """(on, off, until the next pattern is sent) of each plane, in ticks after the slot's light."""
    planes = slot.get("planes", 0) or 1
    on = 0
    for plane in reversed(range(planes)):
        lit = APART if slot["kind"] == wire.DARK else slot["exposure_ticks"] // (2**planes - 1) << plane
        busy = lit if lit >= hello["shift_ticks"] else max(lit + APART, hello["shift_ticks"])
        yield on, on + lit, on + busy
        on += busy + APART + LATCH


def _busy_ticks(slot, hello):
    return list(_flashes(slot, hello))[-1][2]


def _keeps_the_rules(program, hello):
    first_light = program["lead_ticks"] + LATCH
    periods = (slot["period_ticks"] for slot in program["slots"])
    *lights, next_cycle = itertools.accumulate(periods, initial=first_light)
    cycle = next_cycle - first_light
    moments = {0, program["lead_ticks"], cycle - APART, cycle}
    for slot, light in zip(program["slots"], lights):
        for on, off, sent in _flashes(slot, hello):
            moments |= {light + on - LATCH, light + on, light + off, light + sent}
    pulses = [_pulses(program, lights, n) for n in range(4)]
    edges = {edge for one in pulses for pulse in one for edge in pulse}
    in_order = sorted(moments | edges)
    return (len(pulses[0]) >= 2 and all(0 <= edge <= cycle - APART for edge in edges)
            and all(b - a >= APART for one in pulses for a, b in zip(sum(one, ()), sum(one, ())[1:]))
            and all(b - a >= APART for a, b in zip(in_order, in_order[1:])
                    if a in edges or b in edges) and _duty_is_fine(program, cycle, hello))


def _pulses(program, lights, n):
    trigger, found = program["triggers"][n], []
    for slot, light in zip(program["slots"], lights):
        if slot["trigger_mask"] >> n & 1 and not trigger["skip_kinds"] >> slot["kind"] & 1:
            rise = light + slot["trigger_offset_ticks"] + trigger["offset_ticks"]
            found.append((rise, rise + (trigger["width_ticks"] or slot["span_ticks"])))
    return found


def _duty_is_fine(program, cycle, hello):
    lit = [0] * CHAIN_BITS
    for slot in program["slots"]:
        unit = slot["exposure_ticks"] // (2 ** slot.get("planes", 1) - 1)
        for lamp, level in enumerate(slot.get("levels") or slot["bits"]):
            lit[lamp] += level * unit
    return max(lit) * 1000 <= cycle * hello["lamp_duty_max_permille"]
