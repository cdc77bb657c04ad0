# SPDX-License-Identifier: MIT
"""What the tests of relighting share: running the programs, the files they take, and skies."""
import json
import subprocess
from pathlib import Path

import numpy as np
import OpenEXR

ROOT = Path(__file__).resolve().parents[2]
BIN = ROOT / "build/host/bin"
MAP_HEIGHT = 128


def run(program, *arguments):
    """Standard output of a program that must succeed."""
    done = subprocess.run([BIN / program, *map(str, arguments)], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return done.stdout


def refusal(program, *arguments):
    """Standard error of a program that must end with exit code 1."""
    done = subprocess.run([BIN / program, *map(str, arguments)], capture_output=True, text=True)
    assert done.returncode == 1, (done.returncode, done.stdout, done.stderr)
    return done.stderr


def write_exr(path, rgb):
    channels = {name: np.ascontiguousarray(rgb[..., c], dtype=np.float32) for c, name in enumerate("RGB")}
    OpenEXR.File({"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}, channels).write(str(path))


def read_exr(path, names="RGBA"):
    channels = OpenEXR.File(str(path), separate_channels=True).channels()
    return np.stack([channels[name].pixels for name in names], axis=-1).astype(np.float64)


def write_lp(path, names, directions):
    lines = [f"{name} {x:.9f} {y:.9f} {z:.9f}" for name, (x, y, z) in zip(names, directions)]
    path.write_text(f"{len(lines)}\n" + "\n".join(lines) + "\n")


def ingested(folder, lamps, images, *options):
    """An archive of these OLAT images, one for each lamp."""
    pictures = folder / "pictures"
    pictures.mkdir(parents=True)
    names = [f"picture_{i:03}.exr" for i in range(len(lamps))]
    for name, image in zip(names, images):
        write_exr(pictures / name, image)
    write_lp(folder / "lights.lp", names, lamps)
    run("stagectl", "ingest", pictures, "--lights", folder / "lights.lp", "-o", folder / "take.rfa", *options)
    return folder / "take.rfa"


def stage_lamps(folder):
    """The directions of the stage's lamps, as rf tells them."""
    write_exr(folder / "white.exr", np.ones((64, 128, 3)))
    report = json.loads(run("rf", "weights", "--env", folder / "white.exr", "--json"))
    return np.array([lamp["direction"] for lamp in report["lamps"]])


def texels():
    """Direction and solid angle of each texel of a sky, seen from inside: +Z in the middle, +X left of it."""
    height, width = MAP_HEIGHT, 2 * MAP_HEIGHT
    latitude = np.pi * (0.5 - (np.arange(height) + 0.5) / height)[:, None]
    longitude = np.pi * (1 - 2 * (np.arange(width) + 0.5) / width)[None, :]
    directions = np.broadcast_arrays(np.cos(latitude) * np.sin(longitude), np.sin(latitude), np.cos(latitude) * np.cos(longitude))
    edges = np.sin(np.pi * (0.5 - np.arange(height + 1) / height))
    steradians = (edges[:-1] - edges[1:])[:, None] * 2 * np.pi / width * np.ones_like(longitude)
    return np.stack(directions), steradians


def sky(with_sun):
    """A smooth coloured sky over dark ground. A sun of 5 degrees adds a third of the light."""
    (x, up, z), steradians = texels()
    base = 0.15 + 0.85 / (1 + np.exp(-6 * up))
    rgb = base[..., None] * np.stack([0.7 + 0.4 * x, 0.8 + 0 * x, 1.0 - 0.3 * x], axis=-1)
    if with_sun:
        disc = (np.abs(np.arcsin(up) - 0.7) < 0.04) & (np.abs(np.arctan2(x, z) - 1.0) < 0.04)
        rgb[disc] += 0.5 * (rgb * steradians[..., None]).sum(axis=(0, 1)) / steradians[disc].sum()
    return rgb


def cell_means(rgb, lamps):
    """The map as 156 lamps can know it: each lamp's cell has its mean radiance."""
    directions, steradians = texels()
    nearest = np.argmax(np.tensordot(lamps, directions, axes=1), axis=0)
    area = np.bincount(nearest.ravel(), steradians.ravel(), minlength=len(lamps))
    means = [np.bincount(nearest.ravel(), (rgb[..., c] * steradians).ravel(), minlength=len(lamps)) / area for c in range(3)]
    return np.stack(means, axis=-1)[nearest]
