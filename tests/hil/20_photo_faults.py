# SPDX-License-Identifier: MIT
# Photo-receptor mode among everything else: what stops a program that plays stops one that waits for its next edge, a wait is
# no fault however long, digests do not wait for the next cycle, and a board without READY counts as well.
import zlib

import pytest

import check_trace
from ols_board import wire
from ols_board.board import ROOT
from ols_board.log import TriggerStream
from ols_board.program import CHAIN_BITS
from ols_board.stops import LIT, MS, injected, levels_after, wait_for_fault

DEBOUNCE_TICKS = 1250
BEGIN = 400 * MS  # by when the board waits
PERIOD_TICKS = 100_000
CYCLE_TICKS = 2 * PERIOD_TICKS
HANDLER_TICKS_MAX = 1250  # 10 us
SUSPEND_TICKS = 3 * MS  # an idle bus is a suspended one (USB 2.0 7.1.7.6)


def lit_program(cycles=0):
    slots = [{"kind": wire.BASIS, "trigger_mask": 1, "exposure_ticks": 60_000, "period_ticks": PERIOD_TICKS,
              "bits": [int(lamp < 60) for lamp in range(CHAIN_BITS)]} for _ in range(2)]
    return {"cycles": cycles, "chain_bits": CHAIN_BITS, "slots": slots}


def pulses(ticks):
    return [part for tick in ticks for part in ("--inject", f"genlock@{tick}", "--inject", f"genlockfall@{tick + 5000}")]


def wait_for_edges(board, program, heartbeat_ticks=0):
    link = board.plug()
    link.load(program)
    link.arm(heartbeat_ticks, start=wire.EACH_CYCLE_BY_EDGE, debounce_ticks=DEBOUNCE_TICKS)
    link.ask(wire.START)
    return link


def lit_changes(board):
    return [change for change in check_trace.read_vcd(board.trace) if change[1] in LIT]


def wait_until_playing(link):
    while link.status()["state"] == wire.WAITING:
        link.usb.read(timeout_us=1_000)  # nothing comes: board time passes


STOPS = [("estop", "emergency stop", 0), ("overtemperature", "over-temperature", 0), ("openlamp", "open lamp", 0),
         ("unplug", "host lost", SUSPEND_TICKS)]


@pytest.mark.parametrize("injection, cause, noticed_ticks", STOPS, ids=[stop[0] for stop in STOPS])
@pytest.mark.parametrize("moment", ("waiting", "playing"))
def test_what_stops_a_cycle_that_plays_stops_the_wait_for_the_next(emulated, injection, cause, noticed_ticks, moment):
    later = BEGIN + 300 * MS
    # In the second cycle's first light, so long before its end that 3 ms more are in another cycle; or between cycles.
    edges = [BEGIN, later, *(later + n * (CYCLE_TICKS + 9_000) for n in range(1, 3))] if moment == "playing" else \
            [BEGIN, later + 4 * MS]
    stop = later + 30_000
    board = emulated("--inject", f"{injection}@{stop}", *pulses(edges), trace=True)
    link = wait_for_edges(board, lit_program())
    wait_until_playing(link)
    try:
        status = wait_for_fault(link)
    except ConnectionError:
        link.usb.close()
        link = board.plug()
        status = link.status()
    assert wire.FAULTS[status["fault"]] == cause
    board.stop()
    (tick, _), = injected(board, {injection})
    changes = lit_changes(board)
    last = max(at for at, _, _ in changes)
    played = [at for at, name, level in changes if name == "TRIG0" and level]
    if moment == "waiting":
        assert last < tick and len(played) == 2
    else:
        assert tick < last <= tick + noticed_ticks + HANDLER_TICKS_MAX and len(played) > 2
    assert not any(levels_after(changes, last).values())


def test_a_host_that_is_silent_while_the_board_waits_is_a_fault(emulated):
    board = emulated(*pulses([BEGIN, BEGIN + 900 * MS]), trace=True)
    link = wait_for_edges(board, lit_program(), heartbeat_ticks=100 * MS)
    wait_until_playing(link)
    for _ in range(10):
        link.usb.read(timeout_us=10_000)
        status = link.status()
        assert status["state"] == wire.PLAYING, wire.FAULTS[status["fault"]]  # asking is enough
    link.usb.read(timeout_us=1_000_000)
    assert wire.FAULTS[link.status()["fault"]] == "heartbeat"
    board.stop()
    assert sum(name == "TRIG0" and level for _, name, level in lit_changes(board)) == 2  # the second edge is after it


def test_a_wait_of_seconds_is_no_fault_and_the_digest_of_the_cycle_before_is_there(emulated):
    edges = [BEGIN, BEGIN + 3000 * MS]
    board = emulated(*pulses(edges))
    link = wait_for_edges(board, lit_program(cycles=2))
    wait_until_playing(link)
    link.usb.read(timeout_us=100_000)
    (digest,), lost = link.digests()
    stream = TriggerStream(link)
    stream.poll()
    packed = b"".join(wire.LOG_ENTRY.pack(*entry) for entry in stream.entries)
    assert (lost, digest["cycle"], digest["trigger_count"], digest["flags"]) == (0, 0, 2, 0)
    assert digest["entries_crc32"] == zlib.crc32(packed)
    while link.status()["state"] == wire.PLAYING:
        link.usb.read(timeout_us=50_000)
    status = link.status()
    assert (status["state"], status["fault"], status["edges_seen"], status["edges_missed"]) == (wire.DONE, 0, 2, 0)
    digests, lost = link.digests()
    assert [(digest["cycle"], digest["trigger_count"], digest["flags"]) for digest in digests] == [(0, 2, 0), (1, 2, 0)]
    apart = digests[1]["first_rise_ticks"] - digests[0]["first_rise_ticks"]
    assert abs(apart - (edges[1] - edges[0])) <= 2


def test_the_feather_which_has_no_ready_counts_seen_and_missed_edges_alike(emulated):
    starts = [BEGIN + n * 50 * MS for n in range(6)]
    missed = [starts[n] + after for n, after in ((1, 20_000), (1, 90_000), (4, CYCLE_TICKS - 10_000))]
    board = emulated(*pulses(sorted(starts + missed)), trace=True, image=ROOT / "build/firmware/feather_can/stage.elf")
    link = wait_for_edges(board, lit_program())
    while link.status()["edges_seen"] < len(starts + missed):
        link.usb.read(timeout_us=1_000)
    link.usb.read(timeout_us=5_000)
    status = link.status()
    assert (status["state"], status["fault"], status["edges_missed"]) == (wire.PLAYING, 0, len(missed))
    link.ask(wire.STOP)
    assert (link.status()["edges_seen"], link.status()["edges_missed"]) == (len(starts + missed), len(missed))
    board.stop()
    changes = check_trace.read_vcd(board.trace)
    rises = {name: [tick for tick, which, level in changes if which == name and level and tick] for name in ("PHOTO", "LATCH")}
    came = [tick for tick, name in injected(board, {"genlock"})]
    assert rises["PHOTO"] == [tick + DEBOUNCE_TICKS + 4 for tick in came]
    begun = [tick for tick, at in zip(came, sorted(starts + missed)) if at in starts]
    assert rises["LATCH"][::2] == [tick + DEBOUNCE_TICKS + 4 + 7 for tick in begun]
    assert "READY" not in {name for _, name, _ in changes}
