# SPDX-License-Identifier: MIT
# A virtual stage as a child process, and stagectl played against it.
import json
import pathlib
import subprocess
import time

import numpy as np
import OpenEXR

ROOT = pathlib.Path(__file__).resolve().parents[2]
BIN = ROOT / "build/host/bin"
IMAGE = ROOT / "build/firmware/stage.elf"
BOARD = ROOT / "tools/stagesim/board"
SCENES = ROOT / "tools/stagesim/scenes"
EXAMPLES = ROOT / "examples"

WIDTH, HEIGHT = 64, 48
SMALL_STAGE = f"[[camera]]\nwidth = {WIDTH}\nheight = {HEIGHT}\n"


class VirtualStage:
    """stagesim with a small camera; use it with `with`."""

    def __init__(self, folder, scene, *options, stage=SMALL_STAGE):
        folder.mkdir(parents=True, exist_ok=True)
        self.folder, self.stage = folder, folder / "stage.toml"
        self.stage.write_text(stage)
        self.log = (folder / "stagesim.log").open("w+")
        command = [BIN / "stagesim", "run", SCENES / scene, "--stage", self.stage, "--work", folder, *options]
        self.process = subprocess.Popen(list(map(str, command)), stdout=self.log, stderr=self.log)

    def __enter__(self):
        deadline = time.monotonic() + 120
        while not (self.folder / "board.sock").exists():
            assert self.process.poll() is None and time.monotonic() < deadline, self.read_log()
            time.sleep(0.05)
        return self

    def __exit__(self, *_):
        self.process.terminate()
        self.process.wait(30)
        self.log.close()

    def read_log(self):
        self.log.seek(0)
        return self.log.read()

    def command(self, verb, *arguments, camera=True):
        links = ["--stage", self.stage, "--board", f"socket:{self.folder}/board.sock"]
        source = f"ring:{self.folder}/cam0.ring" if camera is True else camera
        links += ["--camera", source] if source else []
        return list(map(str, [BIN / "stagectl", verb, *links, *arguments]))

    def stagectl(self, verb, *arguments, code=0, camera=True):
        """Runs a verb to its end and returns what it printed, as JSON when asked for."""
        done = subprocess.run(
            self.command(verb, *arguments, camera=camera), capture_output=True, text=True, timeout=300
        )
        assert done.returncode == code, (done.returncode, done.stdout, done.stderr, self.read_log())
        return json.loads(done.stdout) if "--json" in arguments else done.stdout + done.stderr


def sequence(basis):
    return EXAMPLES / f"sequence_{basis}.toml"


def slots_of(basis):
    """The compiled cycle, as stagectl tells it."""
    done = subprocess.run([BIN / "stagectl", "sequence", sequence(basis), "--json"], capture_output=True, check=True)
    return json.loads(done.stdout)["slots"]


def manifest(archive):
    return json.loads((archive / "manifest.json").read_text())


def missing_slots(archive, camera=0):
    """Ranges of triggers without a frame, each with cause and witnesses."""
    return identification(archive)["cameras"][camera]["missing"]


def missing_triggers(archive, camera=0):
    ranges = missing_slots(archive, camera)
    return {first for r in ranges for first in range(r["first_trigger"], r["first_trigger"] + r["count"])}


def identification(archive):
    return manifest(archive)["extra"]["identification"]


def target_file(archive, index, camera=0):
    return archive / f"cam{camera}" / f"target_{index:06}.exr"


def read_lamps(archive, index, channel="Y", camera=0):
    """[lamp, y, x] of a target."""
    for part in OpenEXR.File(str(target_file(archive, index, camera)), separate_channels=True).parts:
        if part.header["name"] == "lamps":
            names = sorted(name for name in part.channels if name.endswith("." + channel))
            return np.stack([part.channels[name].pixels for name in names]).astype(np.float64)
    raise AssertionError("no part of lamps")


def read_plane(archive, index, name):
    """[y, x] of a target's part of one channel: mask, variance, noise_gain."""
    for part in OpenEXR.File(str(target_file(archive, index)), separate_channels=True).parts:
        if part.header["name"] == name:
            return part.channels["Y"].pixels
    raise AssertionError(f"no part {name}")


def verify(archive):
    return subprocess.run([BIN / "rf", "verify", archive], capture_output=True, text=True)
