# SPDX-License-Identifier: MIT
"""Faults that stamps, bits and optical code cannot see, on the virtual stage with the real firmware: pictures of basis slots that are
not theirs, and lamps that give less light. What the take says of them is held against the faults that were ordered."""
import numpy as np
import pytest

from test_faults import CYCLE, record
from virtual_take import manifest, read_lamps, slots_of

# 64 x 48 pixels: every one is looked at.
LOOK = ("--witness-step", 1)
BASIS = [slot for slot, one in enumerate(slots_of("s159")) if one["kind"] == "basis"]


def take(folder, faults, cycles=3, code=0):
    archive, report = record(folder, faults, basis="s159", cycles=cycles, code=code, run_options=LOOK)
    return manifest(archive)["extra"], report, archive


@pytest.fixture(scope="module")
def clean(tmp_path_factory):
    return take(tmp_path_factory.mktemp("clean") / "take", [])


def test_a_take_without_faults_is_not_suspect(clean):
    extra, report, _ = clean
    assert report["suspect_targets"] == 0 and report["suspect_lamps"] is None
    assert "suspect_targets" not in extra and "suspect_lamps" not in extra


def test_pictures_that_changed_places_under_right_stamps_are_named_and_left_out(tmp_path, clean):
    slot = BASIS[40]
    by = BASIS[47] - slot
    extra, report, archive = take(tmp_path / "take", [{"kind": "swap_pictures", "trigger": CYCLE + slot, "by": by}], code=2)
    assert report["slots_missing"] == 0, "no other witness sees it"
    assert report["suspect_targets"] == 1
    (suspect,) = extra["suspect_targets"]
    assert suspect["target"] == 1 and suspect["suspect"]["fault"] == "swapped"
    assert suspect["suspect"]["slots"] == [[slot, slot + by]] and suspect["taken_as_missing"] == [slot, slot + by]
    assert suspect["cause"] == "swapped" and report["slots_left_out"] == 2
    # Without the two the lamps are right: the noise of a target with two rows filled in is below twice the clean one's.
    truth, ours = read_lamps(clean[2], 0), read_lamps(archive, 1)
    noise = np.std(read_lamps(clean[2], 2) - truth)
    assert np.std(ours - truth) < 2 * noise


def test_the_light_of_another_slot_is_named(tmp_path):
    slot = BASIS[100]
    by = slot - BASIS[97]
    extra, report, _ = take(tmp_path / "take", [{"kind": "old_light", "trigger": CYCLE + slot, "by": by}])
    assert report["slots_missing"] == 0 and report["suspect_targets"] == 1
    (suspect,) = extra["suspect_targets"]
    assert suspect["target"] == 1
    assert [slot] in suspect["suspect"]["slots"]


@pytest.mark.parametrize("factor", [0.0, 0.5])
def test_a_lamp_that_dims_between_two_cycles_is_named_with_its_factor(tmp_path, factor, clean):
    lamp = brightest_lamp(clean[2])
    extra, report, _ = take(tmp_path / "take", [{"kind": "dim_lamp", "lamp": lamp, "factor": factor, "trigger": CYCLE}])
    (name,) = extra["suspect_lamps"]
    found = extra["suspect_lamps"][name]
    assert name == f"lamp_{lamp:03}" and found["since_first_target"] and found["first_target"] == 1
    assert abs(found["factor"] - factor) < 5 * found["spread"]
    assert report["suspect_lamps"] == extra["suspect_lamps"] and report["suspect_targets"] == 0


def test_a_lamp_that_is_dark_from_the_beginning_is_named_by_what_its_neighbours_foretell(tmp_path, clean):
    lamp = brightest_lamp(clean[2])
    extra, report, _ = take(tmp_path / "take", [{"kind": "dim_lamp", "lamp": lamp, "factor": 0.0, "trigger": 0}], cycles=1)
    (name,) = extra["suspect_lamps"]
    assert name == f"lamp_{lamp:03}" and not extra["suspect_lamps"][name]["since_first_target"]
    assert abs(extra["suspect_lamps"][name]["factor"]) < 5 * extra["suspect_lamps"][name]["spread"]
    assert report["suspect_targets"] == 0, "an inversion without a lamp is one of a subject that it does not light"


def brightest_lamp(archive):
    return int(np.argmax(read_lamps(archive, 0).mean(axis=(1, 2))))
