# SPDX-License-Identifier: MIT
# HEALTHY: it changes at the stated rate while the main loop turns and the light's pad obeys, and ends with either.
import re

import pytest

import check_trace
from ols_board import board as board_of
from ols_board import claims, wire
from ols_board.board import BoardError
from ols_board.program import CHAIN_BITS, EXPOSURE_TICKS, PERIOD_TICKS, paper_program
from ols_board.stops import MS, injected

LIGHT_EN = 5  # the Pico's GPIO
CHANGE_TICKS_MAX = 125 * int(re.search(r"HEALTHY_CHANGE_US_MAX = (\d+)",
                                       (board_of.ROOT / "firmware/healthy.h").read_text())[1])
TURN_TICKS_MAX = CHANGE_TICKS_MAX  # the loop's own turn, and no pulse after it


def beats(board):
    """The ticks at which HEALTHY changes; the board has ended."""
    changes = [(tick, level) for tick, name, level in check_trace.read_vcd(board.trace, healthy=True) if name == "HEALTHY"]
    assert changes[0] == (0, 0)  # $dumpvars
    assert all(level == (n + 1) % 2 for n, (_, level) in enumerate(changes[1:]))
    return [tick for tick, _ in changes[1:]]


def gaps(ticks, begin, end):
    inside = [tick for tick in ticks if begin <= tick <= end]
    return [b - a for a, b in zip(inside, inside[1:])]


def pass_time(link, microseconds):
    link.usb.read(timeout_us=microseconds)  # nothing comes: board time passes


def last_before(ticks, end):
    return max(tick for tick in ticks if tick < end)


def test_it_changes_often_enough_idle_in_a_long_upload_armed_playing_and_in_a_dark_fault(emulated):
    board = emulated("--inject", "estop@trigger:9000", trace=True)
    link = board.plug()
    pass_time(link, 20_000)
    slots = [{"kind": wire.BASIS, "trigger_mask": 15, "exposure_ticks": 20_000, "period_ticks": 40_000,
              "trigger_offset_ticks": 10 * (n % 7), "bits": [(n + lamp) % 2 for lamp in range(156)] + [0] * 20}
             for n in range(1024)]
    whole = {"cycles": 0, "chain_bits": CHAIN_BITS, "slots": slots, "lead_ticks": 2000,
             "triggers": [{}, {"offset_ticks": 200}, {"offset_ticks": 400, "width_ticks": 99}, {"offset_ticks": -100}]}
    link.load(whole)
    link.arm()
    pass_time(link, 20_000)
    link.ask(wire.START)
    link.load(whole)  # the next one, while this one plays
    link.swap()
    assert wire.FAULTS[link.wait_until([wire.FAULT])["fault"]] == "emergency stop"
    pass_time(link, 50_000)
    board.stop()
    ticks = beats(board)
    assert ticks[0] < 110 * MS  # 0_boot.py
    assert max(gaps(ticks, 0, ticks[-1])) <= CHANGE_TICKS_MAX
    (at, _), = injected(board, {"estop"})
    assert ticks[-1] - at > 40 * MS, "in the fault, too"
    claims.counted(f"HEALTHY: {len(ticks)} changes, at most {max(gaps(ticks, 0, ticks[-1])) / 125:.0f} us apart, "
                   f"at least {min(gaps(ticks, 0, ticks[-1])) / 125:.1f} us")


@pytest.mark.parametrize("injection, within_ticks, silent_until", [
    ("hang", TURN_TICKS_MAX, "watchdog"),
    ("lockup", TURN_TICKS_MAX, "watchdog"),
    ("hardfault", 1250, "watchdog"),
    ("watchdog", 0, None),
    ("reset", 0, None),
])
def test_it_ends_with_the_main_loop_and_comes_back_with_the_next_one(emulated, injection, within_ticks, silent_until):
    board = emulated("--inject", f"{injection}@trigger:40", trace=True)
    link = board.plug()
    try:
        link.play(paper_program(cycles=0, slots=18))
        link.wait_until([wire.FAULT])
    except ConnectionError:
        link = board.plug()
    pass_time(link, 10_000)
    assert link.status()["state"] == (wire.IDLE if injection == "reset" else wire.FAULT)
    board.stop()
    ticks = beats_across_resets(board)
    (at, _), = injected(board, {injection})
    reset = at
    if silent_until:
        reset = int(re.search(rf"reset at tick (\d+): {silent_until}", board.log)[1])
    assert last_before(ticks, reset) <= at + within_ticks
    after = [tick for tick in ticks if tick > reset]
    assert max(gaps(after, 0, after[-1])) <= CHANGE_TICKS_MAX


def beats_across_resets(board):
    """As beats, but a reset makes the pin low whatever it was."""
    return [tick for tick, name, _ in check_trace.read_vcd(board.trace, healthy=True) if name == "HEALTHY"][1:]


