# SPDX-License-Identifier: MIT
# README's "Using it", and a first take with the daemon of docs/operating.md, run as they are printed.
import json
import re
import subprocess

import numpy as np
from PIL import Image

from virtual_take import ROOT


def using_it():
    """The first block of commands under that heading."""
    section = (ROOT / "README.md").read_text().split("\n## Using it\n")[1].split("\n## ")[0]
    return re.search(r"^```\n(.*?)^```$", section, re.MULTILINE | re.DOTALL)[1]


def clone(folder):
    """What a clone holds after `make`, with an empty `out`."""
    for entry in ROOT.iterdir():
        if entry.name not in ("out", ".git"):
            (folder / entry.name).symlink_to(entry)
    return folder


def test_the_block_using_it_runs_as_printed_and_gives_the_picture_at_the_top(tmp_path):
    # A reader's shell would go on after a command that failed: here each has to succeed.
    done = subprocess.run(
        ["bash", "-euo", "pipefail", "-c", using_it() + "wait\n"],
        cwd=clone(tmp_path), capture_output=True, text=True, timeout=1800,
    )
    assert done.returncode == 0, done.stdout + done.stderr

    # demo.jpg shows three pictures of 640 x 480, each from column 140 to 500 and row 40 to 480; this is the third.
    top = np.asarray(Image.open(ROOT / "docs/images/demo.jpg").convert("RGB"), np.float64)[:, 720:]
    relit = np.asarray(Image.open(tmp_path / "out/relit.png").convert("RGB"), np.float64)[40:480, 140:500]
    # JPEG alone is some 40 dB away; another light, subject or crop less than 20.
    assert 10 * np.log10(255**2 / np.mean((top - relit) ** 2)) > 34
    assert len(list((tmp_path / "out/lamps").glob("*.exr"))) == 156
    assert (tmp_path / "out/sheet.png").exists()


def first_take():
    """The block for the virtual stage."""
    section = (ROOT / "docs/operating.md").read_text().split("\n## A first take\n")[1].split("\n## ")[0]
    return re.findall(r"^```\n(.*?)^```$", section, re.MULTILINE | re.DOTALL)[-1]


def test_a_first_take_of_operating_runs_as_printed(tmp_path):
    done = subprocess.run(
        ["bash", "-u", "-c", first_take()], cwd=clone(tmp_path), capture_output=True, text=True, timeout=600
    )
    said = done.stdout + done.stderr
    shoot = tmp_path / "out/shoot"
    take = json.loads((shoot / "take.json").read_text())
    assert take["targets_missing"] == take["slots_missing_total"] == 0 and take["targets_written"] >= 2, said
    # The head is lit from the upper left of the picture, and stands before black.
    look = np.asarray(Image.open(shoot / "look.png").convert("L"), np.float64)
    assert look.shape == (120, 160) and look[:, :8].mean() < 20 < 60 < look[30:90, 50:80].mean(), said
    assert "finished" in done.stdout and (shoot / "calibration/cam0/flat.exr").exists()
