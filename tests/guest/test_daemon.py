# SPDX-License-Identifier: MIT
"""The daemon on the kernel's own USB and V4L2: board and camera are unplugged in each state, are named, are let go of, and are taken
again when they are back. The camera is vivid, which shows its pictures whatever the board asks for: of frames nothing is said here."""
import json

import pytest
from conftest import STAGECTL

FOLDER = "/tmp/shoot"
ENVIRONMENT = {"STAGECTL_SOCKET": f"{FOLDER}/control.sock"}
STAGE = f"""[board]
link = "usb:"
[daemon]
socket = "control.sock"
takes = "takes"
sequences = "."
sequence = "slow"
seconds = 60
nominal = true
reserve_mb = 1
[[camera]]
source = "v4l2:0"
cfa = "none"
bits = 8
width = 320
height = 180
"""
SEQUENCE = 'basis = "single"\nframe_rate_hz = 10\n'


class Daemon:
    """In the guest."""

    def __init__(self, guest):
        self.guest = guest
        for name, text in (("stage.toml", STAGE), ("slow.toml", SEQUENCE)):
            written = guest.run(["sh", "-c", f"mkdir -p {FOLDER}; cat > {FOLDER}/{name} <<'END'\n{text}END"])
            assert written.returncode == 0, written.stderr
        self.process = guest.start([STAGECTL, "serve", "--config", f"{FOLDER}/stage.toml"])
        self.process.wait_for("daemon_started")

    def run(self, *words):
        return self.guest.run([STAGECTL, *words], environment=ENVIRONMENT)

    def status(self):
        asked = self.run("status", "--json")
        assert asked.stdout, asked.stderr + self.process.errors
        return json.loads(asked.stdout)

    def until(self, is_so):
        for _ in range(100):
            if is_so(status := self.status()):
                return status
        raise AssertionError(f"it does not come about: {status}\n{self.process.errors}")

    def bring_to(self, state):
        self.until(lambda now: now["state"] == "idle")
        if state == "armed":
            assert self.run("arm").returncode == 0, self.process.errors
        if state == "recording":
            begun = self.run("record", "--no-wait")
            assert begun.returncode == 0, begun.stderr + self.process.errors
            self.until(lambda now: now["take"]["triggers_fired"] > 3)
        assert self.status()["state"] == state

    def end(self):
        self.process.end()
        self.guest.run(["rm", "-rf", FOLDER])


class Vivid:
    def __init__(self, guest):
        self.guest = guest

    def plug(self):
        self.guest.load("vivid", "n_devs=1 node_types=0x1 vid_cap_nr=0")

    def unplug(self):
        done = self.guest.run(["v4l2-ctl", "-d", "/dev/video0", "-c", "disconnect=1"])
        assert done.returncode == 0, done.stderr

    def remove(self):
        """Which the kernel refuses while anybody holds the device."""
        self.guest.unload("vivid")


class Cable:
    def __init__(self, usb, board):
        self.usb, self.board = usb, board

    def plug(self):
        self.port = self.usb(self.board)

    def unplug(self):
        self.port.unplug()

    def remove(self):
        pass


@pytest.fixture
def camera(guest):
    vivid = Vivid(guest)
    vivid.plug()
    yield vivid
    vivid.remove()


@pytest.fixture
def daemon(guest, camera, emulated, usb):
    cable = Cable(usb, emulated())
    cable.plug()
    started = Daemon(guest)
    started.devices = {"camera": camera, "board": cable}
    yield started
    started.end()


@pytest.mark.parametrize("state", ["idle", "armed", "recording"])
@pytest.mark.parametrize("device", ["camera", "board"])
def test_unplugged_in_each_state_it_is_named_and_taken_again_when_it_is_back(daemon, device, state):
    daemon.bring_to(state)
    daemon.devices[device].unplug()
    fault = daemon.until(lambda now: now["state"] == "fault")
    assert device in fault["fault"] and "unplugged" in fault["fault"], fault
    assert fault["fault_is_latched"] == (state != "idle")
    if state == "recording":
        take, = json.loads(daemon.run("takes", "--json").stdout)["takes"]
        assert take["state"] == "finished", take
    daemon.devices[device].remove()
    daemon.devices[device].plug()
    if state != "idle":
        daemon.run("status", "--clear-fault")
    daemon.until(lambda now: now["state"] == "idle")
