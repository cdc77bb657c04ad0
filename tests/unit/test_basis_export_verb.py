# SPDX-License-Identifier: MIT
# `stagectl basis export` from outside: what numpy reads of it, its order of play and its classes of loss, against ranks.
import json
import pathlib
import subprocess

import numpy as np
import pytest

STAGECTL = pathlib.Path(__file__).resolve().parents[2] / "build/host/bin/stagectl"


def stagectl(*arguments):
    done = subprocess.run([STAGECTL, *map(str, arguments)], capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def exported(name, *options):
    return json.loads(stagectl("basis", "export", name, "--json", *options))


def played_rows(name):
    slots = json.loads(stagectl("sequence", "--basis", name, "--json"))["slots"]
    return [(slot["row"], slot["lit"]) for slot in slots if slot["kind"] == "basis"]


def rank_without(light, lost):
    return np.linalg.matrix_rank(np.delete(light, lost, axis=0))


@pytest.mark.parametrize("name", ["single", "s159", "hadamard156", "planes156", "triangle300", "spherical_harmonics:3"])
def test_the_table_is_what_the_lamps_play_and_the_order_is_that_of_play(name):
    basis = exported(name)
    light = np.array(basis["levels"])
    assert light.shape == (basis["rows"], basis["lamps"]) and light.max() == basis["level_max"]
    played = played_rows(name)
    assert basis["order_of_play"] == [row for row, _ in played]
    assert sorted(basis["order_of_play"]) == list(range(basis["rows"]))
    for row, lit in played:
        assert list(np.flatnonzero(light[row])) == lit


@pytest.mark.parametrize("name", ["s159", "hadamard156", "triangle300", "spherical_harmonics:10"])
def test_numpy_reads_the_csv_and_the_inversion_inverts_it(tmp_path, name):
    stagectl("basis", "export", name, "-o", tmp_path / "basis.csv")
    basis = exported(name)
    light = np.loadtxt(tmp_path / "basis.csv", delimiter=",")
    assert np.array_equal(light, basis["levels"])
    images = np.array(basis["inverse"]).T @ (light / basis["level_max"])
    if not basis["is_estimate"]:
        assert np.allclose(images, np.eye(156), atol=1e-9)


@pytest.mark.parametrize("name", ["single", "s159", "hadamard156", "planes156", "triangle300", "spherical_harmonics:4"])
def test_the_csv_read_back_is_the_same_basis(tmp_path, name):
    path = tmp_path / "basis.csv"
    stagectl("basis", "export", name, "-o", path)
    basis, again = exported(name), exported(path)
    for key in ("rows", "lamps", "level_max", "levels", "image_lamps", "is_estimate", "order_of_play", "loss_class"):
        assert again[key] == basis[key], key
    assert again["lost_slots"]["redundancy"] == basis["lost_slots"]["redundancy"]
    # Of an S-matrix the recommended inversion is no pseudo-inverse: it differs, but inverts the same light.
    levels = np.array(basis["levels"]) / basis["level_max"]
    assert np.allclose(np.array(again["inverse"]).T @ levels, np.array(basis["inverse"]).T @ levels, atol=1e-9)
    assert stagectl("basis", "export", path).splitlines()[1:] == path.read_text().splitlines()[1:]


def test_two_rows_of_one_class_cannot_both_be_spared_and_of_two_classes_they_can():
    basis = exported("s159")
    light, classes = np.array(basis["levels"], float), np.array(basis["loss_class"])
    assert sorted(np.bincount(classes)) == [39, 40, 40, 40]
    for i, j in np.random.default_rng(1).choice(159, (60, 2)):
        if i != j:
            assert (rank_without(light, [i, j]) == 156) == (classes[i] != classes[j])
    assert set(exported("hadamard156")["loss_class"]) == {-1}


@pytest.mark.parametrize("name, kept", [("s159", [159, 159, 159]), ("paley163", [163, 163, 163]), ("hadamard156", [0, 0, 0])])
def test_sequence_report_and_export_say_which_bursts_the_other_rows_make_up_for(name, kept):
    basis = exported(name)
    light, order = np.array(basis["levels"], float), basis["order_of_play"]
    said = [
        basis["lost_slots"],
        json.loads(stagectl("sequence", "--basis", name, "--json"))["lost_slots"],
        json.loads(stagectl("basis", "report", name, "--json"))["lost_slots"],
    ]
    assert said[0] == said[1] == said[2]
    for burst, expected in zip(said[0]["bursts"], kept):
        assert burst["windows"] == len(order) and burst["made_up_for"] == expected
        for first in range(0, len(order), 20):  # a rank takes milliseconds
            lost = [order[(first + k) % len(order)] for k in range(burst["slots"])]
            assert (rank_without(light, lost) == 156) == (expected > 0)
    text = stagectl("sequence", "--basis", name)
    if kept[0]:
        assert f"2 in a row: {kept[1]} of {kept[1]} made up for" in text
    else:
        assert "one that is lost costs the target" in text


def test_the_single_lamps_lost_slot_is_a_missing_image():
    assert exported("single")["lost_slots"]["is_one_image_a_row"]
    assert "lost slots   each is one missing image" in stagectl("basis", "report", "single")
