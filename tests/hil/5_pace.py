# SPDX-License-Identifier: MIT
# Board time and the world's: at rest without cost, never ahead of a slow reader, bounded by the wall clock if asked.
import json
import os
import signal
import threading
import time

from ols_board import wire
from ols_board.program import PERIOD_TICKS, paper_program


def cpu_seconds(process):
    with open(f"/proc/{process.pid}/stat") as file:
        fields = file.read().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def test_an_idle_board_costs_no_processor_time_and_its_watchdog_does_not_bite(emulated):
    board = emulated()
    link = board.plug()
    nonce = link.status()["boot_nonce"]
    time.sleep(0.3)
    before = cpu_seconds(board.process)
    time.sleep(1.0)
    assert cpu_seconds(board.process) - before < 0.05
    status = link.status()
    assert (status["boot_nonce"], status["fault"]) == (nonce, 0)


def test_in_virtual_pace_a_slow_reader_holds_the_board_back_and_loses_nothing(emulated):
    cycles, slots = 30, 180
    board = emulated(exposures=True)
    board.stage.readline()  # hello
    link = board.plug()
    link.play(paper_program(cycles, slots))
    time.sleep(2.0)  # nobody reads: the board, some ten seconds ahead otherwise, has to stop
    seen, ticks = [], []
    while len(seen) < cycles * slots:
        message = json.loads(board.stage.readline())
        ticks.append(message.get("tick", 0))
        if message["type"] == "exposure":
            seen.append(message["n"])
    assert seen == list(range(cycles * slots))
    done = threading.Thread(target=lambda: [board.stage.readline() for _ in range(100_000)], daemon=True)
    done.start()
    assert link.wait_until([wire.DONE, wire.FAULT])["fault"] == 0
    assert board.stop()["dropped"] == 0


def test_a_board_that_is_held_back_still_answers(emulated):
    board = emulated(exposures=True)
    link = board.plug()
    link.play(paper_program(cycles=0))
    time.sleep(1.0)
    before = link.status()["triggers_fired"]
    time.sleep(0.5)
    after = link.status()["triggers_fired"]
    # Nobody reads exposures: the board moves by what the answer needs, 50 ms at most, and no further.
    assert 0 <= after - before <= 0.05 * 125_000_000 / PERIOD_TICKS + 1


def test_in_wall_pace_the_board_is_not_faster_than_the_clock_and_counts_what_nobody_took(emulated):
    slots = 540
    board = emulated("--pace", "wall", exposures=True)
    link = board.plug()
    link.load(paper_program(cycles=4, slots=slots))
    link.arm()
    begin = time.monotonic()
    link.ask(wire.START)
    status = link.wait_until([wire.DONE, wire.FAULT])
    wall_s = time.monotonic() - begin
    assert status["fault"] == 0
    # The board may catch up with 5 ms of the clock, and no more, however busy this machine is; and it looks at the clock after
    # each slice of 1 ms, with a timer that may ring 1 ms early.
    assert wall_s >= 4 * slots * PERIOD_TICKS * 8e-9 - 0.007
    assert board.stop()["dropped"] > 0  # the stream was never read


def test_in_wall_pace_a_board_that_was_stopped_for_a_while_stays_late_and_says_so(emulated):
    cycles, slots, stopped_s = 2, 540, 0.6
    board = emulated("--pace", "wall")
    link = board.plug()
    link.load(paper_program(cycles, slots))
    link.arm()
    begin = time.monotonic()
    link.ask(wire.START)
    board.process.send_signal(signal.SIGSTOP)
    time.sleep(stopped_s)
    board.process.send_signal(signal.SIGCONT)
    assert link.wait_until([wire.DONE, wire.FAULT])["fault"] == 0
    assert time.monotonic() - begin >= cycles * slots * PERIOD_TICKS * 8e-9 + stopped_s - 0.01
    assert board.stop()["wall_late_us"] >= (stopped_s - 0.01) * 1e6
    assert "behind the wall clock by" in board.log
