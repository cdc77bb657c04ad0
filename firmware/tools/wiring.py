#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""What the wiring of docs/hardware.md comes to at worst, reckoned from its values and the datasheets' limits: its tables of
figures.

usage: wiring.py                 prints the tables
       wiring.py --write FILE    brings the tables in FILE up to date
"""
import math
import sys
from pathlib import Path

# RP2040 datasheet 5.5.3.4, digital IO at 3.3 V: thresholds, and the worst output voltage at the nominal current of a drive
# strength, which gives an output's resistance at worst.
IOVDD, VIH, VIL, VOH_MIN, VOL_MAX = 3.3, 2.0, 0.8, 2.62, 0.5
PULL_DOWN_OHM = (50e3, 80e3)
LINE_OHM = 100  # a twisted pair, or a ribbon with a ground beside each signal
NS_PER_M, PF_PER_M = 5, 100
RESISTOR, CAPACITOR, X7R = 0.01, 0.05, 0.10  # tolerances


def pad_ohm(drive_ma):
    """An output's resistance while high and while low, at most."""
    return (IOVDD - VOH_MIN) / drive_ma * 1e3, VOL_MAX / drive_ma * 1e3


def first_step(drive_ma, series_ohm, line_ohm=LINE_OHM):
    """What pad and open far end have after a rise, and the pad after a fall, in volts, before the echo comes back: pad and
    series resistor divide with the line's impedance; an open end has twice the wave (reflection 1)."""
    high, low = pad_ohm(drive_ma)
    wave = IOVDD * line_ohm / (high + series_ohm + line_ohm)
    return wave * (series_ohm + line_ohm) / line_ohm, 2 * wave, IOVDD * low / (low + series_ohm + line_ohm)


def parallel(*ohms):
    return 1 / sum(1 / ohm for ohm in ohms)


def input_level(pull_down_ohm, *series_ohm):
    """At an input that a resistance pulls down and 3.3 V reach through others; at least, the pad's own pull-down helping."""
    down = parallel(pull_down_ohm * (1 - RESISTOR), PULL_DOWN_OHM[0])
    return IOVDD * down / (down + sum(series_ohm) * (1 + RESISTOR))


def fall_us(pull_down_ohm, series_ohm, farad, cable_m):
    """From an opened contact to the pad's low: earliest at VIH, latest at VIL; t = R C ln(V / threshold)."""
    times = []
    for sign, pad, metres, threshold in ((-1, PULL_DOWN_OHM[0], 0, VIH), (1, PULL_DOWN_OHM[1], cable_m, VIL)):
        down = parallel(pull_down_ohm * (1 + sign * RESISTOR), pad)
        level = IOVDD * down / (down + series_ohm * (1 - sign * RESISTOR))
        charged = farad * (1 + sign * CAPACITOR) + metres * PF_PER_M * 1e-12
        times.append(down * charged * math.log(level / threshold) * 1e6)
    return tuple(times)


LOOP_OHM, LOOP_VOLTS, LED_VOLTS = 2200, (19.2, 24, 30), (1.4, 1.2, 1.1)  # IEC 61131-2's 24 V; PC817


def loop_ma():
    """The 24 V loop's current: least, nominal, most."""
    return tuple((volts - led) / (LOOP_OHM * (1 + sign * RESISTOR)) * 1e3
                 for volts, led, sign in zip(LOOP_VOLTS, LED_VOLTS, (1, 0, -1)))


# The charge pump: 74AHCT541 at 5 V (5 %, VOH 0.1 V below at light load), two BAT54 (0.32 V at 1 mA, 0.15 V at a few uA),
# BSS138 (threshold 0.5 to 1.5 V).
PUMP_FARAD, HOLD_FARAD, HOLD_OHM = 1.1e-6, 150e-9, 100e3
PUMP_VOLTS = (4.75 - 0.1 - 2 * 0.32, 5.25 - 2 * 0.15)
GATE_OFF, GATE_ON = 0.5, 2.5


def pump_least(period_s):
    """The gate's voltage just before a pulse, at least: each rise shares the pump capacitor's charge with the hold capacitor,
    which then discharges for a period. v = a d (r + (1 - r) v), with d the decay and r the share."""
    share = PUMP_FARAD * (1 - X7R) / (PUMP_FARAD * (1 - X7R) + HOLD_FARAD * (1 - X7R))
    decay = math.exp(-period_s / (HOLD_OHM * (1 - RESISTOR) * HOLD_FARAD * (1 - X7R)))
    return PUMP_VOLTS[0] * share * decay / (1 - (1 - share) * decay)


def pump_off_ms():
    """From the last pulse until the gate is below any threshold, at most."""
    tau = HOLD_OHM * (1 + RESISTOR) * HOLD_FARAD * (1 + X7R)
    return tau * math.log(PUMP_VOLTS[1] / GATE_OFF) * 1e3


