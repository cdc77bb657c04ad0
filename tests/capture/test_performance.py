# SPDX-License-Identifier: MIT
"""Performances end to end: targets between the cycles, of a subject that stands still, of one that turns, and of takes that
lost frames."""
import json
import subprocess

import numpy as np
import OpenEXR
import pytest

from virtual_take import BIN, SCENES, VirtualStage, manifest, read_lamps, read_plane, sequence, slots_of, target_file, verify

CYCLES, CYCLE = 3, 180
TRACKING = [slot for slot, one in enumerate(slots_of("single")) if one["kind"] == "tracking"]
COUNTS_PER_US = 2.52


def record(folder, scene, *options, faults=(), code=0):
    folder.mkdir()
    text = "".join(f'[[fault]]\nkind = "drop_frame"\ntrigger = {trigger}\n' for trigger in faults)
    (folder / "faults.toml").write_text(text)
    inject = ["--inject", folder / "faults.toml"] if faults else []
    archive = folder / "take.rfa"
    with VirtualStage(folder / "work", scene, *inject) as stage:
        said = stage.stagectl("run", "--sequence", sequence("single"), "--nominal", "--cycles", CYCLES, "-o", archive, *options, code=code)
        (folder / "said.txt").write_text(said)
        # The truth needs the stage's camera.
        (folder / "stage.toml").write_text(stage.stage.read_text())
    return archive


def targets(archive):
    """What is said of each, in order."""
    lines = map(json.loads, (archive / "journal.jsonl").read_text().splitlines())
    return [line["provenance"] for line in lines if line["event"] == "target"]


def number_of(target):
    return target["cycle"] * CYCLE + target["slot"]


def cfa_of(archive):
    parts = OpenEXR.File(str(target_file(archive, 0)), separate_channels=True).parts
    return next(part.header["cfa"] for part in parts if part.header["name"] == "lamps")


def truth(archive, scene, target):
    """The sum of all lamps as a mosaic, without sensor and noise, in the middle of the target's tracking exposure."""
    timing = manifest(archive)["extra"]["sequence"]
    period_us = 1e6 * timing["period_ticks"] / timing["tick_hz"]
    at_us = number_of(target) * period_us + timing["exposure_us"]["tracking"] / 2
    out = archive.parent / "truth.exr"
    command = [BIN / "stagesim", "render", SCENES / scene, "--stage", archive.parent / "stage.toml", "--all-lamps", "--at-us", at_us]
    subprocess.run(list(map(str, [*command, "--unit", "counts", "-o", out])), check=True)
    planes = OpenEXR.File(str(out), separate_channels=True).channels()
    mosaic = np.empty(planes["G"].pixels.shape)
    for place, color in enumerate(cfa_of(archive)[-4:].upper()):
        y, x = divmod(place, 2)
        mosaic[y::2, x::2] = planes[color].pixels[y::2, x::2]
    return mosaic / COUNTS_PER_US


@pytest.fixture(scope="module")
def still(tmp_path_factory):
    """Without compensation, with each quality, and one target a cycle."""
    folder = tmp_path_factory.mktemp("still")
    takes = {name: record(folder / name, "spheres.toml", "--fps", 24, "--quality", name) for name in ("none", "preview", "standard")}
    return {**takes, "cycles": record(folder / "cycles", "spheres.toml")}


