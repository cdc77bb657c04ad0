# SPDX-License-Identifier: MIT
# The next program is loaded while one plays and follows at the end of a cycle: on the trace, no slot is missing or late.
import pytest

import check_trace
from ols_board import wire
from ols_board.board import BoardError
from ols_board.program import CHAIN_BITS, paper_program


def one_slot_program(cycles, period_ticks, lamp):
    """The shortest of cycles: the feeds take a new table every `period_ticks`."""
    bits = [int(n == lamp) for n in range(CHAIN_BITS)]
    return {"cycles": cycles, "chain_bits": CHAIN_BITS,
            "slots": [{"kind": wire.BASIS, "trigger_mask": 1, "exposure_ticks": 200, "period_ticks": period_ticks,
                       "bits": bits}]}


def light_program(light_ticks, cycles=0, grey=False, offset_ticks=0, triggers=1):
    """Three slots a cycle, lit for about `light_ticks`, at most 70 % of the time; grey: the longest plane is."""
    slot = {"kind": wire.BASIS, "trigger_mask": triggers, "trigger_offset_ticks": offset_ticks,
            "exposure_ticks": light_ticks, "period_ticks": max(light_ticks * 10 // 7, light_ticks + 2600),
            "bits": [int(n < 100) for n in range(CHAIN_BITS)]}
    if grey:
        unit_ticks = light_ticks // 4
        slot |= {"planes": 3, "exposure_ticks": 7 * unit_ticks, "period_ticks": 7 * unit_ticks * 3 // 2 + 6000,
                 "levels": [n % 8 if n < 100 else 0 for n in range(CHAIN_BITS)]}
    return {"cycles": cycles, "chain_bits": CHAIN_BITS, "slots": [dict(slot) for _ in range(3)],
            "triggers": [{}], "lead_ticks": 1000 if offset_ticks < 0 else 0}


def swap_to(link, program):
    """Loads the program, lets it follow and waits until it has; returns after how many cycles it did."""
    link.load(program)
    after, _ = link.swap()
    while link.status()["next"] == wire.NEXT_SWAPPING:
        pass
    return after


def joined(programs_and_cycles):
    """What was played, as one program for the checker."""
    slots = [slot for program, cycles in programs_and_cycles for _ in range(cycles) for slot in program["slots"]]
    return {"cycles": 1, "chain_bits": CHAIN_BITS, "slots": slots}


def shortest_period(link):
    hello = link.hello(0)
    return hello["shift_ticks"] + hello["slot_gap_ticks"]


def test_programs_swapped_while_playing_leave_no_missing_or_late_slot_by_two_checkers(emulated):
    board = emulated(trace=True)
    link = board.plug()
    played, program = [], paper_program(cycles=0, slots=18, seed=1)
    link.play(program)
    for seed, slots, cycles in ((2, 36, 0), (3, 20, 0), (4, 18, 2)):
        following = paper_program(cycles, slots, seed)
        link.load(following)
        assert link.status()["next"] == wire.NEXT_READY
        after, number = link.swap()
        assert number == len(played) + 1
        played.append((program, after))
        program = following
        while link.status()["next"] == wire.NEXT_SWAPPING:
            pass
    status = link.wait_until([wire.DONE, wire.FAULT])
    played.append((program, 2))
    whole = joined(played)
    assert (status["fault"], status["triggers_fired"]) == (0, len(whole["slots"]))
    entries, lost = link.trigger_log()
    assert lost == 0
    wanted = [(number, n // len(program["slots"]), n % len(program["slots"]))
              for number, (program, cycles) in enumerate(played) for n in range(cycles * len(program["slots"]))]
    assert [(entry[5], entry[2], entry[3]) for entry in entries] == wanted
    board.stop()
    report = check_trace.check(board.trace, whole)
    # SYNC and the log say where programs begin; lamps, triggers and times are those of one long program.
    assert report["right"], report


def test_the_shortest_cycles_are_swapped_without_a_gap_again_and_again(emulated):
    board = emulated(trace=True)
    link = board.plug()
    period = shortest_period(link)
    # At 98 000 triggers a second the log has most of the main loop, and a load takes half a second: two are enough.
    programs = [one_slot_program(0, period, lamp) for lamp in range(2)] + [one_slot_program(300, period, 4)]
    played = []
    link.play(programs[0])
    for before, following in zip(programs, programs[1:]):
        link.load(following)
        played.append((before, link.swap()[0]))
        while link.status()["next"] == wire.NEXT_SWAPPING:
            pass
    status = link.wait_until([wire.DONE, wire.FAULT])
    assert status["fault"] == 0, wire.FAULTS[status["fault"]]
    played.append((programs[-1], 300))
    board.stop()
    whole = joined(played)
    report = check_trace.own_check(check_trace.read_vcd(board.trace), check_trace.expected_slots([whole]))
    wrong = {name: report[name] for name in report if name.endswith(("_wrong", "_error_ticks")) and report[name]}
    assert not wrong and report["triggers"] == len(whole["slots"]) > 600


@pytest.mark.parametrize("options", [{}, {"grey": True}, {"offset_ticks": -700}, {"offset_ticks": 1500}, {"triggers": 0}],
                         ids=["plain", "grey", "early triggers", "late triggers", "no triggers"])
def test_lights_may_become_shorter_and_longer_from_program_to_program(emulated, options):
    link = emulated().plug()
    programs = [light_program(us * 125, **options) for us in (400, 40, 24)]
    link.play(programs[0])
    for following in (programs[1], programs[2], programs[0], programs[2], programs[0]) * 3:
        swap_to(link, following)
        status = link.status()
        assert status["fault"] == 0, wire.FAULTS[status["fault"]]


def test_a_dark_program_may_be_followed_by_one_with_lights(emulated):
    link = emulated().plug()
    dark = light_program(5000)
    for slot in dark["slots"]:
        slot |= {"kind": wire.DARK, "bits": [0] * CHAIN_BITS}
    link.play(dark)
    for following in (light_program(50_000), dark, light_program(3000), dark, light_program(50_000)):
        swap_to(link, following)
        status = link.status()
        assert status["fault"] == 0, wire.FAULTS[status["fault"]]


def test_after_a_swap_to_shorter_lights_one_that_is_longer_than_those_is_caught(emulated):
    board = emulated("--inject", "upset:17@trigger:1000+1000", trace=True)
    link = board.plug()
    link.play(light_program(50_000))
    swap_to(link, light_program(3000))
    status = link.wait_until([wire.FAULT])
    assert wire.FAULTS[status["fault"]] == "over-duty"
    board.stop()
    lights = check_trace.pulses(check_trace.read_vcd(board.trace), "LIGHT_EN")
    # The upset adds 2^17 ticks to the light; the handler has 10 us (docs/firmware.md, "How each doubt ends dark").
    assert 3000 < lights[-1][1] - lights[-1][0] < 3000 + 6 + 1250
    assert max(fall - rise for rise, fall in lights[-100:-1]) == 3000


def test_1024_slots_are_loaded_while_1024_play(emulated):
    board = emulated()
    link = board.plug()
    link.play(paper_program(cycles=0, slots=1024))
    link.load(paper_program(cycles=1, slots=1024, seed=2))
    after, _ = link.swap()
    status = link.wait_until([wire.DONE, wire.FAULT])
    assert (status["fault"], status["triggers_fired"]) == (0, 1024 * (after + 1))


def test_a_damaged_next_program_is_refused_and_the_playing_one_goes_on(emulated):
    board = emulated()
    link = board.plug()
    link.play(paper_program(cycles=0, slots=18))
    data = wire.program_bytes(paper_program(cycles=1, slots=18))
    link.ask(wire.LOAD_BEGIN, wire.load_begin(paper_program(cycles=1, slots=18), data))
    link.ask(wire.LOAD_CHUNK, bytes(4) + bytes([data[0] ^ 1]) + data[1:])
    with pytest.raises(BoardError) as refused:
        link.ask(wire.LOAD_END)
    assert refused.value.code == wire.ERROR_BAD_CRC
    with pytest.raises(BoardError, match="nothing to swap"):
        link.swap()
    assert link.status()["state"] == wire.PLAYING
