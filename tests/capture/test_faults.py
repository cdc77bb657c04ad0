# SPDX-License-Identifier: MIT
"""Faults on the way from the lamps to the archive, in every kind of slot: what the manifest must say, and that not one
sample of the archive differs from the take without faults but where the manifest says so. The virtual camera's noise is
keyed by trigger, so that a mislabelled frame cannot hide."""
import json
import subprocess

import numpy as np
import pytest

from virtual_take import (
    BIN,
    SMALL_STAGE,
    VirtualStage,
    identification,
    manifest,
    missing_slots,
    missing_triggers,
    read_lamps,
    read_plane,
    sequence,
    slots_of,
    target_file,
)

CYCLES = 3
CYCLE = 180


def find_slot(kind, nth):
    """The trigger of the n-th slot of a kind in the second cycle."""
    return CYCLE + [i for i, slot in enumerate(slots_of("single")) if slot["kind"] == kind][nth]


STRUCK = {kind: find_slot(kind, nth) for kind, nth in {"tracking": 2, "matte": 4, "dark": 2, "basis": 120}.items()}


def record(folder, faults, *stage_options, basis="single", cycles=CYCLES, code=0, run_options=(), stage=SMALL_STAGE):
    text = "".join(
        "[[fault]]\n" + "".join(f"{key} = {value!r}\n" for key, value in fault.items()) for fault in faults
    ).replace("True", "true").replace("False", "false")
    folder.mkdir(parents=True)
    (folder / "faults.toml").write_text(text)
    options = ["--inject", folder / "faults.toml"] if faults else []
    archive = folder / "take.rfa"
    with VirtualStage(folder / "work", "spheres.toml", *options, *stage_options, stage=stage) as running:
        report = running.stagectl(
            "run", "--sequence", sequence(basis), "--nominal", "--cycles", cycles, "-o", archive, "--json", *run_options,
            code=code,
        )
    return archive, report


def relight(archive, output, *options):
    command = [BIN / "rf", "relight", archive, "--light", "0 0 1 1 1 1", "-o", output, "--json", *options]
    return subprocess.run(list(map(str, command)), capture_output=True, text=True, check=True)


@pytest.fixture(scope="module")
def clean(tmp_path_factory):
    archive, report = record(tmp_path_factory.mktemp("clean") / "take", [])
    assert report["slots_missing"] == 0 and report["targets_written"] == CYCLES
    return archive


def expect_same(archive, clean, index, missing_lamps=()):
    if not missing_lamps:
        assert target_file(archive, index).read_bytes() == target_file(clean, index).read_bytes()
        return
    lamps, truth = read_lamps(archive, index), read_lamps(clean, index)
    for lamp in range(len(truth)):
        assert np.array_equal(lamps[lamp], 0 * truth[lamp] if lamp in missing_lamps else truth[lamp]), lamp


@pytest.mark.parametrize(
    "fault, lost",
    [
        ({"kind": "drop_frame"}, "link_lost_it"),
        ({"kind": "drop_trigger"}, "camera_missed_trigger"),
        ({"kind": "wrong_size"}, "wrong_size"),
        ({"kind": "late", "by": 40}, "link_lost_it"),
        ({"kind": "duplicate"}, None),
        ({"kind": "late", "by": 10}, None),
        ({"kind": "swap"}, None),
        ({"kind": "restart_camera", "keep_clock": True}, None),
    ],
    ids=lambda value: "-".join(map(str, value.values())) if isinstance(value, dict) else "",
)
def test_a_fault_costs_its_own_slot_at_most_in_every_kind_of_slot(tmp_path, clean, fault, lost):
    faults = [{**fault, "trigger": trigger} for trigger in STRUCK.values()]
    archive, report = record(tmp_path / "take", faults, code=2 if lost else 0)
    assert missing_triggers(archive) == (set(STRUCK.values()) if lost else set())
    assert report["causes"] == ({lost: len(STRUCK)} if lost else {}) == identification(archive)["causes"]
    assert {slot["cause"] for slot in missing_slots(archive)} == ({lost} if lost else set())
    assert report["cameras"][0]["duplicates"] == (len(STRUCK) if fault["kind"] == "duplicate" else 0)
    expect_same(archive, clean, 0)
    expect_same(archive, clean, 2)
    lamp = slots_of("single")[STRUCK["basis"] - CYCLE]["row"]
    expect_same(archive, clean, 1, [lamp] if lost else [])


@pytest.mark.parametrize("kind", STRUCK)
def test_a_camera_whose_clock_starts_anew_is_found_again_by_the_optical_code(tmp_path, clean, kind):
    fault = {"kind": "restart_camera", "keep_clock": False, "trigger": STRUCK[kind]}
    archive, report = record(tmp_path / "take", [fault])
    assert missing_triggers(archive) == set() and report["cameras"][0]["restarts"] == 1
    for index in range(CYCLES):
        expect_same(archive, clean, index)