def test_targets_stand_at_every_fifth_tracking_frame_that_a_whole_basis_lies_around(still):
    first = next(slot for slot in TRACKING if slot >= CYCLE // 2)
    expected = range(first, CYCLES * CYCLE - CYCLE // 2 + 1, CYCLE // 2)
    for name in ("none", "preview", "standard"):
        assert [number_of(target) for target in targets(still[name])] == list(expected)
        motion = manifest(still[name])["extra"]["motion"]
        assert motion["quality"] == name and motion["tracking_frames_a_target"] == 5
        assert verify(still[name]).returncode == 0


def test_one_recording_developed_in_several_qualities_gives_the_bits_of_a_take_each(still, tmp_path):
    others = {name: tmp_path / f"{name}.rfa" for name in ("none", "preview")}
    also = [word for name, path in others.items() for word in ("--also", f"{name}={path}")]
    takes = {**others, "standard": record(tmp_path / "several", "spheres.toml", "--fps", 24, "--quality", "standard", *also)}
    for name, archive in takes.items():
        assert manifest(archive) == manifest(still[name]), name
        for index in range(len(targets(still[name]))):
            assert target_file(archive, index).read_bytes() == target_file(still[name], index).read_bytes()


def test_the_operator_is_warned_of_flicker_and_told_the_exact_rate_that_the_archive_has(still):
    said = (still["preview"].parent / "said.txt").read_text()
    assert "can trigger seizures" in said
    rate_hz = 125e6 / (57870 * 18 * 5)
    assert f"--fps 24 is {rate_hz:.7g} targets a second here" in said
    assert manifest(still["preview"])["frame_rate_hz"] == pytest.approx(rate_hz, rel=1e-12)
    assert "can trigger seizures" in (still["cycles"].parent / "said.txt").read_text()


@pytest.mark.parametrize("name", ["none", "preview", "standard"])
def test_a_subject_that_stands_still_is_that_of_one_target_a_cycle_but_for_noise(still, name):
    # Half of the frames are the cycle's own: half of the variance of two takes, with some room for what flow moves.
    index = next(i for i, target in enumerate(targets(still[name])) if target["cycle"] == 1)
    apart = (read_lamps(still[name], index) - read_lamps(still["cycles"], 1)) ** 2
    saturated = 1
    usual = ((read_plane(still[name], index, "mask") | read_plane(still["cycles"], 1, "mask")) & saturated) == 0
    variance = read_plane(still[name], index, "variance") + read_plane(still["cycles"], 1, "variance")
    assert usual.mean() > 0.9
    assert apart.mean(axis=0)[usual].mean() < 0.6 * variance[usual].mean()


def test_a_card_that_turns_is_nearer_to_the_truth_than_without_compensation(tmp_path):
    scene, errors = "motion_spin.toml", {}
    for name in ("none", "preview", "standard"):
        archive = record(tmp_path / name, scene, "--fps", 24, "--quality", name)
        squares = []
        for index, target in enumerate(targets(archive)):
            shown = truth(archive, scene, target)
            squares.append(((read_lamps(archive, index).sum(axis=0) - shown) ** 2)[shown > 0.02 * shown.max()].mean())
        errors[name] = np.sqrt(np.mean(squares))
    assert errors["preview"] < errors["none"] / 2 and errors["standard"] < errors["none"] / 2, errors


@pytest.mark.parametrize("name", ["preview", "standard"])
def test_a_film_is_relit_with_its_blur_of_every_target(still, tmp_path, name):
    light = {"RGB": np.ones((16, 32, 3), np.float32)}
    OpenEXR.File({"type": OpenEXR.scanlineimage}, light).write(str(tmp_path / "even.exr"))
    command = [BIN / "rf", "relight", still[name], "--target", "all", "--env", tmp_path / "even.exr", "--shutter", 180, "-o", tmp_path / "film.exr"]
    subprocess.run(list(map(str, command)), check=True, capture_output=True)
    pictures = sorted(tmp_path.glob("film_*.exr"))
    assert len(pictures) == len(targets(still[name]))
    for picture in pictures:
        for plane in OpenEXR.File(str(picture), separate_channels=True).channels().values():
            assert np.isfinite(plane.pixels).all() and plane.pixels.max() > 0.1


def test_lost_frames_come_from_the_neighbouring_cycle_and_lost_tracking_frames_are_bridged(tmp_path):
    kinds = [slot["kind"] for slot in slots_of("single")]
    basis = next(slot for slot in range(100, CYCLE) if kinds[slot] == "basis")
    own = next(slot for slot in TRACKING if slot >= CYCLE // 2) + CYCLE // 2
    archive = record(tmp_path / "take", "spheres.toml", "--fps", 24, "--quality", "preview", faults=[CYCLE + basis, own], code=2)
    struck = [target for target in targets(archive) if basis in target.get("slots_from_neighbours", [])]
    assert len(struck) == 2, "the frame was the nearer one of two targets"
    bridged = next(target for target in targets(archive) if number_of(target) == own)
    assert {"cycle": own // CYCLE, "slot": own % CYCLE} in bridged["tracking_missing"]
    for index, target in enumerate(targets(archive)):
        assert target["missing_slots"] == [] and target_file(archive, index).exists()
        assert not (read_plane(archive, index, "mask") & 32).any(), "every sample is solved"
