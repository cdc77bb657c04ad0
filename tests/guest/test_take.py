# SPDX-License-Identifier: MIT
"""A whole take in the guest, by the kernel's own interfaces at once: the virtual stage's board on USB, its frames over V4L2, the take
armed by a button on GPIO, the lamp nodes watched on CAN. Its targets are those of a take over the stage's own socket and ring."""
import base64
import contextlib
import io
import json
import re
import socket
import subprocess
import sys
import tarfile
import threading
import time

import numpy as np
import pytest
from conftest import INSIDE, ROOT, STAGECTL

sys.path.append(str(ROOT / "tests/capture"))
from virtual_take import HEIGHT, SMALL_STAGE, WIDTH, VirtualStage, read_lamps  # noqa: E402

COPY_RING = ROOT / "build/host/bin/copy_ring"
DEVICE = "/dev/video10"
# Frames are told from one another by their times, to a twentieth of a period, and a machine that emulates another stalls for milliseconds.
LAMPS, RATE_HZ, CYCLES = 8, 1, 2
LATE_S = 0.03  # a take with a frame that is shown later is played again
SEQUENCE = f'basis = "single"\nframe_rate_hz = {RATE_HZ}\n'
STAGE = SMALL_STAGE + """[lamps]
lp = "lights.lp"
[gpio]
chip = "stage-lines"
[gpio.arm]
line = "ARM"
[gpio.tally]
line = "TALLY"
[telemetry]
bus = "can:vcan0"
"""


def scene(folder):
    """The spheres before the matte board: with single lamps nothing else tells one place in the cycle from the next."""
    path = folder / "scene.toml"
    path.write_text((ROOT / "tools/stagesim/scenes/spheres.toml").read_text() + "\n[board]\n")
    return path


def ring_of_lights():
    angles = 2 * np.pi * np.arange(LAMPS) / LAMPS
    return f"{LAMPS}\n" + "".join(f"lamp{n} {np.cos(a) / 2:.6f} {np.sin(a) / 2:.6f} {np.sqrt(0.75):.6f}\n" for n, a in enumerate(angles))


class TakeStage(VirtualStage):
    """A virtual stage of few lamps, without its board: that one keeps in step with the guest."""

    def __init__(self, folder):
        folder.mkdir()
        (folder / "lights.lp").write_text(ring_of_lights())
        super().__init__(folder, scene(folder), "--no-board", stage=STAGE)

    def __enter__(self):
        while not (self.folder / "exposures.sock").exists():
            assert self.process.poll() is None, self.read_log()
        return self


@pytest.fixture
def loopback(guest):
    guest.load("v4l2loopback", "devices=1 video_nr=10 max_buffers=32")
    started = []

    def start(*command):
        started.append(guest.start([sys.executable, *command]))
        return started[-1]

    yield start
    for one in started:
        one.end()
    guest.unload("v4l2loopback")


class Frames:
    """The virtual stage's frames, on their way to the device in the guest."""

    def __init__(self, stage, loopback):
        self.feeder = loopback(INSIDE / "feed_loopback.py", DEVICE, "RG12", WIDTH, HEIGHT, 2)
        self.feeder.wait_for("ready")
        self.copy = subprocess.Popen([COPY_RING, stage.folder / "cam0.ring"], stdout=subprocess.PIPE, stderr=subprocess.PIPE)
        assert self.copy.stderr.readline() == b"started\n"
        self.pump = threading.Thread(target=self._pump, daemon=True)
        self.pump.start()

    def _pump(self):
        try:
            while part := self.copy.stdout.read1(65536):
                self.feeder.input.sendall(part)
        except OSError:
            pass  # the feeder has ended

    def latest_s(self):
        """How late the latest frame was shown. None comes after it."""
        self._end()
        self.feeder.input.shutdown(socket.SHUT_WR)
        self.feeder.wait()
        return float(re.search(r"the latest (\S+) s late", self.feeder.output)[1])

    def _end(self):
        self.copy.kill()
        self.copy.wait()
        self.pump.join()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self._end()
        self.copy.stdout.close()
        self.copy.stderr.close()


def fetched(guest, folder):
    packed = guest.run(["sh", "-c", "tar -C /tmp -c take.rfa | base64 -w0; rm -rf /tmp/take.rfa"]).stdout
    with tarfile.open(fileobj=io.BytesIO(base64.b64decode(packed))) as tar:
        tar.extractall(folder, filter="data")
    return folder / "take.rfa"


