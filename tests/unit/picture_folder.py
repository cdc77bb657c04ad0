# SPDX-License-Identifier: MIT
# A folder of pictures, and what `stagectl ingest` makes of it.
import json
import pathlib
import subprocess

import numpy as np
import OpenEXR
import pytest
from PIL import Image

STAGECTL = pathlib.Path(__file__).resolve().parents[2] / "build/host/bin/stagectl"
HEIGHT, WIDTH = 18, 26
GENERATOR = np.random.default_rng(15)
CODES16 = GENERATOR.integers(0, 65536, (HEIGHT, WIDTH, 3), dtype=np.uint16)
CODES8 = (CODES16 >> 8).astype(np.uint8)
GREY16, GREY8 = CODES16[:, :, 0], CODES8[:, :, 0]
ALPHA8 = GENERATOR.integers(0, 256, (HEIGHT, WIDTH), dtype=np.uint8)


def linear_of(code):
    """IEC 61966-2-1."""
    code = np.asarray(code, np.float64)
    return np.where(code <= 0.04045, code / 12.92, ((code + 0.055) / 1.055) ** 2.4)


SRGB8, SRGB16 = linear_of(CODES8 / 255), linear_of(CODES16 / 65535)


class Folder:
    """A folder of pictures, and what becomes of them."""

    def __init__(self, path):
        self.path = path / "photos"
        self.path.mkdir()
        self.archive = path / "take.rfa"
        self.lights = path / "lights.lp"

    def add(self, name, content):
        path = self.path / name
        if isinstance(content, bytes):
            path.write_bytes(content)
        elif isinstance(content, np.ndarray):
            Image.fromarray(content).save(path)
        return path

    def run(self, *options, names=None):
        names = names or sorted(p.name for p in self.path.iterdir())
        if not self.lights.exists():
            lines = [f"{name} {np.cos(i)} {np.sin(i)} 1" for i, name in enumerate(names)]
            self.lights.write_text("\n".join([str(len(names)), *lines, ""]))
        command = [STAGECTL, "ingest", self.path, "--lights", self.lights, "--float", "--overwrite", "--json", "-o", self.archive]
        done = subprocess.run([*map(str, command), *map(str, options)], capture_output=True, text=True, timeout=60)
        assert done.returncode in (0, 1), (done.returncode, done.stderr)
        return done

    def light(self, *options, names=None):
        """[lamp, height, width(, 3)], and keeps the report."""
        done = self.run(*options, names=names)
        assert done.returncode == 0, done.stderr
        self.report = json.loads(done.stdout)
        lamps = OpenEXR.File(str(self.archive / "cam0/target_000000.exr"), separate_channels=True).parts[0].channels
        count = self.report["lamps"]
        if self.report["color"]:
            return np.stack([np.stack([lamps[f"lamp_{i:03}.{c}"].pixels for c in "RGB"], 2) for i in range(count)])
        return np.stack([lamps[f"lamp_{i:03}.Y"].pixels for i in range(count)])

    def refusal(self, *options):
        done = self.run(*options)
        assert done.returncode == 1, done.stdout
        assert not self.archive.exists()
        return done.stderr.strip()

    def said(self):
        return " ".join(self.report["said"])


@pytest.fixture
def folder(tmp_path):
    return Folder(tmp_path)


def near(found, truth, tolerance=2e-6):
    assert found.shape == truth.shape
    assert np.abs(found - truth).max() <= tolerance, np.abs(found - truth).max()
