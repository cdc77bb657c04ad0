# SPDX-License-Identifier: MIT
"""Each scenario over each of its links: no trigger has a wrong account, and the faults were there to be named."""
import pathlib
import tomllib

import pytest

from matrix import links_of, play, scenarios
from verdicts import DONE

PAIRS = [(path, link) for path in scenarios() for link in links_of(path)]


@pytest.mark.parametrize("path, link", PAIRS, ids=lambda value: value.stem if isinstance(value, pathlib.Path) else value)
def test_every_trigger_has_its_frame_or_the_cause_that_was_injected(path, link):
    takes = play(path, link)
    assert [line for take in takes for line in take.wrong] == []
    scenario = tomllib.loads(path.read_text())
    assert len(takes) == scenario.get("takes", 1)
    named = sum(counts["right"] for take in takes for counts in take.tally.values())
    injected = sum(counts["injected"] for take in takes for counts in take.tally.values())
    # No light is told of by landmarks alone: of a spell that falls between two of them nothing can be said.
    assert injected >= sum(fault["count"] for fault in scenario.get("fault", [])) and named >= 0.8 * injected


def test_each_cause_is_injected_a_thousand_times_on_every_link():
    injected = {}
    for path in scenarios():
        scenario = tomllib.loads(path.read_text())
        for link in scenario["links"]:
            for fault in scenario.get("fault", []):
                injected[fault["kind"], link] = injected.get((fault["kind"], link), 0) + fault["count"]
            for stall in scenario.get("stall", []):
                injected[stall["of"], link] = injected.get((stall["of"], link), 0) + stall["episodes"] * stall["frames"]
    for kind in ("miss_trigger", "lose_frame", "host", "disk", "no_light", "stale_buffer"):
        assert kind in DONE
        for link in ("ring", "gige", "v4l2"):
            assert injected[kind, link] >= 1000, (kind, link)
