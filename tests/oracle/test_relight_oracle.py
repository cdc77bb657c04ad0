# SPDX-License-Identifier: MIT
"""Lamp weights and relit pictures against numpy that shares no code with them: a map is sampled densely and every sample goes to
the lamp with the largest cosine."""
import json

import numpy as np
import pytest
from pictures import ingested, read_exr, refusal, run, write_exr, write_lp


def dome(count, seed):
    """Directions above -20 degrees of elevation: not a whole sphere, and nothing regular."""
    generator = np.random.default_rng(seed)
    directions = generator.normal(size=(count * 3, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    return directions[directions[:, 1] > -0.34][:count]


def sunny_map(width, height, seed):
    """Sky, ground, coloured noise, and a sun of one texel that outshines everything else."""
    generator = np.random.default_rng(seed)
    rgb = generator.uniform(0.1, 1, (height, width, 3))
    rgb[: height // 2] *= (0.5, 0.8, 2)
    rgb[height // 3, width // 5] = (4000, 3500, 3000)
    return rgb.astype(np.float32)


def sampled_texel(rgb, row, column, lamps, rotate_deg, samples):
    """Irradiance of each lamp from samples x samples points of a texel. The map's left edge is longitude 180 degrees, which falls
    to the right; 0 is +Z and 90 is +X. Equal steps in sin(latitude) make points of equal solid angle."""
    height, width, _ = rgb.shape
    offsets = (np.arange(samples) + 0.5) / samples
    longitude = np.radians(180 - 360 * (column + offsets) / width + rotate_deg)[None, :]
    top, bottom = np.sin(np.pi * (0.5 - row / height)), np.sin(np.pi * (0.5 - (row + 1) / height))
    y = (top + (bottom - top) * offsets)[:, None]
    across = np.sqrt(1 - y * y)
    directions = np.broadcast_arrays(across * np.sin(longitude), y, across * np.cos(longitude))
    nearest = np.argmax(np.tensordot(lamps, np.stack(directions), axes=1), axis=0)
    steradians = 2 * np.pi / width * (top - bottom) / samples**2
    hits = np.bincount(nearest.ravel(), minlength=len(lamps))
    return hits[:, None] * steradians * rgb[row, column].astype(np.float64)


def weights_by_sampling(rgb, lamps, rotate_deg=0.0):
    """The brightest texel is sampled most densely: all the others together weigh less than a small part of it."""
    sun = np.unravel_index(np.argmax(rgb[..., 0]), rgb.shape[:2])
    texels = np.ndindex(rgb.shape[:2])
    return sum(sampled_texel(rgb, *texel, lamps, rotate_deg, 800 if texel == sun else 24) for texel in texels)


@pytest.mark.parametrize("rotate_deg", [0, 77.5, -160])
def test_weights_are_those_of_dense_sampling(tmp_path, rotate_deg):
    lamps, rgb = dome(40, seed=1), sunny_map(48, 24, seed=2)
    write_exr(tmp_path / "map.exr", rgb)
    write_lp(tmp_path / "lights.lp", [f"light_{i:02}" for i in range(len(lamps))], lamps)
    report = json.loads(run("rf", "weights", "--env", tmp_path / "map.exr", "--lights", tmp_path / "lights.lp", "--rotate",
                            rotate_deg, "--json"))
    got = np.array([lamp["irradiance"] for lamp in report["lamps"]])
    expected = weights_by_sampling(rgb, lamps, rotate_deg)
    # The sun's lamp holds most of the light; the others are compared with one another.
    sun = int(np.argmax(expected[:, 0]))
    others = np.arange(len(lamps)) != sun
    np.testing.assert_allclose(got[sun], expected[sun], rtol=2e-3)
    assert np.abs(got - expected)[others].max() < 1e-3 * expected[others].max()
    np.testing.assert_allclose(got.sum(axis=0), expected.sum(axis=0), rtol=1e-6)


def random_images(count, height, width, seed):
    return np.random.default_rng(seed).integers(0, 1024, (count, height, width, 3)) / 1024  # exact in half precision


def test_a_relit_picture_is_the_weighted_sum(tmp_path):
    lamps, rgb = dome(25, seed=3), sunny_map(48, 24, seed=4)
    images = random_images(25, 18, 30, seed=5)
    write_exr(tmp_path / "map.exr", rgb)
    run("rf", "relight", ingested(tmp_path, lamps, images), "--env", tmp_path / "map.exr", "--rotate", 30, "--exposure", -3, "--float", "-o",
        tmp_path / "relit.exr")
    got = read_exr(tmp_path / "relit.exr")
    weights = weights_by_sampling(rgb, lamps, 30) / 8
    expected = np.einsum("nc,nyxc->yxc", weights, images) / np.pi
    assert np.abs(got[..., :3] / expected - 1).max() < 1e-3
    assert (got[..., 3] == 1).all()


def test_a_point_light_gives_back_the_picture_of_its_lamp(tmp_path):
    lamps, images = dome(12, seed=6), random_images(12, 8, 9, seed=7)
    light = " ".join(f"{v:.6f}" for v in lamps[7] * 3) + " 1 0.5 0"
    run("rf", "relight", ingested(tmp_path, lamps, images), "--light", light, "--float", "-o", tmp_path / "relit.exr")
    np.testing.assert_allclose(read_exr(tmp_path / "relit.exr")[..., :3], images[7] * (1, 0.5, 0), atol=1e-6)


def test_outside_the_mask_the_picture_is_transparent(tmp_path):
    lamps, images = dome(5, seed=8), random_images(5, 6, 8, seed=9)
    mask = np.zeros((6, 8, 3))
    mask[:, 3:] = 1
    write_exr(tmp_path / "mask.exr", mask)
    take = ingested(tmp_path, lamps, images, "--mask", tmp_path / "mask.exr")
    report = json.loads(run("rf", "relight", take, "--light", "0 1 0 1 1 1", "-o", tmp_path / "relit.exr", "--json"))
    relit = read_exr(tmp_path / "relit.exr")
    assert report["targets"][0]["masked_pixels"]["outside"] == 18
    assert (relit[:, :3] == 0).all() and (relit[:, 3:, 3] == 1).all() and relit[:, 3:, :3].sum() > 0


def test_the_number_of_threads_changes_no_byte(tmp_path):
    take = ingested(tmp_path, dome(9, seed=1), random_images(9, 70, 50, seed=2))
    write_exr(tmp_path / "map.exr", sunny_map(48, 24, seed=3))
    for threads in (1, 3):
        run("rf", "relight", take, "--env", tmp_path / "map.exr", "--threads", threads, "-o", tmp_path / f"{threads}.exr")
    assert (tmp_path / "1.exr").read_bytes() == (tmp_path / "3.exr").read_bytes()


def test_bad_input_is_named_and_nothing_is_written(tmp_path):
    take = ingested(tmp_path, dome(5, seed=1), random_images(5, 6, 8, seed=2))
    (tmp_path / "text.exr").write_text("no picture")
    write_exr(tmp_path / "map.exr", np.ones((8, 16, 3)))
    output = tmp_path / "relit.exr"

    def refused(*options, archive=take, to=output):
        return refusal("rf", "relight", archive, *options, "-o", to)

    assert "no light is given" in refused()
    assert "text.exr" in refused("--env", tmp_path / "text.exr")
    assert "nothing.exr" in refused("--env", tmp_path / "nothing.exr")
    assert "six numbers" in refused("--light", "0 1 0 1 1")
    assert "no direction" in refused("--light", "0 0 0 1 1 1")
    assert "not square" in refused("--env", tmp_path / "map.exr", "--env-convention", "angular")
    assert "use openexr, mirrored or angular" in refused("--env", tmp_path / "map.exr", "--env-convention", "cube")
    assert "no finished target 3" in refused("--light", "0 1 0 1 1 1", "--target", 3)
    assert "nowhere.rfa" in refused("--light", "0 1 0 1 1 1", archive=tmp_path / "nowhere.rfa")
    assert "brighter than single precision" in refused("--light", "0 1 0 1e39 1 1")
    assert "nowhere/relit.exr" in refused("--light", "0 1 0 1 1 1", to=tmp_path / "nowhere/relit.exr")
    assert not output.exists() and not list(tmp_path.glob("*.part*"))


def test_values_beyond_half_precision_are_reported(tmp_path):
    take = ingested(tmp_path, dome(5, seed=1), np.ones((5, 6, 8, 3)))
    report = json.loads(run("rf", "relight", take, "--light", "0 1 0 1e6 1 1", "-o", tmp_path / "relit.exr", "--json"))
    assert report["targets"][0]["clamped_values"] == 48
    assert read_exr(tmp_path / "relit.exr")[..., 0].max() == 65504


def test_the_white_furnace_is_white():
    report = json.loads(run("rf", "furnace", "--json"))
    assert report["white_furnace_error"] < 0.002
    assert report["worst_normal_deviation"] < 0.001
    assert abs(report["solid_angle_sr"] - 4 * np.pi) < 1e-9


def test_compare_agrees_with_numpy(tmp_path):
    a, b = (np.random.default_rng(seed).uniform(0, 2, (5, 7, 3)).astype(np.float32) for seed in (1, 2))
    write_exr(tmp_path / "a.exr", a)
    write_exr(tmp_path / "b.exr", b)
    report = json.loads(run("rf", "compare", tmp_path / "a.exr", tmp_path / "b.exr", "--json"))
    error = a.astype(np.float64) - b
    assert report["psnr_db"] == pytest.approx(10 * np.log10(b.max() ** 2 / (error**2).mean()), rel=1e-6)
    assert report["mean_relative"] == pytest.approx(np.abs(error).sum() / b.sum(), rel=1e-6)
    write_exr(tmp_path / "c.exr", a[:4])
    assert "c.exr" in refusal("rf", "compare", tmp_path / "c.exr", tmp_path / "b.exr")
