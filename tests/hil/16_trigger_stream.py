# SPDX-License-Identifier: MIT
# Every trigger over USB at 20 000 slots a second, counted losses when the host is away, and the fastest slots that each
# shift clock allows.
import random
import subprocess

import pytest

import check_trace
from ols_board import claims, wire
from ols_board.board import ROOT, BoardError
from ols_board.log import TriggerStream
from ols_board.program import CHAIN_BITS

TICK_HZ = 125_000_000
LOG_ENTRIES = 1024
LAMPS_AT_ONCE = 40  # of 156: a duty far below the limit
# What pulse.pio takes: PROTOCOL.md, "hello", and firmware.md, "How fast". From the drivers' clock, not from the code.
BIT_TICKS = {10: 13, 20: 7, 30: 5}


def fast_program(period_ticks, cycles, slots=100, exposure_ticks=600, seed=2):
    pick = random.Random(seed)
    made = []
    for _ in range(slots):
        bits = [0] * CHAIN_BITS
        for lamp in pick.sample(range(156), LAMPS_AT_ONCE):
            bits[lamp] = 1
        made.append({"kind": wire.BASIS, "trigger_mask": 1, "exposure_ticks": exposure_ticks,
                     "period_ticks": period_ticks, "bits": bits})
    return {"cycles": cycles, "chain_bits": CHAIN_BITS, "slots": made}


def test_at_20000_slots_a_second_the_host_sees_every_trigger_of_more_than_a_second(emulated):
    period_ticks = TICK_HZ // 20_000
    program = fast_program(period_ticks, cycles=210)
    link = emulated().plug()
    link.play(program)
    stream = TriggerStream(link)
    status = stream.follow_to_the_end()
    assert (status["state"], status["fault"]) == (wire.DONE, 0)
    triggers = 210 * 100
    claims.counted(f"USB at 20 000 slots/s: {triggers} triggers, {stream.requests} requests, {stream.backlog_max} of {LOG_ENTRIES} waiting at most")
    assert (stream.lost, stream.skipped) == (0, 0)
    assert [entry[1] for entry in stream.entries] == list(range(triggers))
    assert [(entry[2], entry[3]) for entry in stream.entries] == [divmod(n, 100) for n in range(triggers)]
    begin = stream.entries[0][0]
    assert all(abs(entry[0] - begin - n * period_ticks) <= 2 for n, entry in enumerate(stream.entries))
    assert stream.entries[-1][0] - begin > TICK_HZ


def test_what_a_host_that_was_away_has_missed_is_counted_to_the_last_trigger(emulated):
    program = fast_program(TICK_HZ // 20_000, cycles=30)
    link = emulated().plug()
    link.play(program)
    stream = TriggerStream(link)
    while stream.next_counter < 300:
        stream.poll()
    while link.status()["triggers_fired"] < 2500:
        pass  # the log overflows: nobody reads it
    status = stream.follow_to_the_end()
    assert status["fault"] == 0 and status["triggers_fired"] == 3000
    assert stream.lost > 0
    assert stream.lost == stream.skipped == status["log_entries_lost"]
    counters = [entry[1] for entry in stream.entries]
    assert len(counters) == len(set(counters)) == 3000 - stream.lost and counters[-1] == 2999


def image_for(driver_mhz, tmp_path_factory):
    out = tmp_path_factory.mktemp(f"firmware{driver_mhz}")
    subprocess.run(["make", "-C", ROOT / "firmware", "BOARD=pico", f"DRIVER_MHZ={driver_mhz}", f"OUT={out}", "-s"], check=True,
                   capture_output=True)
    return out / "stage.elf"


@pytest.mark.parametrize("driver_mhz", BIT_TICKS)
def test_the_fastest_slots_of_a_shift_clock_play_right_and_one_tick_less_is_refused(emulated, driver_mhz,
                                                                                    tmp_path_factory):
    board = emulated(trace=True, image=image_for(driver_mhz, tmp_path_factory))
    link = board.plug()
    hello = link.hello(0)
    # 3 ticks until the shifter is told, 4 until its first word, one a word of 32 bits, one for its phase; then the gap.
    limit = 3 + 4 + BIT_TICKS[driver_mhz] * CHAIN_BITS + 6 + 1 + hello["slot_gap_ticks"]
    assert hello["shift_ticks"] + hello["slot_gap_ticks"] == limit
    with pytest.raises(BoardError, match=f"period must be at least {limit} ticks"):
        link.load(fast_program(limit - 1, cycles=4))
    program = fast_program(limit, cycles=4, exposure_ticks=limit // 2)
    link.play(program)
    stream = TriggerStream(link)
    status = stream.follow_to_the_end()
    assert status["fault"] == 0, wire.FAULTS[status["fault"]]
    board.stop()
    report = check_trace.check(board.trace, program)
    assert report["right"], report
    clocks = [tick for tick, name, level in check_trace.read_vcd(board.trace) if name == "CLK" and level]
    assert min(b - a for a, b in zip(clocks, clocks[1:])) == BIT_TICKS[driver_mhz]
    claims.measured(f"drivers of {driver_mhz} MHz: {limit} ticks a slot, {TICK_HZ / limit:.0f} slots/s, every word right")
    assert [entry[1] for entry in stream.entries] == list(range(400))
