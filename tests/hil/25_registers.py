# SPDX-License-Identifier: MIT
# What the firmware leaves in the chip's registers, as far as the lamps hang on it.
import pytest

import check_trace
from ols_board import wire
from ols_board.board import BOARD
from ols_board.program import CHAIN_BITS, paper_program

pytestmark = pytest.mark.skipif(BOARD != "emulated", reason="needs the emulated board: it looks into the chip")

MS = 125_000  # ticks
ALL_PINS = (1 << 30) - 1


def test_what_a_debugger_has_left_in_sios_output_register_lights_nothing(emulated):
    board = emulated("--sio-out", str(ALL_PINS), trace=True)
    link = board.plug()
    link.play_to_the_end(paper_program(cycles=1, slots=18))
    link.usb.read(timeout_us=5_000)
    board.stop()
    changes = check_trace.read_vcd(board.trace)
    latches = [tick for tick, name, level in changes if name == "LATCH" and level]
    assert len(latches) == 18
    for name in ("LATCH", "LIGHT_EN", "TRIG0", "TRIG1", "TRIG2", "TRIG3", "SYNC"):
        assert not [tick for tick, which, level in changes if which == name and level and tick < latches[0]], name


def test_outputs_drive_12_ma_for_the_cables_sake(emulated):
    board = emulated()
    board.plug().status()
    pads = board.stop()["pads"]
    assert {pads.pop("PHOTO")} == {4}  # which nothing is wired to
    assert len(pads) >= 11 and set(pads.values()) == {12}, pads


def test_a_stop_in_the_light_is_dark_before_the_receptor_is_stopped(emulated):
    slot = {"kind": wire.BASIS, "trigger_mask": 1, "exposure_ticks": 40 * MS, "period_ticks": 60 * MS,
            "bits": [1] + [0] * (CHAIN_BITS - 1)}
    board = emulated("--inject", f"genlock@{450 * MS}", trace=True)
    link = board.plug()
    link.load({"cycles": 0, "chain_bits": CHAIN_BITS, "slots": [slot]})
    link.arm(start=wire.EACH_CYCLE_BY_EDGE, debounce_ticks=1250)
    link.ask(wire.START)
    link.wait_until([wire.PLAYING])
    link.ask(wire.STOP)
    board.stop()
    falls = {name: [tick for tick, which, level in check_trace.read_vcd(board.trace) if which == name and not level and tick][-1]
             for name in ("LIGHT_EN", "PHOTO")}
    rise = [tick for tick, which, level in check_trace.read_vcd(board.trace) if which == "LIGHT_EN" and level][-1]
    assert rise < falls["LIGHT_EN"] < rise + 40 * MS, "stopped in the light"
    assert falls["LIGHT_EN"] < falls["PHOTO"]
