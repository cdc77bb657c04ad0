# SPDX-License-Identifier: MIT
# Grey levels: the light that every lamp gets, added up from the trace, for every level at 2160 slots a second.
import threading

import check_trace
from ols_board import claims, wire
from ols_board.program import CHAIN_BITS, PERIOD_TICKS, paper_program

UNIT_TICKS = 200
LEVELS = 256
LAMPS = 64  # that carry levels in one slot


def span_ticks(hello, unit_ticks, planes=8):
    """From first light to last, by the rules of PROTOCOL.md, "Grey levels"."""
    shift, ticks = hello["shift_ticks"], 0
    for plane in reversed(range(1, planes)):
        lit = unit_ticks << plane
        ticks += (lit if lit >= shift else max(lit + 8, shift)) + 8 + 12
    return ticks + unit_ticks


def ramp_program(hello, cycles=1):
    """Four slots in which 64 lamps at a time have each of the 256 levels; the lamps differ from slot to slot."""
    slots = []
    for n in range(LEVELS // LAMPS):
        levels = [0] * CHAIN_BITS
        for lamp in range(LAMPS):
            levels[(lamp + 32 * n) % CHAIN_BITS] = LAMPS * n + (lamp * 29) % LAMPS
        slots.append({"kind": wire.BASIS, "trigger_mask": 1, "planes": 8, "exposure_ticks": 255 * UNIT_TICKS,
                      "period_ticks": PERIOD_TICKS, "levels": levels, "span_ticks": span_ticks(hello, UNIT_TICKS)})
    return {"cycles": cycles, "chain_bits": CHAIN_BITS, "slots": slots}


def light_of_lamps(changes):
    """Ticks of light for each lamp, one list for each TRIG0 pulse, from the edges of LATCH, LIGHT_EN and the chain."""
    words = check_trace.latched_words(changes, CHAIN_BITS)
    light = check_trace.pulses(changes, "LIGHT_EN")
    slots = []
    for rise, fall in check_trace.pulses(changes, "TRIG0"):
        ticks = [0] * CHAIN_BITS
        for on, off in light:
            if rise <= on and off <= fall:
                bits = [bits for latch, bits in words if latch <= on][-1]
                ticks = [total + (off - on) * bit for total, bit in zip(ticks, bits)]
        slots.append(ticks)
    return slots


def play(board, link, program):
    link.play(program)
    status = link.wait_until([wire.DONE, wire.FAULT])
    assert status["fault"] == 0, wire.FAULTS[status["fault"]]


def test_the_light_of_every_level_is_linear_to_the_tick_by_two_checkers(emulated):
    board = emulated(trace=True)
    link = board.plug()
    program = ramp_program(link.hello(0), cycles=2)
    play(board, link, program)
    board.stop()
    report = check_trace.check(board.trace, program)
    assert report["right"], report
    assert report["own"]["shift_words_checked"] == report["sigrok"]["shift_words_checked"] == 2 * 4 * 8
    slots = light_of_lamps(check_trace.read_vcd(board.trace))
    errors, seen = [], set()
    for ticks, slot in zip(slots, program["slots"] * 2):
        errors += [abs(lamp_ticks / UNIT_TICKS - level) for lamp_ticks, level in zip(ticks, slot["levels"])]
        seen |= set(slot["levels"])
    assert len(slots) == 8 and seen == set(range(LEVELS))
    assert max(errors) == 0, f"{max(errors)} levels off; half a level was asked for"
    claims.measured(f"light of all {LEVELS} grey levels, added up at the pins: {max(errors)} levels off")


def test_an_exposure_carries_the_planes_of_its_slot_to_the_virtual_stage(emulated):
    board = emulated(exposures=True)
    received = []
    reader = threading.Thread(target=lambda: received.extend(board.exposures_until("exposure", 4)))
    reader.start()
    link = board.plug()
    program = ramp_program(link.hello(0))
    play(board, link, program)
    reader.join(timeout=30)
    exposures = [message for message in received if message["type"] == "exposure"]
    for exposure, slot in zip(exposures, program["slots"]):
        ticks = [0] * CHAIN_BITS
        for segment in exposure["segments"]:
            bits = f"{int(segment['bits'], 16):0{CHAIN_BITS}b}"
            ticks = [total + (segment["off"] - segment["on"]) * int(bit) for total, bit in zip(ticks, bits)]
        assert ticks == [UNIT_TICKS * level for level in slot["levels"]]
        assert exposure["fall"] - exposure["rise"] == slot["span_ticks"]


def test_300_grey_slots_are_loaded_while_300_play_and_swapped_in(emulated):
    board = emulated()
    link = board.plug()
    ramp = ramp_program(link.hello(0))
    ramp["slots"] = ramp["slots"] * 75
    link.play({**ramp, "cycles": 0})
    link.load(ramp)
    after, _ = link.swap()
    status = link.wait_until([wire.DONE, wire.FAULT])
    assert (status["fault"], status["triggers_fired"]) == (0, 300 * (after + 1))


def test_grey_and_on_off_slots_share_a_cycle(emulated):
    board = emulated(trace=True)
    link = board.plug()
    program = paper_program(cycles=2, slots=18)
    program["slots"][3:7] = ramp_program(link.hello(0))["slots"]
    play(board, link, program)
    board.stop()
    report = check_trace.check(board.trace, program)
    assert report["right"], report
