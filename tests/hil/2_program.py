# SPDX-License-Identifier: MIT
# The paper's cycle, played by the firmware: every edge of the trace and every exposure against the program.
import json
import subprocess
import sys
import threading

import pytest

import check_trace
from ols_board import claims, wire
from ols_board.board import ROOT, BoardError
from ols_board.program import paper_program


def hex_digits(bits):
    return f"{int(''.join(map(str, bits)), 2):0{len(bits) // 4}x}"


def test_every_trigger_and_shift_word_of_two_cycles_is_right_by_two_checkers(emulated, tmp_path):
    program = paper_program(cycles=2)
    board = emulated(trace=True)
    board.plug().play_to_the_end(program)
    board.stop()
    (tmp_path / "program.json").write_text(json.dumps(program))
    result = subprocess.run([sys.executable, ROOT / "tests/hil/check_trace.py", board.trace, tmp_path / "program.json"],
                            capture_output=True, text=True)
    report = json.loads(result.stdout)
    assert result.returncode == 0 and report["right"], report
    assert report["own"]["triggers"] == report["sigrok"]["triggers"] == 360
    assert report["own"]["shift_words_checked"] == report["sigrok"]["shift_words_checked"] == 360
    assert report["trigger_period_error_ticks"] == 0
    claims.measured("360 slots of 462.96 us: every trigger at its tick, every bit of 360 words right, by two checkers")


def test_the_checker_notices_a_trigger_moved_by_one_tick_and_a_wrong_lamp(emulated):
    program = paper_program(cycles=1, slots=18)
    board = emulated(trace=True)
    board.plug().play_to_the_end(program)
    board.stop()
    assert check_trace.check(board.trace, program)["right"]
    wrong_lamp = json.loads(json.dumps(program))
    wrong_lamp["slots"][5]["bits"][17] ^= 1
    report = check_trace.check(board.trace, wrong_lamp)
    assert not report["right"]
    assert report["own"]["shift_words_wrong"] == report["sigrok"]["shift_words_wrong"] == 1
    late = json.loads(json.dumps(program))
    late["slots"][5]["period_ticks"] += 1
    report = check_trace.check(board.trace, late)
    assert not report["right"]
    assert report["own"]["trigger_period_error_ticks"] == report["sigrok"]["trigger_period_error_ticks"] == 1


def test_exposures_carry_the_lamps_and_exact_ticks_of_their_slots(emulated):
    program = paper_program(cycles=1)
    board = emulated(exposures=True)
    received = []
    reader = threading.Thread(target=lambda: received.extend(board.exposures_until("exposure", 180)))
    reader.start()
    link = board.plug()
    link.play_to_the_end(program)
    reader.join(timeout=30)
    hello = received[0]
    exposures = [message for message in received if message["type"] == "exposure"]
    assert hello["tick_hz"] == 125_000_000 and hello["chain_bits"] == 176
    assert [exposure["n"] for exposure in exposures] == list(range(180))
    for exposure, slot in zip(exposures, program["slots"]):
        rise, fall = exposure["rise"], exposure["fall"]
        assert fall - rise == slot["exposure_ticks"]
        lit = [] if slot["kind"] == wire.DARK else [{"on": rise, "off": fall, "bits": hex_digits(slot["bits"])}]
        assert exposure["segments"] == lit
    # The board's own witness measures to two ticks; it must see the same periods.
    entries, lost = link.trigger_log()
    assert lost == 0
    measured = [entry[0] for entry in entries]
    true = [exposure["rise"] for exposure in exposures]
    assert {b - a for a, b in zip(measured, true)} <= {true[0] - measured[0] + off for off in (-1, 0, 1)}


def test_stepping_every_cycle_gives_the_same_edges(emulated):
    program = paper_program(cycles=2, slots=20)
    traces = []
    for arguments in ([], ["--naive"]):
        board = emulated(*arguments, trace=True)
        link = board.plug()
        link.play(program)
        link.wait_until([wire.DONE, wire.FAULT])
        board.stop()
        changes = check_trace.read_vcd(board.trace)
        start = next(tick for tick, name, level in changes if name == "TRIG0" and level)
        traces.append([(tick - start, name, level) for tick, name, level in changes if tick >= start])
    assert traces[0] == traces[1]
    assert len(traces[0]) > 20 * 176


def test_a_uf2_file_plays_as_the_elf_file_does(emulated):
    program = paper_program(cycles=1, slots=18)
    board = emulated(trace=True, image=ROOT / "build/firmware/stage.uf2")
    board.plug().play_to_the_end(program)
    board.stop()
    assert check_trace.check(board.trace, program)["right"]


def test_stop_ends_an_endless_program_dark(emulated):
    board = emulated(trace=True)
    link = board.plug()
    link.play(paper_program(cycles=0, slots=18))
    while link.status()["triggers_fired"] < 30:
        pass
    link.ask(wire.STOP)
    assert link.status()["state"] == wire.LOADED
    fired = link.status()["triggers_fired"]
    board.stop()
    changes = check_trace.read_vcd(board.trace)
    last = {name: level for _, name, level in changes}
    assert not any(last.values())
    assert len([1 for _, name, level in changes if name == "TRIG0" and level]) == fired


@pytest.mark.parametrize("damage, message", [
    ({"exposure_ticks": 57_860}, "slot 3"),
    ({"trigger_mask": 0x10}, "slot 3"),
])
def test_a_program_that_cannot_be_played_is_refused_with_its_slot(emulated, damage, message):
    program = paper_program(cycles=1, slots=18)
    program["slots"][3].update(damage)
    with pytest.raises(BoardError) as refused:
        emulated().plug().load(program)
    assert refused.value.slot == 3 and message in refused.value.text


def test_the_image_of_another_board_plays_the_same_on_its_own_pins(emulated):
    program = paper_program(cycles=1, slots=18)
    board = emulated(trace=True, image=ROOT / "build/firmware/feather_can/stage.uf2")
    board.plug().play_to_the_end(program)
    board.stop()
    assert check_trace.check(board.trace, program)["right"]


def test_an_image_connected_as_another_board_reaches_no_lamp(emulated):
    board = emulated("--board", "pico", trace=True, image=ROOT / "build/firmware/feather_can/stage.uf2")
    link = board.plug_usb()  # its CAN controller is on other pins, too
    with pytest.raises(BoardError, match="emergency stop"):  # its input is on another pin there
        link.play(paper_program(cycles=1, slots=18))
    board.stop()
    assert not any(level for _, name, level in check_trace.read_vcd(board.trace) if name in ("LATCH", "LIGHT_EN"))


def test_latch_is_never_high_while_the_clock_rises_so_the_drivers_stay_in_their_normal_mode(emulated):
    board = emulated(trace=True)
    board.plug().play_to_the_end(paper_program(cycles=2, slots=18))
    board.stop()
    high, rises, together = set(), 0, 0
    for _, name, level in check_trace.read_vcd(board.trace):
        (high.add if level else high.discard)(name)
        rises += name == "CLK" and level
        together += name == "CLK" and level and "LATCH" in high
    assert rises >= 36 * 176 and together == 0
