#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""How fast patterns go out to drivers of 10, 20 and 30 MHz, reckoned from the ticks that pulse.pio's loop takes: the table
of docs/hardware.md.

usage: shift_rates.py [CHAIN_BITS]        prints the table
       shift_rates.py --write FILE        brings the table in FILE up to date
"""
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
import pioasm  # noqa: E402

PULSE_PIO = Path(__file__).resolve().parents[1] / 'pulse.pio'
TICK_NS = 8
DRIVERS_MHZ = (10, 20, 30)
# slot_times.h and events.h: latch, the shortest wait, the end of a cycle.
GAP_TICKS = 12 + 8 + 8
BEGIN, END = '<!-- rates: made by firmware/tools/shift_rates.py -->\n', '<!-- end of rates -->\n'


def costs():
    """What pulse.pio says that its steps take, by name, in ticks."""
    return {name: value for program in pioasm.parse(PULSE_PIO.read_text(encoding='utf-8')) for name, value in program.defines}


def shift_ticks(chain_bits, divider):
    """As slot_shift_ticks of slot_times.c: from a pattern's light to the next one being in the chain."""
    cost = costs()
    words = -(-chain_bits // 32)
    shifter = (cost['SHIFTER_START_TICKS'] + cost['SHIFTER_BIT_TICKS'] * chain_bits +
               cost['SHIFTER_WORD_TICKS'] * words + 1)
    return cost['TIMELINE_SHIFT_DELAY_TICKS'] + divider * shifter


def rates(chain_bits):
    """(driver's MHz, divider, our MHz, DATA set-up ns, CLK high ns, us a pattern, slots a second) for each driver."""
    bit_ticks = costs()['SHIFTER_BIT_TICKS']
    for driver_mhz in DRIVERS_MHZ:
        # MHz of a bit are 1000 / (ticks x 8 ns x divider).
        divider = next(d for d in range(1, 100) if 1000 / (bit_ticks * TICK_NS * d) <= driver_mhz)
        ticks = shift_ticks(chain_bits, divider)
        low_ticks = 4  # of a bit: `out` with its delay; then CLK is high
        yield (driver_mhz, divider, 1000 / (bit_ticks * TICK_NS * divider), low_ticks * TICK_NS * divider,
               (bit_ticks - low_ticks) * TICK_NS * divider, ticks * TICK_NS / 1000,
               int(1e9 / TICK_NS / (ticks + GAP_TICKS)))


def table(chain_bits):
    lines = ['| drivers of | `divider` | CLK | DATA set up | CLK high | a pattern takes | on/off slots a second |',
             '| --- | --- | --- | --- | --- | --- | --- |']
    lines += [f'| {driver} MHz | {divider} | {mhz:.1f} MHz | {setup} ns | {high} ns | {us:.2f} us | {slots} |'
              for driver, divider, mhz, setup, high, us, slots in rates(chain_bits)]
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
