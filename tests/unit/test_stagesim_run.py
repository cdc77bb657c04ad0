# SPDX-License-Identifier: MIT
"""stagesim as a process: exposures in by socket, frames out by the ring, checked with numpy against the noise model and `stagesim
render`."""
import fcntl
import json
import mmap
import os
import signal
import socket
import struct
import subprocess
import time
from pathlib import Path

import numpy as np
import OpenEXR
import pytest

ROOT = Path(__file__).resolve().parents[2]
STAGESIM = ROOT / "build/host/bin/stagesim"
WIDTH, HEIGHT, BLACK = 96, 72, 64
TICK_NS = 8
F_OFD_SETLK = 37  # linux/fcntl.h
ALL_LAMPS, NO_LAMP = "f" * 39 + "0" * 5, "0" * 44  # 156 of 176 chain bits

SCENE = """
samples = 1
[[material]]
name = "clay"
albedo = [0.6, 0.4, 0.2]
[[object]]
sphere = { radius_m = 0.15 }
material = "clay"
"""


@pytest.fixture
def work(tmp_path):
    (tmp_path / "scene.toml").write_text(SCENE)
    (tmp_path / "stage.toml").write_text(f"[[camera]]\nwidth = {WIDTH}\nheight = {HEIGHT}\n")
    return tmp_path


def exposure(n, bits, exposure_ticks):
    rise = 125_000 + n * 57_870
    fall = rise + exposure_ticks
    return {"type": "exposure", "n": n, "trigger": 0, "rise": rise, "fall": fall,
            "segments": [{"on": rise, "off": fall, "bits": bits}]}


def start(work, *options):
    return subprocess.Popen([STAGESIM, "run", work / "scene.toml", "--stage", work / "stage.toml", "--work", work, "--no-board",
                             *options], stderr=subprocess.PIPE, text=True)


def connect(work, process):
    """As the emulated board does."""
    for _ in range(600):
        client = socket.socket(socket.AF_UNIX)
        try:
            client.connect(str(work / "exposures.sock"))
            return client
        except (FileNotFoundError, ConnectionRefusedError):
            assert process.poll() is None, process.stderr.read()
            time.sleep(0.05)
    raise TimeoutError("stagesim does not listen")


class Ring:
    """The reading end of a ring (host/device/ring.hpp), as its header describes it."""

    def __init__(self, path):
        self.file = open(path, "r+b")
        whole_byte_0 = struct.pack("hhqqi4x", fcntl.F_WRLCK, os.SEEK_SET, 0, 1, 0)
        fcntl.fcntl(self.file, F_OFD_SETLK, whole_byte_0)
        self.map = mmap.mmap(self.file.fileno(), 0)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.map.close()
        self.file.close()

    def start(self, client):
        """As the board, answers the stage that asks whether every earlier exposure is behind."""
        asked = struct.unpack_from("<I", self.map, 140)[0] + 1
        struct.pack_into("<II", self.map, 140, asked, 1)
        question = json.loads(client.makefile().readline())
        assert question["type"] == "sync"
        client.sendall((json.dumps({**question, "tick": 0}) + "\n").encode())
        for _ in range(600):
            if struct.unpack_from("<I", self.map, 96)[0] == asked:
                return
            time.sleep(0.05)
        raise TimeoutError("stagesim does not start the camera")

    def head(self):
        return struct.unpack_from("<Q", self.map, 64)[0]


def read_ring(ring):
    """All frames of a closed ring: (id, camera time in ns, samples)."""
    with ring:
        ring = ring.map
        slots, stride = struct.unpack_from("<II", ring, 8)
        head, watermark_ns, _, _, closed = struct.unpack_from("<QQQII", ring, 64)
        assert closed == 1 and head <= slots
        frames = []
        for n in range(head):
            at = 192 + n * stride
            fields = struct.unpack_from("<IIIIIIQQffQQ", ring, at)
            _, width, height, sample_format, _, _, frame_id, time_ns, _, _, size, _ = fields
            samples = np.frombuffer(ring[at + 64 : at + 64 + size], dtype="<u2" if sample_format == 1 else "<f4")
            frames.append((frame_id, time_ns, samples.reshape(height, width, -1).astype(np.float64)))
        return frames, watermark_ns


def play(work, messages, *options):
    process = start(work, *options)
    with connect(work, process) as client:
        ring = Ring(work / "cam0.ring")
        ring.start(client)
        client.sendall("".join(json.dumps(message) + "\n" for message in messages).encode())
    assert process.wait(timeout=60) == 0, process.stderr.read()
    return read_ring(ring)


def render_counts(work):
    """Counts a microsecond with every sphere lamp on, H x W x 3."""
    out = work / "truth.exr"
    subprocess.run([STAGESIM, "render", work / "scene.toml", "--stage", work / "stage.toml", "--all-lamps", "--unit", "counts",
                    "-o", out], check=True)
    channels = OpenEXR.File(str(out), separate_channels=True).channels()
    return np.stack([channels[c].pixels for c in "RGB"], axis=-1).astype(np.float64)