def test_it_ends_when_the_board_leaves_for_its_boot_loader(emulated):
    board = emulated(trace=True)
    link = board.plug()
    pass_time(link, 10_000)
    link.ask(wire.REBOOT_TO_BOOTLOADER)
    with pytest.raises(ConnectionError):
        while True:
            pass_time(link, 50_000)
            link.status()
    loader = board.plug()
    loader.usb.control(bytes((0x80, 6, 0, 1, 0, 0, 18, 0)), timeout_us=50_000)
    board.stop()
    left = int(re.search(r"reset at tick (\d+)", board.log)[1])
    assert max(beats_across_resets(board)) <= left


def refused_while_lit(link):
    """That nobody gets rid of the fault while the pad is lit, and that it is named then."""
    with pytest.raises(BoardError) as refused:
        link.ask(wire.CLEAR_FAULT)
    assert refused.value.code == wire.ERROR_NOT_SAFE and "LIGHT_EN" in refused.value.text
    assert wire.FAULTS[link.status()["fault"]] == "light stuck"
    with pytest.raises(BoardError):
        link.load(paper_program(cycles=1, slots=18))


def test_a_pad_that_is_lit_while_the_board_idles_ends_it_within_a_turn_until_it_is_dark_and_cleared(emulated):
    lit, dark = 40 * MS, 400 * MS
    board = emulated("--inject", f"short:{LIGHT_EN}:1@{lit}", "--inject", f"unshort:{LIGHT_EN}@{dark}", trace=True)
    link = board.plug()
    while wire.FAULTS[link.status()["fault"]] != "light stuck":
        pass_time(link, 20_000)
    refused_while_lit(link)
    for _ in range(50):
        pass_time(link, 20_000)
        status = link.status()
        assert wire.FAULTS[status["fault"]] == "light stuck"
    link.ask(wire.CLEAR_FAULT)
    assert link.status()["state"] == wire.IDLE
    link.play_to_the_end(paper_program(cycles=1, slots=18))
    board.stop()
    (at, _), = injected(board, {"short"})
    (end, _), = injected(board, {"unshort"})
    ticks = beats(board)
    assert [tick for tick in ticks if at + TURN_TICKS_MAX < tick < end] == []
    assert [tick for tick in ticks if end <= tick < end + 100 * MS] == [], "the dark alone does not bring it back"
    assert ticks[-1] > end


@pytest.mark.parametrize("begin", ("stopped", "ended", "emergency stop"))
def test_a_pad_that_stays_lit_after_a_stop_ends_it_within_a_turn_and_is_named(emulated, begin):
    program = paper_program(cycles=0, slots=18)
    stop, when = [], f"trigger:40+{EXPOSURE_TICKS + 4000}"
    if begin == "stopped":  # one short light, then dark for a second, in which the host stops it
        program["slots"] = [{**slot, "exposure_ticks": 1000, "period_ticks": 250 * MS} for slot in program["slots"][2:4]]
        when = f"trigger:1+{200 * MS}"
    if begin == "ended":
        program["cycles"] = 1
        when = f"trigger:18+{PERIOD_TICKS}"
    if begin == "emergency stop":
        stop = ["--inject", "estop@trigger:40", "--inject", "release@trigger:40+5000"]
        when = "trigger:40+1000"
    board = emulated(*stop, "--inject", f"short:{LIGHT_EN}:1@{when}", trace=True)
    link = board.plug()
    link.play(program)
    if begin == "stopped":
        link.ask(wire.STOP)
    cause = wire.FAULTS[link.wait_until([wire.FAULT])["fault"]]
    assert cause == ("emergency stop" if begin == "emergency stop" else "light stuck")
    pass_time(link, 30_000)
    refused_while_lit(link)
    board.stop()
    (at, _), = injected(board, {"short"})
    assert max(beats(board)) <= at + TURN_TICKS_MAX


def test_a_pad_that_stays_lit_while_a_program_plays_is_too_long_a_light_and_ends_it_too(emulated):
    board = emulated("--inject", f"short:{LIGHT_EN}:1@trigger:40", trace=True)
    link = board.plug()
    link.play(paper_program(cycles=0, slots=18))
    assert wire.FAULTS[link.wait_until([wire.FAULT])["fault"]] == "over-duty"
    pass_time(link, 30_000)
    refused_while_lit(link)
    board.stop()
    (at, _), = injected(board, {"short"})
    assert max(beats(board)) <= at + PERIOD_TICKS + TURN_TICKS_MAX


def test_a_board_that_boots_with_the_pad_lit_never_says_that_it_is_healthy(emulated):
    board = emulated("--inject", f"short:{LIGHT_EN}:1@1", trace=True)
    link = board.plug()
    pass_time(link, 30_000)
    assert wire.FAULTS[link.status()["fault"]] == "light stuck"
    board.stop()
    assert beats(board) == []
