# SPDX-License-Identifier: MIT
# The programs of pulse.pio on PyPI rp2040-pio-emulator, cycle by cycle, fed with the words that the firmware makes. That
# emulator knows one machine and no flags, no STATUS and no base for MOV PINS: instructions that need them are replaced by
# ones that take the same time and wait for, or set, pins of our own; flags go from machine to machine here.
import bisect
import collections
import importlib.util
import re
import subprocess

import pioemu
from pioemu.shift_register import ShiftRegister

from ols_board import wire
from ols_board.board import ROOT

CHAIN_BITS = 176
PHOTO_PIN = 28
FLAG_PIN = 31  # where a machine sees the flag that it waits for
TIMELINE_PINS, SHIFTER_PINS = 0xFF << 4, 0b11 << 2
NAMES = {2: "DATA", 3: "CLK", 4: "LATCH", 5: "LIGHT_EN", 6: "TRIG0", 7: "TRIG1", 8: "TRIG2", 9: "TRIG3", 10: "SYNC"}


def _assembler():
    spec = importlib.util.spec_from_file_location("pioasm", ROOT / "firmware/tools/pioasm.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def programs():
    """{name: program} of pulse.pio, each line's instruction replaced where the oracle does not know it."""
    found = _assembler().parse((ROOT / "firmware/pulse.pio").read_text(encoding="utf-8"), {})
    for program in found:
        program.flag_lines = {}  # address: flag that is raised there
        program.wait_lines = {}  # address: flag that is waited for there, and lowered
        program.lines = [(number, _replace(program, at, text)) for at, (number, text) in enumerate(program.lines)]
    return {program.name: program for program in found}


def _replace(program, address, text):
    if match := re.match(r"wait 1 irq (\d)", text):
        program.wait_lines[address] = int(match[1])
        return text.replace(match[0], f"wait 1 pin {FLAG_PIN}")
    if match := re.match(r"irq (wait )?(\d)", text):
        program.flag_lines[address] = int(match[2])
        program.labels[f"stay{address}"] = address
        return text.replace(match[0], f"jmp stay{address}" if match[1] else "nop")
    text = text.replace("mov y, status", "mov y, null")  # the FIFO always holds a pattern here
    return text.replace("mov pins, ~null", "set pins, 1").replace("mov pins, null", "set pins, 0")


def cycle_words(program, directory):
    """The timeline's words for one cycle of a program (program.py), made by the firmware's own compiler of them."""
    tool, firmware = directory / "timeline_words", ROOT / "firmware"
    if not tool.exists():
        sources = [firmware / f"{name}.c" for name in ("sequence", "slot_times", "events", "light_limits", "text")]
        subprocess.run(["cc", "-std=c11", "-I", firmware, "-I", ROOT / "protocol", "-I", ROOT / "build/firmware/pico",
                        ROOT / "tests/hil/ols_board/timeline_words.c", *sources, "-o", tool], check=True)
    data = wire.program_bytes(program)
    answer = subprocess.run([tool], input=wire.load_begin(program, data) + data, capture_output=True)
    assert answer.returncode == 0, answer.stderr.decode()
    return [int(line, 16) for line in answer.stdout.split()]


class Flags:
    """Interrupt flags of one block: raised in a tick, seen from the next one on (RP2040 datasheet 3.2.7)."""

    def __init__(self):
        self.raised = {}  # flag: tick

    def seen(self, flag, tick):
        return flag in self.raised and self.raised[flag] < tick


class Machine:
    """One of the programs at work. `inputs(tick)` are the levels of its input pins as they are at the pads."""

    def __init__(self, program, flags, pins, inputs=lambda tick: 0, **options):
        self.program, self.flags, self.pins = program, flags, pins
        self.edges = []  # (tick, levels of its pins)
        self.clock, self.counter = options["initial_state"].clock, options["initial_state"].program_counter

        def sees(tick: int) -> int:
            waits_for = program.wait_lines.get(self.counter)
            flag = waits_for is not None and flags.seen(waits_for, tick)
            return inputs(tick - 2) | flag << FLAG_PIN  # two ticks in the synchroniser (3.5.6.3)

        self.steps = pioemu.emulate(program.assemble(), stop_when=lambda *_: False, input_source=sees,
                                    wrap_target=program.wrap_target, wrap_top=program.wrap, **options)

    def step(self):
        before, after = next(self.steps)
        at = before.program_counter
        if at in self.program.flag_lines:
            self.flags.raised.setdefault(self.program.flag_lines[at], before.clock)
        if at in self.program.wait_lines and after.program_counter != at:
            del self.flags.raised[self.program.wait_lines[at]]
        levels = after.pin_values & self.pins
        if levels != (self.edges[-1][1] if self.edges else 0):
            self.edges.append((before.clock + 1, levels))
        self.clock, self.counter = after.clock, after.program_counter
        self.isr = after.input_shift_register.contents


def play(program, words, genlock_tick=None):
    """{signal: [(tick, level)]} of a whole program, on timeline and shifter together, from arming on."""
    made, flags = programs(), Flags()
    patterns = [word for slot in program["slots"] for bits in wire.patterns(slot) for word in wire.pattern_words(bits)]
    shifter = Machine(
        made["shifter"], flags, SHIFTER_PINS, out_base=2, out_count=1, side_set_base=3, side_set_count=1,
        shift_osr_right=False,
        initial_state=pioemu.State(pin_directions=SHIFTER_PINS, input_shift_register=ShiftRegister(CHAIN_BITS - 1, 0),
                                   transmit_fifo=collections.deque(patterns * (program["cycles"] + 1))))
    flags.raised[4] = 0  # arming sends the first pattern
    while 5 not in flags.raised:
        shifter.step()
    del flags.raised[5]
    labels = made["timeline"].labels
    timeline = Machine(
        made["timeline"], flags, TIMELINE_PINS, lambda tick: int(genlock_tick is not None and tick >= genlock_tick),
        out_base=4, out_count=8,
        initial_state=pioemu.State(clock=3000, pin_directions=TIMELINE_PINS, y_register=program["cycles"] - 1,
                                   program_counter=labels["next" if genlock_tick is None else "genlock"],
                                   transmit_fifo=collections.deque(words * program["cycles"])))
    while not {0, 1} & flags.raised.keys():  # starved, or all played
        min(timeline, shifter, key=lambda machine: machine.clock).step()
    assert 1 in flags.raised, "the timeline starved"
    return {**_signals(timeline), **_signals(shifter)}


def _signals(machine):
    """The changes of each of a machine's pins, by name."""
    signals, last = {name: [] for pin, name in NAMES.items() if machine.pins >> pin & 1}, 0
    for tick, levels in machine.edges:
        for pin, name in NAMES.items():
            if (levels ^ last) >> pin & 1:
                signals[name].append((tick, levels >> pin & 1))
        last = levels
    return signals


def debounce(debounce_ticks, genlock, end_tick):
    """The receptor, given the ticks at which GENLOCK changes, low before: the ticks at which PHOTO changes, and how many
    words are pushed."""
    program, flags = programs()["receptor"], Flags()
    push = next(address for address, (_, text) in enumerate(program.lines) if text.startswith("push"))
    receptor = Machine(
        program, flags, 1 << PHOTO_PIN, lambda tick: bisect.bisect_right(genlock, tick) % 2,
        set_base=PHOTO_PIN, set_count=1, jmp_pin=0,
        initial_state=pioemu.State(pin_directions=1 << PHOTO_PIN, y_register=(debounce_ticks - 4) // 2,
                                   program_counter=program.labels["high"]))
    pushed = 0
    while receptor.clock < end_tick:
        pushed += receptor.counter == push
        receptor.step()
    return [tick for tick, _ in receptor.edges], pushed
