# SPDX-License-Identifier: MIT
# Playing until something stops it, again and again, and reading from the trace when it was dark.
import re

import check_trace
from ols_board import wire
from ols_board.board import BoardError

MS = 125_000  # ticks
LIT = ("LIGHT_EN", *check_trace.TRIGGERS, "SYNC", "LATCH")


def injected(board, names):
    """(tick, name) of the injections that the board's log tells of."""
    found = re.findall(r"injected at tick (\d+): (\w+)", board.log)
    return [(int(tick), name) for tick, name in found if name in names]


def levels_after(changes, tick):
    """Level of each pin at the end of `tick`."""
    level = {}
    for at, name, value in changes:
        if at > tick:
            break
        level[name] = value
    return level


def last_change_before(changes, begin, end):
    return max((at for at, name, _ in changes if name in LIT and begin <= at < end), default=begin)


def wait_for_fault(link):
    """Lets board time pass, without asking for more than a status each 5 ms, until the board tells of a fault."""
    for _ in range(1000):
        link.usb.read(timeout_us=5_000)  # nothing comes
        status = link.status()
        if status["state"] == wire.FAULT:
            return status
        assert status["state"] == wire.PLAYING, status
    raise TimeoutError("the board goes on playing")


def clear(link):
    status = link.status()
    link.ask(wire.CLEAR_FAULT)
    return status


def play_until_stopped(link, program):
    """Plays until a fault, clears it, and returns the status that told of it."""
    while True:
        try:
            link.play(program)
            break
        except BoardError as refused:  # still pressed, or pressed just now
            if refused.code == wire.ERROR_FAULT_LATCHED:
                return clear(link)
            assert refused.code == wire.ERROR_NOT_SAFE, refused
    wait_for_fault(link)
    return clear(link)
