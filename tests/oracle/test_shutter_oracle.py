# SPDX-License-Identifier: MIT
"""rf relight --shutter against numpy, on archives whose motion was added by another program from what docs/archive.md says."""
import json
import pathlib
import sys

import numpy as np
import OpenEXR
from pictures import ingested, read_exr, refusal, run

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1] / "unit"))
from chained_journal import note_anew

LAMPS = np.array([[0.0, 1, 0], [0, 0, 1]])
LIGHT = ("--light", "0 1 0 1 1 1")
TARGET = "cam0/target_000000.exr"


def add_motion(take, times_s, flows):
    """Adds the part "motion" to an archive's target; flows: [instant][u or v] -> plane."""
    file = OpenEXR.File(str(take / TARGET), separate_channels=True)
    channels = {f"instant_{i:03}.{name}": np.ascontiguousarray(plane, dtype=np.float16)
                for i, flow in enumerate(flows) for name, plane in zip("uv", flow)}
    header = {key: value for key, value in file.parts[1].header.items() if key not in ("channels", "name", "chunkCount")}
    header.update(timesSeconds=json.dumps(times_s))
    parts = [*file.parts, OpenEXR.Part(header, channels, "motion")]
    OpenEXR.File(parts).write(str(take / TARGET))
    note_anew(take)


def a_take(folder, height=20, width=60):
    generator = np.random.default_rng(4)
    picture = np.zeros((height, width, 3))
    picture[:, 20:40] = generator.integers(0, 1024, (height, 20, 3)) / 1024
    return ingested(folder, LAMPS, [picture, picture]), picture


def test_a_sideways_motion_of_the_archive_is_a_box_filter(tmp_path):
    take, picture = a_take(tmp_path)
    everywhere = np.ones(picture.shape[:2])
    add_motion(take, [-1 / 48, 1 / 48], [(-4 * everywhere, 0 * everywhere), (4 * everywhere, 0 * everywhere)])
    assert json.loads(run("rf", "info", take, "--json"))["targets"][0]["motion_times_s"] == [-1 / 48, 1 / 48]
    assert "motion at 2 instants from -20.8 to +20.8 ms" in run("rf", "info", take)
    report = json.loads(run("rf", "relight", take, *LIGHT, "--shutter", 360, "--blur-step", 0.05, "--float", "--json", "-o", tmp_path / "blurred.exr"))
    assert report["targets"][0]["shutter"]["extrapolated_ms"] == 0
    got = read_exr(tmp_path / "blurred.exr")[..., :3]
    # 8 pixels of way: the mean of the picture, interpolated linearly, over 8 pixels is a trapezoid's sum.
    weights = np.array([0.5, *np.ones(7), 0.5]) / 8
    expected = np.stack([np.stack([np.convolve(row, weights, "same") for row in picture[..., c]]) for c in range(3)], axis=-1)
    assert np.abs(got - expected)[:, 5:-5].max() < 2e-3
    np.testing.assert_allclose(got.sum(), picture.sum(), rtol=1e-5)


def test_without_a_shutter_motion_changes_no_byte(tmp_path):
    take, picture = a_take(tmp_path)
    run("rf", "relight", take, *LIGHT, "-o", tmp_path / "before.exr")
    everywhere = np.ones(picture.shape[:2])
    add_motion(take, [1 / 48], [(4 * everywhere, everywhere)])
    run("rf", "relight", take, *LIGHT, "-o", tmp_path / "after.exr")
    assert (tmp_path / "before.exr").read_bytes() == (tmp_path / "after.exr").read_bytes()


def test_a_take_without_motion_and_a_damaged_one_are_refused_and_nothing_is_written(tmp_path):
    take, picture = a_take(tmp_path)
    output = tmp_path / "blurred.exr"
    assert "target 0 has no motion to blur along" in refusal("rf", "relight", take, *LIGHT, "--shutter", 180, "-o", output)
    not_a_number = np.full(picture.shape[:2], np.nan)
    add_motion(take, [1 / 48], [(not_a_number, not_a_number)])
    assert "not finite at pixel 0, 0" in refusal("rf", "relight", take, *LIGHT, "--shutter", 180, "-o", output)
    assert not output.exists()
