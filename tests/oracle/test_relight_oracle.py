# SPDX-License-Identifier: MIT
"""Lamp weights and relit pictures against numpy that shares no code with them: a map is sampled densely and every sample goes to
the lamp with the largest cosine."""
import json
import subprocess
from pathlib import Path

import numpy as np
import OpenEXR
import pytest

ROOT = Path(__file__).resolve().parents[2]
BIN = ROOT / "build/host/bin"


def run(program, *arguments):
    return subprocess.run([BIN / program, *map(str, arguments)], capture_output=True, text=True, check=True).stdout


def write_exr(path, rgb):
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    channels = {name: np.ascontiguousarray(rgb[..., c], dtype=np.float32) for c, name in enumerate("RGB")}
    OpenEXR.File(header, channels).write(str(path))


def read_exr(path):
    channels = OpenEXR.File(str(path), separate_channels=True).channels()
    return np.stack([channels[name].pixels for name in "RGBA"], axis=-1).astype(np.float64)


def dome(count, seed):
    """Directions above -20 degrees of elevation: not a whole sphere, and nothing regular."""
    generator = np.random.default_rng(seed)
    directions = generator.normal(size=(count * 3, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    return directions[directions[:, 1] > -0.34][:count]


def write_lp(path, names, directions):
    lines = [f"{name} {x:.9f} {y:.9f} {z:.9f}" for name, (x, y, z) in zip(names, directions)]
    path.write_text(f"{len(lines)}\n" + "\n".join(lines) + "\n")


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


def test_a_relit_picture_is_the_weighted_sum(tmp_path):
    lamps, rgb = dome(25, seed=3), sunny_map(48, 24, seed=4)
    images = np.random.default_rng(5).integers(0, 1024, (len(lamps), 18, 30, 3)) / 1024  # exact in half precision
    folder = tmp_path / "photographs"
    folder.mkdir()
    names = [f"photograph_{i:02}.exr" for i in range(len(lamps))]
    for name, image in zip(names, images):
        write_exr(folder / name, image)
    write_lp(tmp_path / "lights.lp", names, lamps)
    write_exr(tmp_path / "map.exr", rgb)
    run("stagectl", "ingest", folder, "--lights", tmp_path / "lights.lp", "-o", tmp_path / "take.rfa")
    run("rf", "relight", tmp_path / "take.rfa", "--env", tmp_path / "map.exr", "--rotate", 30, "--exposure", -3, "--float", "-o",
        tmp_path / "relit.exr")
    got = read_exr(tmp_path / "relit.exr")
    weights = weights_by_sampling(rgb, lamps, 30) / 8
    expected = np.einsum("nc,nyxc->yxc", weights, images) / np.pi
    assert np.abs(got[..., :3] / expected - 1).max() < 1e-3
    assert (got[..., 3] == 1).all()


def test_a_point_light_gives_back_the_photograph_of_its_lamp(tmp_path):
    lamps = dome(12, seed=6)
    images = np.random.default_rng(7).integers(0, 1024, (len(lamps), 8, 9, 3)) / 1024
    folder = tmp_path / "photographs"
    folder.mkdir()
    names = [f"photograph_{i:02}.exr" for i in range(len(lamps))]
    for name, image in zip(names, images):
        write_exr(folder / name, image)
    write_lp(tmp_path / "lights.lp", names, lamps)
    run("stagectl", "ingest", folder, "--lights", tmp_path / "lights.lp", "-o", tmp_path / "take.rfa")
    light = " ".join(f"{v:.6f}" for v in lamps[7] * 3) + " 1 0.5 0"
    run("rf", "relight", tmp_path / "take.rfa", "--light", light, "--float", "-o", tmp_path / "relit.exr")
    np.testing.assert_allclose(read_exr(tmp_path / "relit.exr")[..., :3], images[7] * (1, 0.5, 0), atol=1e-6)


def test_the_white_furnace_is_white(tmp_path):
    report = json.loads(run("rf", "furnace"))
    assert report["white_furnace_error"] < 0.002
    assert report["worst_normal_deviation"] < 0.001
    assert abs(report["solid_angle_sr"] - 4 * np.pi) < 1e-9
