# SPDX-License-Identifier: MIT
"""The manual's wiring figures against circuits stepped through time: waves on a line, capacitors by small steps."""
import importlib.util
import math
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
spec = importlib.util.spec_from_file_location('wiring', ROOT / 'firmware/tools/wiring.py')
wiring = importlib.util.module_from_spec(spec)
spec.loader.exec_module(wiring)


def test_the_manuals_tables_are_those_of_the_values():
    manual = (ROOT / 'docs/hardware.md').read_text()
    assert manual == wiring.with_tables(manual), 'run: python3 firmware/tools/wiring.py --write docs/hardware.md'


def line(source_volts, source_ohm, series_ohm, metres, before_volts):
    """A line cut into 5 cm, a wave each way in every piece: yields (ns, pad, far end) with the far end open."""
    pieces, step_ns = round(metres / 0.05), 0.05 * wiring.NS_PER_M
    going, coming = [before_volts / 2] * pieces, [before_volts / 2] * pieces
    for n in range(4000):
        arriving, leaving = coming[0], going[-1]
        # At the board: v = wave in + wave out, the current (out - in) / Z comes through pad and series resistor.
        out = (source_volts * wiring.LINE_OHM + arriving * (source_ohm + series_ohm - wiring.LINE_OHM)) / (
            source_ohm + series_ohm + wiring.LINE_OHM)
        pad = source_volts - (out - arriving) / wiring.LINE_OHM * source_ohm
        yield n * step_ns, pad, 2 * leaving
        going = [out] + going[:-1]
        coming = coming[1:] + [leaving]


@pytest.mark.parametrize('drive_ma, series_ohm', [(4, 0), (12, 0), (12, 33), (12, 47)])
def test_until_the_echo_is_back_a_pad_stays_at_its_first_step(drive_ma, series_ohm):
    rise, far, fall = wiring.first_step(drive_ma, series_ohm)
    high_ohm, low_ohm = wiring.pad_ohm(drive_ma)
    metres, echo_ns = 3, 2 * 3 * wiring.NS_PER_M
    rising = list(line(wiring.IOVDD, high_ohm, series_ohm, metres, 0))
    falling = list(line(0, low_ohm, series_ohm, metres, wiring.IOVDD))
    assert {round(pad, 9) for ns, pad, _ in rising if ns < echo_ns} == {round(rise, 9)}
    assert {round(pad, 9) for ns, pad, _ in falling if ns < echo_ns} == {round(fall, 9)}
    assert next(end for ns, _, end in rising if end > 0) == pytest.approx(far)
    assert rising[-1][1] == pytest.approx(wiring.IOVDD) and falling[-1][1] == pytest.approx(0)


def test_only_the_chosen_drive_and_resistor_pass_both_thresholds_with_a_margin_before_the_echo():
    passes = {(drive, series): rise >= wiring.VIH and fall <= wiring.VIL - 0.05
              for drive, series in ((4, 0), (12, 0), (12, 33), (12, 47)) for rise, _, fall in [wiring.first_step(drive, series)]}
    assert passes == {(4, 0): False, (12, 0): False, (12, 33): False, (12, 47): True}


def test_a_contact_is_seen_open_when_the_stepped_capacitor_passes_the_thresholds():
    first_us, last_us = wiring.fall_us(4700, 660, 1e-9, 3)
    for low_us, pad, sign, farad, threshold in ((first_us, 50e3, -1, 0.95e-9, 2.0), (last_us, 80e3, 1, 1.05e-9 + 300e-12, 0.8)):
        down = 1 / (1 / (4700 * (1 + 0.01 * sign)) + 1 / pad)
        volts, us = 3.3 * down / (down + 660 * (1 - 0.01 * sign)), 0.0
        while volts > threshold:
            volts -= volts / down / farad * 1e-10
            us += 1e-4
        assert us == pytest.approx(low_us, abs=0.01)


def gate(changes_s, end_s, tau=None, pump_volts=wiring.PUMP_VOLTS[0]):
    """The gate's voltage after each 10 us; a rise at every second of `changes_s`."""
    pump, hold = 0.9 * wiring.PUMP_FARAD, 0.9 * wiring.HOLD_FARAD
    tau = tau or 0.99 * wiring.HOLD_OHM * hold
    rises, volts, found = list(changes_s[::2]), 0.0, []
    for n in range(round(end_s / 1e-5)):
        if rises and rises[0] <= n * 1e-5:
            rises.pop(0)
            volts = max(volts, (pump * pump_volts + hold * volts) / (pump + hold))
        volts -= volts * 1e-5 / tau
        found.append(volts)
    return found


def test_the_gate_stays_on_at_the_lowest_rate_and_a_constant_level_or_a_single_edge_does_not_hold_it():
    found = gate([n * 2.5e-3 for n in range(400)], 1.0)
    assert min(found[len(found) // 2 :]) == pytest.approx(wiring.pump_least(5e-3), rel=0.01)
    assert wiring.pump_least(5e-3) >= wiring.GATE_ON
    assert max(gate([], 0.1)) == 0 and gate([0], 0.1)[-1] < wiring.GATE_OFF


def test_the_gate_is_off_within_50_ms_of_the_last_change_with_the_relays_10():
    worst = 1.01 * wiring.HOLD_OHM * 1.1 * wiring.HOLD_FARAD
    volts, ms = wiring.PUMP_VOLTS[1], 0
    while volts > wiring.GATE_OFF:
        volts -= volts * 1e-5 / worst
        ms += 1e-2
    assert ms == pytest.approx(wiring.pump_off_ms(), abs=0.1)
    assert ms + 10 < 50


def test_a_far_end_pull_up_of_1_kohm_reads_high_and_one_of_10_kohm_does_not():
    assert wiring.input_level(4700, 1000, 330) > wiring.VIH > wiring.input_level(4700, 10_000, 330)
    # Kirchhoff: what comes through the series resistors goes through the pull-downs.
    level = wiring.input_level(4700, 1000, 330)
    assert (3.3 - level) / (1330 * 1.01) == pytest.approx(level / (4700 * 0.99) + level / 50e3)


def test_a_bus_of_20_metres_fits_1_mbit_and_40_fit_neither_four_nor_two_quanta():
    assert wiring.can_metres(1000) == 20
    assert 2 * (40 * 5 + 150) > 500 and 2 * (0 * 5 + 150) > 250
    assert math.isclose(wiring.can_metres(500), 70)
