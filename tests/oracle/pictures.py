# SPDX-License-Identifier: MIT
"""What the tests of relighting share: running the programs, and the files they take."""
import subprocess
from pathlib import Path

import numpy as np
import OpenEXR

ROOT = Path(__file__).resolve().parents[2]
BIN = ROOT / "build/host/bin"


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
