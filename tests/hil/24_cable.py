# SPDX-License-Identifier: MIT
# The witness' tolerance on the real image: what the echo of the stated cable may do to an edge is no fault.
import pytest

from ols_board import wire
from ols_board.program import CHAIN_BITS, paper_program

PERIOD_TICKS = 100_000  # and a light of 1000: an upset between two lights moves the next trigger by its bit, in ticks
ECHO_TICKS = 4  # 3 m, there and back at 5 ns/m


def sparse_program():
    slots = [{"kind": wire.BASIS, "trigger_mask": 1, "exposure_ticks": 1000, "period_ticks": PERIOD_TICKS,
              "bits": [0] * CHAIN_BITS} for _ in range(18)]
    return {**paper_program(cycles=4, slots=18), "slots": slots}


def play(emulated, bit):
    """A bit of the timeline's counter flips in the dark after a trigger, so that all later ones are off by it; returns the
    fault, and how far each trigger of the log is from where its predecessor would have it."""
    link = emulated("--inject", f"upset:{bit}@trigger:12+40000").plug()
    link.play(sparse_program())
    status = link.wait_until([wire.DONE, wire.FAULT])
    entries, _ = link.trigger_log()
    return wire.FAULTS[status["fault"]], {abs(b[0] - a[0] - PERIOD_TICKS) for a, b in zip(entries, entries[1:])}


@pytest.mark.parametrize("bit, fault", [(2, "none"), (3, "slipped")])
def test_an_edge_that_is_off_by_the_cables_echo_passes_and_one_by_twice_that_is_a_fault(emulated, bit, fault):
    found, steps = play(emulated, bit)
    assert (found, steps) == (fault, {0, ECHO_TICKS << bit - 2})