@pytest.mark.parametrize("kind", STRUCK)
def test_a_board_that_resets_ends_the_take_with_what_was_proved(tmp_path, clean, kind):
    archive, report = record(tmp_path / "take", [], "--board-inject", f"reset@trigger:{STRUCK[kind]}", code=2)
    missing = missing_triggers(archive)
    # The log is read in messages: what the board had not told when it was reset is missing too, and nothing before.
    assert missing == set(range(min(missing), CYCLES * CYCLE)) and min(missing) <= STRUCK[kind]
    assert report["board_end"]["cause"] == "board_gone" and report["targets_written"] >= 1
    # A trigger line that falls as the board resets ends an exposure in the dark.
    assert report["causes"]["board_gone"] > 0
    assert set(report["causes"]) <= {"board_gone", "log_lost_it", "not_proved", "no_light"}
    expect_same(archive, clean, 0)


def test_old_buffers_are_known_by_their_bits_in_every_kind_of_slot_and_cost_that_slot(tmp_path, clean):
    """The stamps are right, and no optical code knows a basis slot: it is the camera's noise that never comes twice."""
    struck = [*STRUCK.values(), STRUCK["basis"] + 20]
    archive, report = record(tmp_path / "take", [{"kind": "freeze", "trigger": trigger} for trigger in struck], code=2)
    assert missing_triggers(archive) == set(struck)
    assert all("stale: the camera's frame" in slot["why"] and "1 frames before" in slot["why"] for slot in missing_slots(archive))
    assert report["causes"] == {"stale": len(struck)} and report["cameras"][0]["stale_buffers"] == len(struck)
    assert report["cameras"][0]["frames_without_noise"] == 0
    expect_same(archive, clean, 0)
    expect_same(archive, clean, 1, [row for row in (slots_of("single")[trigger - CYCLE]["row"] for trigger in struck) if row >= 0])
    expect_same(archive, clean, 2)


def test_a_frozen_picture_without_noise_in_a_lit_landmark_takes_down_its_stretch_and_nothing_else(tmp_path):
    """Without noise honest frames come the same again: their bits tell nothing, and the optical code is left."""
    stage = SMALL_STAGE + "noise_read_counts = 0\nnoise_shot = 0\n"
    whole, _ = record(tmp_path / "whole", [], stage=stage)
    archive, report = record(tmp_path / "take", [{"kind": "freeze", "trigger": STRUCK["tracking"]}], stage=stage, code=2)
    camera = report["cameras"][0]
    assert camera["stale_buffers"] == 0 and camera["frames_without_noise"] == camera["frames"] == CYCLES * CYCLE
    missing = missing_triggers(archive)
    # Back to the tracking slot before it. The matte slot in between proves nothing in a scene without a matte board: it
    # is as dark as a lamp behind the spheres.
    assert missing == set(range(STRUCK["tracking"] - 17, STRUCK["tracking"] + 1))
    assert missing_slots(archive)[0]["why"].startswith("the optical code disagrees")
    assert report["causes"] == {"not_proved": 18}
    expect_same(archive, whole, 0)
    rows = [slots_of("single")[trigger - CYCLE]["row"] for trigger in missing]
    expect_same(archive, whole, 1, [row for row in rows if row >= 0])
    expect_same(archive, whole, 2)


def no_light(trigger, count=1 << 29):
    """The lamps' supply is off, or a cap on the lens."""
    return {"kind": "dim_lamp", "factor": 0.0, "trigger": trigger, "count": count}


def last_tracking_before(trigger):
    return max(n for n in range(trigger) if slots_of("single")[n % CYCLE]["kind"] == "tracking")


def test_a_take_that_never_sees_light_keeps_nothing_and_says_to_look_at_supply_and_lens(tmp_path):
    (tmp_path / "faults.toml").write_text('[[fault]]\nkind = "dim_lamp"\ntrigger = 0\nfactor = 0.0\n')
    with VirtualStage(tmp_path / "work", "spheres.toml", "--inject", tmp_path / "faults.toml") as stage:
        said = stage.stagectl("run", "--sequence", sequence("single"), "--nominal", "--cycles", CYCLES, "-o", tmp_path / "take.rfa", code=1)
    assert f"{CYCLES * CYCLE} frames came, and none shows any light: check the lamps' supply, the lens and its cap" in said
    assert not (tmp_path / "take.rfa").exists()


def test_lamps_that_fail_for_a_while_are_the_cause_of_what_is_missing_and_of_nothing_else(tmp_path, clean):
    first, count = STRUCK["basis"], 40
    archive, report = record(tmp_path / "take", [no_light(first, count)], code=2)
    # From the tracking slot before that proved the last frame on, to where light is seen again.
    assert missing_triggers(archive) == set(range(last_tracking_before(first) + 1, first + count))
    assert set(report["causes"]) == {"no_light", "not_proved"} and report["causes"]["no_light"] > report["causes"]["not_proved"]
    expect_same(archive, clean, 0)
    expect_same(archive, clean, 2)