CAN_QUANTA = {'propagation': 4, 'all': 8}
LOOP_DELAY_NS = 150


def can_metres(kbit_s, loop_ns=LOOP_DELAY_NS):
    """Twice cable and transceiver loop within the propagation segment."""
    segment_ns = 1e6 / kbit_s * CAN_QUANTA['propagation'] / CAN_QUANTA['all']
    return max(0, (segment_ns / 2 - loop_ns) / NS_PER_M)


def steps_table():
    yield '| drive, series resistor | pad after a rise (2.0 V is high) | open far end after a rise | pad after a fall (0.8 V is low) |'
    yield '| --- | --- | --- | --- |'
    for drive_ma, series_ohm in ((4, 0), (12, 0), (12, 33), (12, 47)):
        rise, far, fall = first_step(drive_ma, series_ohm)
        yield f'| {drive_ma} mA, {series_ohm} ohm | {rise:.2f} V | {far:.2f} V | {fall:.2f} V |'


def inputs_table():
    rc = fall_us(4700, 660, 1e-9, 3)
    opto = fall_us(470, 0, 1e-9, 0)
    least, nominal, most = loop_ma()
    yield '| figure | formula | value |'
    yield '| --- | --- | --- |'
    yield f'| ESTOP high through a dry contact | 3.3 V x R / (R + 330 + 330), R = 4.7 k and the pad\'s 50 k | {input_level(4700, 330, 330):.2f} V at least |'
    yield f'| current of a dry contact | 3.3 V / (4.7 k + 660) | {IOVDD / 5360 * 1e3:.1f} mA |'
    yield f'| contact open to pad low, 1 nF | R C ln(V / 2.0 V) to R (C + 3 m x 100 pF/m) ln(V / 0.8 V) | {rc[0]:.1f} to {rc[1]:.1f} us |'
    yield f'| 24 V loop, 2.2 k | (U - LED) / R for 19.2, 24 and 30 V | {least:.1f}, {nominal:.1f}, {most:.1f} mA |'
    yield f'| its resistor\'s power | I I R at 30 V | {most * most * LOOP_OHM * (1 - RESISTOR) / 1e6:.2f} W |'
    yield f'| behind the optocoupler, 470 ohm and 1 nF | R C ln(V / threshold) | {opto[0]:.1f} to {opto[1]:.1f} us |'
    yield f'| open-drain line, 1 k at the far end | 3.3 V x R / (R + 1 k + 330) | {input_level(4700, 1000, 330):.2f} V at least |'
    yield f'| the same with 10 k | 3.3 V x R / (R + 10 k + 330) | {input_level(4700, 10000, 330):.2f} V: a stop for ever |'


def pump_table():
    yield '| figure | formula | value |'
    yield '| --- | --- | --- |'
    yield f'| gate with a change each 2.5 ms | a r d / (1 - (1 - r) d): a = {PUMP_VOLTS[0]:.2f} V, r = C1 / (C1 + C2), d = exp(-5 ms / R C2) | {pump_least(5e-3):.2f} V at least |'
    yield f'| last change to gate off | R C2 ln({PUMP_VOLTS[1]:.2f} V / {GATE_OFF} V) | {pump_off_ms():.0f} ms at most |'
    yield '| gate at a constant level | no charge through C1 | 0 V after the same time |'


def can_table():
    yield '| bit rate | propagation segment | bus with loops of 150 ns | with 200 ns | with ISO 11898-2\'s 255 ns |'
    yield '| --- | --- | --- | --- | --- |'
    for kbit_s in (1000, 500):
        lengths = ' | '.join(f'{can_metres(kbit_s, loop):.0f} m' for loop in (150, 200, 255))
        yield f'| {kbit_s} kbit/s | {1e6 / kbit_s / 2:.0f} ns | {lengths} |'


TABLES = {'steps': steps_table, 'inputs': inputs_table, 'pump': pump_table, 'can': can_table}


def with_tables(text):
    """`text` with what is between each table's marks made anew."""
    for name, made in TABLES.items():
        begin, end = f'<!-- wiring {name}: made by firmware/tools/wiring.py -->\n', f'<!-- end of wiring {name} -->\n'
        before, found, rest = text.partition(begin)
        _, closed, after = rest.partition(end)
        if not found or not closed:
            raise SystemExit(f'no place for the table "{name}": put {begin.strip()} and {end.strip()} on lines of their own')
        text = before + begin + '\n'.join(made()) + '\n' + end + after
    return text


def main(arguments):
    if arguments[:1] == ['--write'] and len(arguments) == 2:
        path = Path(arguments[1])
        path.write_text(with_tables(path.read_text(encoding='utf-8')), encoding='utf-8')
    elif not arguments:
        for name, made in TABLES.items():
            print(f'{name}\n' + '\n'.join(made()) + '\n')
    else:
        raise SystemExit(__doc__)


if __name__ == '__main__':
    main(sys.argv[1:])
