# SPDX-License-Identifier: MIT
"""A take in every kind of basis, end to end: what comes back is the card's cosine within the noise that numpy's own
inversion of the recorded levels predicts."""
import numpy as np
import pytest

from virtual_take import HEIGHT, WIDTH, VirtualStage, manifest, read_lamps

CARD = 0.985
COUNTS_PER_US = 2.52
KINDS = ["single", "triangle", "triangle300", "planes156", "s159", "hadamard156", "s155", "paley163", "spherical_harmonics:4", "mine.csv"]


@pytest.fixture(scope="module")
def card(tmp_path_factory):
    with VirtualStage(tmp_path_factory.mktemp("card"), "card.toml") as stage:
        stage.stagectl("calibrate", "-o", stage.folder / "cal", "--card", CARD)
        # A grey basis of two bits: three thirds of one lamp and one of the next, condition number 2.
        levels = 3 * np.eye(156) + np.roll(np.eye(156), 1, axis=0)
        np.savetxt(stage.folder / "mine.csv", levels, fmt="%d", delimiter=",", header="level_max = 3")
        yield stage


@pytest.fixture(scope="module")
def lamps(card):
    """The directions of the stage's lamps, which an archive of the single basis lists."""
    archive = card.folder / "lamps.rfa"
    card.stagectl("run", "--basis", "single", "--nominal", "-o", archive)
    return directions(archive)


def directions(archive):
    lines = (archive / "lights.lp").read_text().splitlines()[1:]
    return np.array([[float(word) for word in line.split()[1:]] for line in lines])


def sigma2(counts):
    return (2.68 + 0.492 * np.sqrt(counts)) ** 2 + 1 / 12


@pytest.mark.parametrize("kind", KINDS)
def test_a_take_recovers_the_cards_cosine_within_its_predicted_noise(card, lamps, kind):
    name = card.folder / kind if kind.endswith(".csv") else kind
    archive = card.folder / f"{kind}.rfa"
    report = card.stagectl("run", "--basis", name, "--calibration", card.folder / "cal", "-o", archive, "--json")
    assert report["slots_missing"] == 0 and report["targets_written"] == 1 and report["saturated_share"] == 0
    extra = manifest(archive)["extra"]
    basis = extra["basis"]
    light = np.array([row.split(",") for row in basis["levels"]], float) / basis["level_max"]
    assert light.shape == (basis["rows"], 156)
    assert basis["rank"] == np.linalg.matrix_rank(light) and basis["images"] == len(directions(archive))
    assert basis["is_estimate"] == (kind == "spherical_harmonics:4")

    per_lamp = CARD * np.maximum(0, lamps[:, 2])
    inverse = np.linalg.pinv(light)
    if kind == "triangle":  # rank 152: every triple is one light, in the mean direction of its lamps
        inverse = np.eye(155) / 3
    truth = (inverse @ light @ per_lamp)[: basis["images"]]
    counts_per_r = COUNTS_PER_US * extra["sequence"]["exposure_us"]["basis"]
    middle = slice(HEIGHT // 2 - 4, HEIGHT // 2 + 4), slice(WIDTH // 2 - 4, WIDTH // 2 + 4)
    errors = read_lamps(archive, 0)[:, *middle].mean(axis=(1, 2)) - truth
    sigma = np.sqrt(inverse**2 @ sigma2(light @ per_lamp * counts_per_r))[: basis["images"]] / counts_per_r / 8
    # Five deviations for the largest of 156; the flat field and half floats are good for a few thousandths, vignetting in
    # the middle for one.
    assert np.all(np.abs(errors) < 5 * sigma + 0.005 * np.abs(truth).max()), np.abs(errors / sigma).max()
    # The noise is there, and as large as predicted: the root mean square of 156, some of them correlated.
    spread = (errors - errors.mean()) / sigma
    assert 0.7 < np.sqrt(np.mean(spread[sigma > 0] ** 2)) < 1.5
