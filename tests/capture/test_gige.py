# SPDX-License-Identifier: MIT
# The virtual stage's camera over GigE Vision on the loopback: the same take as by its ring, and what Aravis' own tool sees of it.
import subprocess
import sys

import numpy as np

from virtual_take import ROOT, VirtualStage, read_lamps, read_plane

sys.path.append(str(ROOT / "tests/gige"))
from gige_camera import GigeCamera  # noqa: E402


def take(stage, archive, camera):
    # The card is brighter than skin, which the examples' exposures are for.
    sequence = stage.folder / "sequence.toml"
    sequence.write_text('basis = "s159"\ncycles = 1\nexposure_us = { basis = 50, tracking = 20 }\n')
    options = ["--sequence", sequence, "--nominal", "--patience", 200, "-o", archive, "--json"]
    return stage.stagectl("run", *options, camera=camera)


def features(address):
    """What arv-tool reads of the camera's features."""
    names = ["DeviceModelName", "Width", "Height", "PixelFormat", "TriggerMode", "TriggerSource"]
    done = subprocess.run(
        ["arv-tool-0.8", "-a", address, "control", *names], capture_output=True, text=True, timeout=120
    )
    assert done.returncode == 0, done.stderr
    lines = (line.split(" = ") for line in done.stdout.splitlines() if " = " in line)
    return {name: value.split()[0] for name, value in lines}  # "64 min:8 max:2048"


def test_a_take_over_gige_vision_is_that_of_the_ring_bit_for_bit(tmp_path):
    ring, gige = tmp_path / "ring.rfa", tmp_path / "gige.rfa"
    with VirtualStage(tmp_path / "a", "card.toml") as stage:
        take(stage, ring, True)
    with VirtualStage(tmp_path / "b", "card.toml") as stage, GigeCamera(stage.folder / "cam0.ring") as camera:
        assert features(camera.address)["DeviceModelName"] == "Line"
        report = take(stage, gige, f"aravis:{camera.address}")
        seen = features(camera.address)  # as the take left it
    assert report["slots_missing"] == 0
    (account,) = report["cameras"]
    assert (account["frames"], account["missing_ids"], account["underrun"]) == (180, 0, 0), account
    assert account["link"].startswith("GigE Vision, " + seen["PixelFormat"]), account
    assert seen["Width"] == "64" and seen["Height"] == "48", seen
    assert seen["PixelFormat"] in ("BayerRG12p", "BayerRG12Packed"), seen
    assert seen["TriggerMode"] == "On", seen
    mask = read_plane(ring, 0, "mask")
    assert np.array_equal(mask, read_plane(gige, 0, "mask")) and np.mean(mask == 0) > 0.9
    lamps = read_lamps(ring, 0)
    assert np.array_equal(lamps, read_lamps(gige, 0)) and np.abs(lamps).max() > 0.1
