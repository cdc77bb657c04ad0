# SPDX-License-Identifier: MIT
"""A whole take over V4L2: the virtual stage's frames, written into v4l2loopback when they are due, recorded by stagectl in the guest;
the same targets come out as of a take over the stage's own ring."""
import base64
import io
import socket
import subprocess
import sys
import tarfile
import threading

import numpy as np
import pytest
from conftest import INSIDE, ROOT, STAGECTL

sys.path.append(str(ROOT / "tests/capture"))
from virtual_take import HEIGHT, WIDTH, VirtualStage, read_lamps  # noqa: E402

COPY_RING = ROOT / "build/host/bin/copy_ring"
DEVICE = "/dev/video10"
RATE_HZ, CYCLES = 8, 2
SEQUENCE = f"basis = \"single\"\nframe_rate_hz = {RATE_HZ}\n"


def pump(read, write):
    """Bytes from one end to the other, until either ends."""
    try:
        while part := read(65536):
            write(part)
    except OSError:
        pass


def join(connection, path):
    """A connection from the guest to a socket of the host's."""
    far = socket.socket(socket.AF_UNIX)
    far.connect(str(path))
    threading.Thread(target=pump, args=(far.recv, connection.sendall), daemon=True).start()
    pump(connection.recv, far.sendall)
    far.close()


@pytest.fixture
def device(guest):
    guest.load("v4l2loopback", "devices=1 video_nr=10 max_buffers=32")
    started = []

    def start(*command):
        started.append(guest.start([sys.executable, *command]))
        return started[-1]

    yield start
    for one in started:
        one.end()
    guest.unload("v4l2loopback")


def take(archive_bytes, folder):
    with tarfile.open(fileobj=io.BytesIO(archive_bytes)) as tar:
        tar.extractall(folder, filter="data")
    return folder / "take.rfa"


def test_a_take_over_v4l2loopback_has_the_targets_of_one_over_the_ring(guest, device, tmp_path):
    sequence = tmp_path / "sequence.toml"
    sequence.write_text(SEQUENCE)
    run = ["run", "--sequence", sequence, "--nominal", "--cycles", CYCLES]
    with VirtualStage(tmp_path / "ring", "card.toml") as stage:
        stage.stagectl(*run, "-o", tmp_path / "ring.rfa")

    with VirtualStage(tmp_path / "v4l2", "card.toml") as stage:
        guest.channel("board", lambda connection: join(connection, stage.folder / "board.sock"))
        device(INSIDE / "relay_socket.py", "/tmp/board.sock", "board").wait_for("listens")
        feeder = device(INSIDE / "feed_loopback.py", DEVICE, "RG12", WIDTH, HEIGHT, 2)
        feeder.wait_for("ready")
        copy = subprocess.Popen([COPY_RING, stage.folder / "cam0.ring"], stdout=subprocess.PIPE, stderr=subprocess.PIPE)
        try:
            assert copy.stderr.readline() == b"started\n"
            threading.Thread(target=pump, args=(copy.stdout.read1, feeder.input.sendall), daemon=True).start()
            done = guest.run([STAGECTL, *run, "--stage", stage.stage, "--board", "socket:/tmp/board.sock", "--camera", f"v4l2:{DEVICE}",
                              "-o", "/tmp/take.rfa"], timeout=900)
        finally:
            copy.kill()
            copy.wait()
    assert done.returncode == 0, done.stdout + done.stderr
    packed = guest.run(["sh", "-c", "tar -C /tmp -c take.rfa | base64 -w0"]).stdout
    archive = take(base64.b64decode(packed), tmp_path)
    for target in range(CYCLES):
        ours, wanted = read_lamps(archive, target), read_lamps(tmp_path / "ring.rfa", target)
        assert wanted.size and np.array_equal(ours, wanted), target