class Take:
    """stagectl in the guest, which waits for the button; the stage's frames and wires."""

    def __init__(self, process, frames, wires):
        self.process, self.frames, self.wires = process, frames, wires


@pytest.fixture
def run(guest, emulated, usb, port, bus, chip, loopback, tmp_path):
    """Plays takes. One in which a frame was shown so late that it cannot be told from its neighbours is no test of stagectl: the
    machine stalled, and the take is played again."""
    sequence = tmp_path / "sequence.toml"
    sequence.write_text(SEQUENCE)

    def begin(cycles, opened, folder):
        guest.run(["rm", "-rf", "/tmp/take.rfa"])
        chip.pull("ARM", False)
        stage = opened.enter_context(TakeStage(folder))
        frames = opened.enter_context(Frames(stage, loopback))
        board = emulated("--lamp-nodes", "--exposures", stage.folder / "exposures.sock")
        opened.callback(emulated.end, board)
        wires = bus(board)
        usb(board)
        opened.callback(port.unplug)
        process = guest.start([STAGECTL, "run", "--sequence", sequence, "--nominal", "--cycles", cycles, "--stage", stage.stage, "--board",
                               "usb:", "--camera", f"v4l2:{DEVICE}", "--arm", "--json", "-o", "/tmp/take.rfa"])
        opened.callback(process.end)
        process.wait_for("waiting for the arm button")
        return Take(process, frames, wires)

    def play(cycles, to_its_end):
        """The take's process and what `to_its_end` says of it."""
        late = []
        for attempt in range(3):
            with contextlib.ExitStack() as opened:
                take = begin(cycles, opened, tmp_path / f"take{attempt}")
                said = to_its_end(take)
                late.append(take.frames.latest_s())
            if late[-1] < LATE_S:
                return take.process, said
        raise TimeoutError(f"this machine stalls: frames were shown {late} s late")

    return play


def test_a_take_by_usb_v4l2_gpio_and_can_has_the_targets_of_one_over_socket_and_ring(guest, chip, run, tmp_path):
    def to_its_end(take):
        assert not chip.value("TALLY")
        chip.pull("ARM", True)
        while not chip.value("TALLY") and take.process.returncode is None:
            pass
        take.process.wait(600)
        return {can_id for can_id, _ in take.wires.candump() if 0x200 <= can_id < 0x220}

    process, nodes = run(CYCLES, to_its_end)
    assert process.returncode == 0, process.errors
    assert not chip.value("TALLY")
    assert json.loads(process.output)["causes"] == {}, process.output
    assert nodes == {0x200 + node for node in range(11)}
    archive = fetched(guest, tmp_path)

    lights = tmp_path / "lights.lp"
    lights.write_text(ring_of_lights())
    with VirtualStage(tmp_path / "ring", scene(tmp_path), stage=SMALL_STAGE + f'[lamps]\nlp = "{lights}"\n') as stage:
        stage.stagectl("run", "--sequence", tmp_path / "sequence.toml", "--nominal", "--cycles", CYCLES, "-o", tmp_path / "ring.rfa")
    for target in range(CYCLES):
        ours, wanted = read_lamps(archive, target), read_lamps(tmp_path / "ring.rfa", target)
        assert wanted.size and np.array_equal(ours, wanted), target


def test_a_board_that_is_unplugged_in_a_take_is_the_cause_of_what_is_missing_and_the_rest_is_kept(guest, port, chip, run, tmp_path):
    def to_its_end(take):
        chip.pull("ARM", True)
        while guest.run(["test", "-e", "/tmp/take.rfa/cam0/target_000000.exr"]).returncode and take.process.returncode is None:
            time.sleep(1)
        port.unplug()
        take.process.wait()

    process, _ = run(50, to_its_end)
    assert process.returncode == 2, process.errors
    assert "unplugged" in process.errors and not chip.value("TALLY"), process.errors
    report = json.loads(process.output)
    assert report["board_end"]["cause"] == "board_gone", process.output
    assert max(report["causes"], key=report["causes"].get) == "board_gone", process.output
    assert read_lamps(fetched(guest, tmp_path), 0).any()
