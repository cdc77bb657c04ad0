#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Plays the paper's cycle on a board and prints what the board measured: for checking a real one with a logic analyser
(docs/hardware.md).

usage: play.py usb:[SERIAL] [--cycles N] [--slots N] [--genlock] [--print]
"""
import argparse
from collections import Counter

from ols_board import wire
from ols_board.program import paper_program
from ols_board.usb_board import UsbBoard


def play(link, program, start):
    """Plays to the end; returns every trigger's (tick, slot) and how many were lost."""
    link.load(program)
    link.arm(start=start)
    link.ask(wire.START)
    rises, lost = [], 0
    while True:
        state = link.status()["state"]
        entries, lost = link.trigger_log(len(rises) + lost)
        rises += [(tick, slot) for tick, _, _, slot, _, _ in entries]
        if state not in (wire.PLAYING, wire.WAITING):
            return rises, lost


def report(link, rises, lost):
    periods = Counter(b - a for (a, _), (b, _) in zip(rises, rises[1:]))
    status = link.status()
    print(f"{len(rises)} triggers measured, {lost} lost; fault: {wire.FAULTS[status['fault']]}")
    for ticks, count in sorted(periods.items()):
        print(f"{count} periods of {ticks} ticks = {ticks * 8 / 1000:.3f} us (measured every second tick)")


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("board", help="usb: or usb:SERIAL")
    parser.add_argument("--cycles", type=int, default=1)
    parser.add_argument("--slots", type=int, default=180)
    parser.add_argument("--genlock", action="store_true", help="start at the next rise of GENLOCK")
    parser.add_argument("--print", action="store_true", help="print each slot's bytes as they are shifted out")
    options = parser.parse_args()
    program = paper_program(options.cycles, options.slots)
    if options.print:
        for n, slot in enumerate(program["slots"]):
            print(f"slot {n:4}: {int(''.join(map(str, slot['bits'])), 2):044x}")
    link = UsbBoard(options.board.removeprefix("usb:")).plug()
    report(link, *play(link, program, wire.BY_EDGE if options.genlock else wire.BY_COMMAND))


if __name__ == "__main__":
    main()