def mosaic_of(rgb):
    mosaic = rgb[..., 1].copy()
    mosaic[0::2, 0::2] = rgb[0::2, 0::2, 0]
    mosaic[1::2, 1::2] = rgb[1::2, 1::2, 2]
    return mosaic


def test_frames_are_the_rendered_light_with_the_noise_of_the_model(work):
    ticks = 1250  # 10 us: no saturation
    frames, watermark_ns = play(work, [exposure(n, ALL_LAMPS, ticks) for n in range(40)] + [{"type": "now", "tick": 9_999_999}])
    assert [frame_id for frame_id, _, _ in frames] == list(range(1, 41))
    times = np.array([time_ns for _, time_ns, _ in frames], dtype=np.int64)
    assert (np.diff(times) == 57_870 * TICK_NS).all()
    assert watermark_ns - times[0] == (9_999_999 - 125_000) * TICK_NS

    mu = mosaic_of(render_counts(work)) * ticks * TICK_NS / 1000
    sigma = np.sqrt((2.68 + 0.492 * np.sqrt(mu)) ** 2 + 1 / 12)  # and rounding
    assert mu.max() < 4095 - BLACK - 6 * sigma.max()
    normal = np.stack([(samples[..., 0] - BLACK - mu) / sigma for _, _, samples in frames])
    n = normal.size
    assert abs(normal.mean()) < 4 / np.sqrt(n)
    assert abs(normal.var() - 1) < 4 * np.sqrt(2 / n)
    # Frames do not share their noise, nor do neighbouring pixels.
    assert abs((normal[:-1] * normal[1:]).mean()) < 4 / np.sqrt(n)
    assert abs((normal[:, :, :-1] * normal[:, :, 1:]).mean()) < 4 / np.sqrt(n)


def test_without_the_camera_model_frames_are_the_rendered_light(work):
    frames, _ = play(work, [exposure(0, ALL_LAMPS, 50_000), exposure(1, NO_LAMP, 50_000)], "--camera-model", "off")
    truth = render_counts(work) * 400
    assert truth.max() > 4095  # would have saturated
    np.testing.assert_allclose(frames[0][2], truth, rtol=2e-6, atol=1e-4)
    assert (frames[1][2] == 0).all()


def test_the_same_exposures_give_the_same_bits_and_another_seed_does_not(work):
    messages = [exposure(n, ALL_LAMPS, 2000) for n in range(3)]
    first, again = play(work, messages)[0], play(work, messages)[0]
    assert all((a[2] == b[2]).all() for a, b in zip(first, again))
    (work / "scene.toml").write_text("seed = 2\n" + SCENE)
    assert all((a[2] != b[2]).any() for a, b in zip(first, play(work, messages)[0]))


def test_sigterm_ends_it_in_order_with_its_account(work):
    process = start(work)
    with connect(work, process) as client:
        ring = Ring(work / "cam0.ring")
        ring.start(client)
        client.sendall((json.dumps(exposure(0, ALL_LAMPS, 2000)) + "\n").encode())
        for _ in range(600):
            if ring.head() == 1:
                break
            time.sleep(0.05)
        os.kill(process.pid, signal.SIGTERM)
        assert process.wait(timeout=30) == 0
    actual = json.loads((work / "cost.json").read_text())["actual"]
    assert actual["triggers"] == actual["frames_delivered"] == 1
    assert read_ring(ring)[0][0][0] == 1


def test_frames_that_nobody_has_asked_for_are_counted_and_said_and_none_waits(work):
    """Many more than the ring has room for; and the count of ids and the truth go on."""
    process = start(work)
    with connect(work, process) as client:
        lines = [exposure(n, ALL_LAMPS, 2000) for n in range(1000)]
        client.sendall("".join(json.dumps(message) + "\n" for message in lines).encode())
        ring = Ring(work / "cam0.ring")
        ring.start(client)
        client.sendall((json.dumps(exposure(1000, ALL_LAMPS, 2000)) + "\n").encode())
    assert process.wait(timeout=60) == 0
    assert [frame_id for frame_id, _, _ in read_ring(ring)[0]] == [1001]
    assert "nobody records from camera 0" in process.stderr.read()
    actual = json.loads((work / "cost.json").read_text())["actual"]
    assert actual["frames_unwanted"] == 1000 and actual["frames_delivered"] == 1
    assert len((work / "cam0.frames.jsonl").read_text().splitlines()) == 1001


@pytest.mark.parametrize("arguments, message", [
    (["--image", "none.elf"], "there is no firmware image 'none.elf'"),
    (["--no-board", "--inject", "none.toml"], "none.toml"),
    (["--no-board", "--stage", "none.toml"], "none.toml"),
    (["--no-board", "--camera", "4"], "--camera 4"),
])
def test_mistakes_are_named(work, arguments, message):
    done = subprocess.run([STAGESIM, "run", work / "scene.toml", "--work", work, *arguments], capture_output=True, text=True)
    assert done.returncode == 1
    assert message in done.stderr


def test_a_line_that_is_no_message_is_quoted(work):
    process = start(work)
    with connect(work, process) as client:
        client.sendall(b'{"type":"exposure","rise":-1}\n')
        assert process.wait(timeout=30) == 1
    assert '"rise":-1' in process.stderr.read()
