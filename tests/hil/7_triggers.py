# SPDX-License-Identifier: MIT
# Four triggers with offsets of both signs, widths, slot kinds and polarities of their own, checked on the trace.
import threading

import pytest

import check_trace
from ols_board import wire
from ols_board.board import BoardError
from ols_board.program import paper_program

BASIS_ONLY = 0b1111 & ~(1 << wire.BASIS)
TRACKING_ONLY = 0b1111 & ~(1 << wire.TRACKING)


def four_camera_program():
    """TRIG0 opens early, beside the light; TRIG1 fires late and briefly; TRIG2 is a tracking-only witness camera; TRIG3
    is active low."""
    program = paper_program(cycles=2, slots=36)
    program["lead_ticks"] = 9000
    program["triggers"] = [
        {"offset_ticks": -8750},
        {"offset_ticks": 1500, "width_ticks": 40},
        {"skip_kinds": TRACKING_ONLY, "width_ticks": 10_000},
        {"skip_kinds": BASIS_ONLY, "offset_ticks": -200, "width_ticks": 52_000, "active_low": 1},
    ]
    for n, slot in enumerate(program["slots"]):
        slot["trigger_mask"] = 15
        slot["trigger_offset_ticks"] = (0, 17, -90)[n % 3]
    return program


def test_four_triggers_with_offsets_widths_kinds_and_polarity_are_right_by_two_checkers(emulated):
    program = four_camera_program()
    board = emulated(trace=True)
    link = board.plug()
    link.play_to_the_end(program)
    entries, lost = link.trigger_log()
    board.stop()
    report = check_trace.check(board.trace, program)
    assert report["right"], report
    assert report["own"]["triggers"] == 2 * (36 + 36 + 2 + 30)
    # The board's own witness, too, sees TRIG0 where it should be, to its resolution of two ticks.
    wanted = [rise for _, rise, _ in check_trace.expected_pulses(check_trace.expected_slots([program]), 0)]
    assert lost == 0 and len(entries) == len(wanted)
    assert all(abs((entry[0] - entries[0][0]) - (rise - wanted[0])) <= 2 for entry, rise in zip(entries, wanted))


def test_the_checker_notices_an_offset_that_is_one_tick_off(emulated):
    program = four_camera_program()
    board = emulated(trace=True)
    board.plug().play_to_the_end(program)
    board.stop()
    program["triggers"][1]["offset_ticks"] += 1
    report = check_trace.check(board.trace, program)
    assert not report["right"]
    assert report["own"]["trigger_offset_error_ticks"] == 1 and report["own"]["trigger_period_error_ticks"] == 0


def test_an_active_low_trigger_0_is_logged_and_exposes_while_it_is_low(emulated):
    program = paper_program(cycles=1, slots=18)
    program["triggers"] = [{"active_low": 1}]
    board = emulated("--active-low", "0", trace=True, exposures=True)
    received = []
    reader = threading.Thread(target=lambda: received.extend(board.exposures_until("exposure", 18)))
    reader.start()
    link = board.plug()
    link.play_to_the_end(program)
    entries, _ = link.trigger_log()
    assert [entry[3] for entry in entries] == list(range(18))
    reader.join(timeout=30)
    exposures = [message for message in received if message["type"] == "exposure"]
    assert [e["fall"] - e["rise"] for e in exposures] == [slot["exposure_ticks"] for slot in program["slots"]]
    board.stop()
    assert check_trace.check(board.trace, program)["right"]


@pytest.mark.parametrize("change, slot, message", [
    (lambda p: p["triggers"][0].update(offset_ticks=-9100), 0, "raise lead_ticks"),
    (lambda p: p["slots"][3].update(trigger_offset_ticks=3), 3, "8 ticks away"),
    (lambda p: p["slots"][35].update(trigger_offset_ticks=9000), 35, "ends after the cycle"),
    (lambda p: p.update(lead_ticks=57_000), 35, "room for lead_ticks"),
])
def test_triggers_that_cannot_be_played_are_refused_with_their_slot(emulated, change, slot, message):
    program = four_camera_program()
    program["triggers"][0]["offset_ticks"] = 0
    program["triggers"][3] = {}
    change(program)
    with pytest.raises(BoardError, match=message) as refused:
        emulated().plug().load(program)
    assert refused.value.slot == slot
