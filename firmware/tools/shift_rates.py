#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""How fast patterns go out to drivers of 10, 20 and 30 MHz, reckoned from the ticks that pulse.pio's loop takes, as the
Makefile's DRIVER_MHZ has it: the table of docs/hardware.md.

usage: shift_rates.py [CHAIN_BITS]        prints the table
       shift_rates.py --write FILE        brings the table in FILE up to date
"""
import re
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
import pioasm  # noqa: E402

FIRMWARE = Path(__file__).resolve().parents[1]
TICK_NS = 8
DRIVERS_MHZ = (10, 20, 30)
# slot_times.h and events.h: latch, the shortest wait, the end of a cycle.
GAP_TICKS = 12 + 8 + 8
BEGIN, END = '<!-- rates: made by firmware/tools/shift_rates.py -->\n', '<!-- end of rates -->\n'


def costs(driver_mhz):
    """What pulse.pio says that its steps take, by name, in ticks, in a build for these drivers."""
    makefile = (FIRMWARE / 'Makefile').read_text(encoding='utf-8')
    replaced = re.search(rf'^PULSE_DEFINES_{driver_mhz} := (.*)$', makefile, re.M)[1]
    replaced = {name: int(value) for name, value in (define.split('=') for define in replaced.split())}
    programs = pioasm.parse((FIRMWARE / 'pulse.pio').read_text(encoding='utf-8'), replaced)
    return {name: value for program in programs for name, value in program.defines.items()}


def shift_ticks(chain_bits, divider, driver_mhz=20):
    """As slot_shift_ticks of slot_times.c: from a pattern's light to the next one being in the chain."""
    cost = costs(driver_mhz)
    words = -(-chain_bits // 32)
    shifter = (cost['SHIFTER_START_TICKS'] + (cost['SHIFTER_LOW_TICKS'] + cost['SHIFTER_HIGH_TICKS']) * chain_bits +
               cost['SHIFTER_WORD_TICKS'] * words + 1)
    return cost['TIMELINE_SHIFT_DELAY_TICKS'] + divider * shifter


def rates(chain_bits):
    """(driver's MHz, our MHz, DATA set-up ns, CLK high ns, us a pattern, ticks of the shortest slot) for each driver."""
    for driver_mhz in DRIVERS_MHZ:
        low_ticks, high_ticks = (costs(driver_mhz)[f'SHIFTER_{level}_TICKS'] for level in ('LOW', 'HIGH'))
        ticks = shift_ticks(chain_bits, 1, driver_mhz)
        yield (driver_mhz, 1000 / ((low_ticks + high_ticks) * TICK_NS), low_ticks * TICK_NS, high_ticks * TICK_NS,
               ticks * TICK_NS / 1000, ticks + GAP_TICKS)


def table(chain_bits):
    lines = ['| `DRIVER_MHZ` | CLK | DATA set up | CLK high | a pattern takes | shortest slot | on/off slots a second |',
             '| --- | --- | --- | --- | --- | --- | --- |']
    lines += [f'| {driver} | {mhz:.1f} MHz | {setup} ns | {high} ns | {us:.2f} us | {slot_ticks} ticks | '
              f'{int(1e9 / TICK_NS / slot_ticks)} |' for driver, mhz, setup, high, us, slot_ticks in rates(chain_bits)]
    return '\n'.join(lines) + '\n'


def with_table(text, chain_bits):
    before, _, rest = text.partition(BEGIN)
    return before + BEGIN + table(chain_bits) + END + rest.partition(END)[2]


def main(arguments):
    if arguments[:1] == ['--write'] and len(arguments) == 2:
        path = Path(arguments[1])
        path.write_text(with_table(path.read_text(encoding='utf-8'), 176), encoding='utf-8')
    elif len(arguments) <= 1 and (not arguments or arguments[0].isdigit()):
        print(table(int(arguments[0]) if arguments else 176), end='')
    else:
        raise SystemExit(__doc__)


if __name__ == '__main__':
    main(sys.argv[1:])
