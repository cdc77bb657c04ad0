#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Bounds the time from an interrupt of priority 0 to the dark by counting instructions of stage.elf.

usage: count_cycles.py stage.elf

Follows every path of the disassembly with the cycles of the Cortex-M0+ (TRM 3.3); each load and store costs what it does at
worst, a write over the APB bridge (RP2040 datasheet 2.1.4) after a turn for DMA. A handler may have to wait for the longest
stretch with interrupts held and for every other handler, as far as those do not stop themselves. Prints one line a handler,
and exits with 1 if one may take more than 10 us.
"""
import re
import subprocess
import sys
from functools import lru_cache

TICKS_PER_US = 125
ACCESS_CYCLES = 2 + 3 + 1  # TRM 3.3; the bridge; DMA
ENTRY_CYCLES = 15 + 8  # TRM 3.4.1, and a turn for DMA at each of the eight words stacked
EXIT_CYCLES = 13 + 8
# How often a loop's body runs at most, by function; any other loop is an error, so that none is overlooked.
LOOPS = {
    "board_dark": 10,  # the chain's and the timeline's pins
    "board_connect_pins": 10,
    "prepare_dark": 10,
    "board_time_us": 2,  # the timer's upper half changes once in 71 minutes
    "interrupt_stop_inputs": 3,  # inputs
}
HANDLERS = ("interrupt_tick", "interrupt_heartbeat", "interrupt_usb", "interrupt_player", "interrupt_light",
            "interrupt_stop_inputs")
STOP, DARK = "stop_now", "board_dark"
HOLD, RELEASE = "board_hold_interrupts", "board_release_interrupts"
NOTHING_IS_LIT = ("stop_now", "stop_connect_pins")  # while these hold interrupts: it is dark already, or still
NEVER = float("-inf")


def read_functions(elf):
    """{name: {address: (mnemonic, operands)}}"""
    text = subprocess.run(["arm-none-eabi-objdump", "-d", "--no-show-raw-insn", elf], capture_output=True, text=True,
                          check=True).stdout
    functions, code = {}, {}
    for line in text.splitlines():
        if match := re.match(r"[0-9a-f]+ <([\w.]+)>:", line):
            code = functions.setdefault(match[1], {})
        elif match := re.match(r"\s*([0-9a-f]+):\s+([a-z]\w*)(?:\.\w+)?\s*([^@;]*)", line):
            code[int(match[1], 16)] = (match[2], match[3].strip())
    return functions


def cycles_of(mnemonic, operands):
    if mnemonic in ("push", "pop", "ldmia", "stmia"):
        spans = re.findall(r"(?:(\d+)-r(\d+))|(?:r\d+|lr|pc)", operands[operands.index("{"):])
        words = sum(int(last) - int(first) + 1 if first else 1 for first, last in spans)
        return 1 + 2 * words + (3 if "pc" in operands else 0)
    if mnemonic.startswith(("ldr", "str")):
        return ACCESS_CYCLES
    if mnemonic in ("bl", "mrs", "msr"):
        return 3
    return 2 if mnemonic.startswith("b") and mnemonic not in ("bics",) else 1


class Counter:
    """Longest paths. `stops`: None counts a function to its return; True, until it is dark, and a path that does not come
    there does not count; False, to its return, and a path that stops does not count."""

    def __init__(self, functions):
        self.functions = functions

    @lru_cache(None)
    def longest(self, name, stops=None, begin=None):
        """From the address `begin` on, to the call of RELEASE; without it, of the whole function."""
        code = self.functions[name]
        order = sorted(code)
        following = dict(zip(order, order[1:]))

        @lru_cache(None)
        def walk(at, laps):
            mnemonic, operands = code[at]
            own = cycles_of(mnemonic, operands)
            target = re.match(r"([0-9a-f]+) <([\w.]+)", operands)
            if mnemonic == "bx" or (mnemonic == "pop" and "pc" in operands):
                return NEVER if stops else own
            if mnemonic == "bl" or (mnemonic == "b" and int(target[1], 16) not in code):
                if begin and target[2] == RELEASE:
                    return own + self.longest(RELEASE)
                if target[2] == DARK and stops:
                    return own + self.longest(DARK)
                if target[2] == STOP and stops is not None:
                    return own + self.longest(STOP, True) if stops else NEVER
                rest = walk(following[at], laps) if mnemonic == "bl" else NEVER if stops else 0
                return own + self.longest(target[2]) + rest
            nexts = [] if mnemonic == "b" else [following[at]]
            if target and mnemonic.startswith("b"):
                nexts.append(int(target[1], 16))
            return own + max(walk(to, self.lap(name, at, to, laps)) if self.may(name, at, to, laps) else NEVER
                             for to in nexts)

        return walk(begin or order[0], ())

    def longest_held(self, name):
        """Cycles from a call of HOLD to that of RELEASE; 0 without one."""
        calls = [at for at, (mnemonic, operands) in self.functions[name].items()
                 if mnemonic == "bl" and f"<{HOLD}>" in operands]
        return max((self.longest(name, begin=at) for at in calls), default=0)

    @staticmethod
    def lap(name, at, to, laps):
        return tuple(sorted({**dict(laps), at: dict(laps).get(at, 0) + 1}.items())) if to <= at else laps

    @staticmethod
    def may(name, at, to, laps):
        """A jump back may be a loop, or the way to code that lies before."""
        times = dict(laps).get(at, 0)
        if to > at or times == 0:
            return True
        if name not in LOOPS:
            raise SystemExit(f"{name} has a loop at {at:x}: give LOOPS its bound, and the reason")
        return times < LOOPS[name] - 1


def bounds(elf):
    """{handler: cycles from its interrupt to the dark} for those that stop, and the longest held stretch."""
    counter = Counter(read_functions(elf))
    held = max(counter.longest_held(name) for name in counter.functions if name not in NOTHING_IS_LIT)
    passing = {name: ENTRY_CYCLES + counter.longest(name, False) + EXIT_CYCLES for name in HANDLERS
               if counter.longest(name, False) > NEVER}
    found = {}
    for name in HANDLERS:
        own = counter.longest(name, True)
        if own > NEVER:
            others = sum(cycles for other, cycles in passing.items() if other != name)
            found[name] = held + others + ENTRY_CYCLES + own
    return found, held


def main():
    if len(sys.argv) != 2:
        raise SystemExit(__doc__)
    found, held = bounds(sys.argv[1])
    print(f"interrupts held: at most {held} cycles, {held / TICKS_PER_US:.2f} us")
    for name, cycles in found.items():
        print(f"{name}: dark at most {cycles} cycles, {cycles / TICKS_PER_US:.2f} us, after its interrupt")
    return max(found.values()) > 10 * TICKS_PER_US


if __name__ == "__main__":
    sys.exit(main())