def test_lamps_that_fail_to_the_end_leave_what_was_proved_before(tmp_path, clean):
    archive, report = record(tmp_path / "take", [no_light(2 * CYCLE)], code=2)
    assert missing_triggers(archive) == set(range(last_tracking_before(2 * CYCLE) + 1, 3 * CYCLE))
    assert report["causes"]["no_light"] >= CYCLE
    expect_same(archive, clean, 0)


def basis_slot(basis, nth=50):
    """A basis slot of the second cycle."""
    return CYCLE + next(i for i, slot in enumerate(slots_of(basis)) if slot["kind"] == "basis" and i > nth)


def target_provenance(archive, index):
    lines = map(json.loads, (archive / "journal.jsonl").read_text().splitlines())
    return next(line["provenance"] for line in lines if line["event"] == "target" and line["index"] == index)


@pytest.fixture(scope="module")
def whole_s159(tmp_path_factory):
    archive, _ = record(tmp_path_factory.mktemp("whole") / "take", [], basis="s159")
    return archive


def noise_gain_without(lost):
    """Mean variance of the lamps by least squares without these slots, over that with all."""
    slots = [slot for slot in slots_of("s159") if slot["kind"] == "basis"]
    light = np.array([[lamp in slot["lit"] for lamp in range(156)] for slot in slots], float)
    kept = [slot["row"] not in lost for slot in slots]
    assert np.linalg.matrix_rank(light[kept]) == 156
    trace = [np.trace(np.linalg.inv(rows.T @ rows)) for rows in (light[kept], light)]
    return trace[0] / trace[1]


@pytest.mark.parametrize("lost", [1, 2, 3])
def test_s159_makes_up_for_slots_lost_in_a_row_and_says_what_that_costs_in_noise(tmp_path, whole_s159, lost):
    first = basis_slot("s159")
    triggers = range(first, first + lost)
    gain = noise_gain_without([slots_of("s159")[trigger - CYCLE]["row"] for trigger in triggers])
    archive, report = record(
        tmp_path / "take", [{"kind": "drop_frame", "trigger": trigger} for trigger in triggers], basis="s159", code=2
    )
    assert missing_triggers(archive) == set(triggers)
    assert report["targets_written"] == CYCLES and report["targets_missing"] == 0 and report["estimated_share"] == 0
    expect_same(archive, whole_s159, 0)
    expect_same(archive, whole_s159, 2)
    # Of the same samples, what is recovered without some of them differs by the variance that it has more.
    masked = read_plane(archive, 1, "mask")
    assert (masked & 2 == 2).all() and not (masked & 32).any()
    usual = masked == 2
    assert usual.mean() > 0.9 and np.allclose(read_plane(archive, 1, "noise_gain")[usual], gain, atol=0.01)
    difference = read_lamps(archive, 1) - read_lamps(whole_s159, 1)
    more = (difference**2).mean(axis=0)[usual].mean() / read_plane(whole_s159, 1, "variance")[usual].mean()
    assert abs(more / (gain - 1) - 1) < 0.1
    assert target_provenance(archive, 1)["masked"]["unsolved"] == 0


def test_hadamard156_refuses_a_lost_slot_by_name_or_estimates_it_or_takes_it_from_the_neighbours(tmp_path):
    slot = basis_slot("hadamard156")
    faults = [{"kind": "drop_frame", "trigger": slot}]
    archive, report = record(tmp_path / "refused", faults, basis="hadamard156", code=2)
    assert report["targets_written"] == CYCLES - 1 and report["targets_missing"] == 1
    assert not target_file(archive, 1).exists() and target_file(archive, 2).exists()
    journal = (archive / "journal.jsonl").read_text()
    assert f"slots {slot - CYCLE} are missing" in journal and "--estimate smooth" in journal
    assert manifest(archive)["extra"]["identification"]["slots_missing"] == 1

    options = ["--estimate", "smooth"]
    archive, report = record(tmp_path / "estimated", faults, basis="hadamard156", code=2, run_options=options)
    assert report["targets_written"] == CYCLES and report["estimated_share"] == 1
    assert (read_plane(archive, 1, "mask") & 16 == 16).all()
    relit = relight(archive, tmp_path / "relit.exr", "--target", 1)
    masked = json.loads(relit.stdout)["targets"][0]["masked_pixels"]
    assert masked["estimated"] == masked["pixels"] > 0 and "are estimates" in relit.stderr
    estimated = target_provenance(archive, 1)["masked"]["estimated"]
    assert estimated["prior"] == "smooth" and 0 < estimated["mean_bias"] <= estimated["worst_bias"]

    archive, report = record(tmp_path / "filled", faults, basis="hadamard156", code=2, run_options=["--fill", "neighbours"])
    assert report["targets_written"] == CYCLES and report["estimated_share"] == 0
    assert target_provenance(archive, 1)["slots_from_neighbours"] == [slot - CYCLE]
