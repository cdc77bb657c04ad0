# SPDX-License-Identifier: MIT
# `stagectl basis design` from outside: its file and its figures, against numpy.
import json
import pathlib
import subprocess

import numpy as np

STAGECTL = pathlib.Path(__file__).resolve().parents[2] / "build/host/bin/stagectl"
QUICK = ["--starts", "1", "--sweeps", "0"]


def design(path, *options, code=0):
    done = subprocess.run([STAGECTL, "basis", "design", "-o", path, *QUICK, *options], capture_output=True, text=True)
    assert done.returncode == code, done.stdout + done.stderr
    return done


def mean_variance(light, subjects, read=2.68, shot=0.492):
    """Of the lamps, inverted by least squares weighted with each row's mean variance over the subjects."""
    rows = np.mean((read + shot * np.sqrt(subjects @ light.T)) ** 2, axis=0)
    return np.trace(np.linalg.inv(light.T @ (light / rows[:, None]))) / light.shape[1]


def test_the_file_has_the_noise_that_the_report_says(tmp_path):
    report = json.loads(design(tmp_path / "designed.csv", "--counts", "50", "--json").stdout)
    light = np.loadtxt(tmp_path / "designed.csv", delimiter=",")
    subjects = np.array(report["subjects"])
    assert light.shape == (159, 156) and set(np.unique(light)) == {0, 1}
    figures = {basis["name"]: basis for basis in report["bases"]}
    assert np.isclose(figures["designed"]["mean_variance"], mean_variance(light, subjects), rtol=1e-6)
    assert np.isclose(figures["single"]["mean_variance"], mean_variance(np.eye(156), subjects), rtol=1e-6)
    assert figures["designed"]["gain_over_single"] > 1.5


def test_a_card_that_would_saturate_keeps_every_slot_below_white(tmp_path):
    report = json.loads(design(tmp_path / "designed.csv", "--counts", "100", "--card", "400", "--json").stdout)
    light = np.loadtxt(tmp_path / "designed.csv", delimiter=",")
    assert (4 * np.array(report["subjects"]) @ light.T).max() <= (4095 - 64) * 0.98


def test_equal_lamps_stay_above_the_bound(tmp_path):
    report = json.loads(design(tmp_path / "designed.csv", "--counts", "10", "--subject", "equal", "--json").stdout)
    designed = report["bases"][0]["mean_variance"]
    assert report["bound_mean_variance"] <= designed <= 1.03 * report["bound_mean_variance"]


def test_too_few_rows_are_refused_and_nothing_is_written(tmp_path):
    done = design(tmp_path / "designed.csv", "--counts", "10", "--rows", "100", code=1)
    assert "100 rows cannot tell 156 lamps apart" in done.stderr
    assert not list(tmp_path.iterdir())


def test_an_unknown_camera_lists_the_known_ones(tmp_path):
    done = design(tmp_path / "designed.csv", "--counts", "10", "--camera", "phantom", code=1)
    assert "phantom_v7.1" in done.stderr
