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

    def __init__(self, guest, stage=STAGE):
        self.guest = guest
        for name, text in (("stage.toml", stage), ("slow.toml", SEQUENCE)):
            written = guest.run(["sh", "-c", f"mkdir -p {FOLDER}; cat > {FOLDER}/{name} <<'END'\n{text}END"])
            assert written.returncode == 0, written.stderr
        self.start()

    def start(self):
        self.process = self.guest.start([STAGECTL, "serve", "--config", f"{FOLDER}/stage.toml"])
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

    def until_event(self, kind):
        """The first one."""
        for _ in range(100):
            events = [json.loads(line) for line in self.run("log", "--json").stdout.splitlines()]
            if found := [event for event in events if event["event"] == kind]:
                return found[0]
        raise AssertionError(f"there is no event {kind}: {self.process.errors}")

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
    """Unplugged it is plugged in again when the last program has closed it (vivid_fop_release(), vivid-core.c)."""

    def __init__(self, guest):
        self.guest = guest
        guest.load("vivid", "n_devs=1 node_types=0x1 vid_cap_nr=0")

    def plug(self):
        pass

    def unplug(self):
        done = self.guest.run(["v4l2-ctl", "-d", "/dev/video0", "-c", "disconnect=1"])
        assert done.returncode == 0, done.stderr


class Cable:
    def __init__(self, usb, board):
        self.usb, self.board = usb, board

    def plug(self):
        self.port = self.usb(self.board)

    def unplug(self):
        self.port.unplug()


@pytest.fixture
def camera(guest):
    yield Vivid(guest)
    guest.unload("vivid")


@pytest.fixture
def cable(emulated, usb):
    plugged = Cable(usb, emulated())
    plugged.plug()
    return plugged


@pytest.fixture
def daemon(guest, camera, cable):
    started = Daemon(guest)
    started.devices = {"camera": camera, "board": cable}
    yield started
    started.end()


@pytest.mark.parametrize("state", ["idle", "armed", "recording"])
@pytest.mark.parametrize("device", ["camera", "board"])
def test_unplugged_in_each_state_it_is_named_and_taken_again_when_it_is_back(daemon, device, state):
    daemon.bring_to(state)
    daemon.devices[device].unplug()
    fault = daemon.until_event("fault")
    assert device in fault["text"] and "unplugged" in fault["text"], fault
    assert fault["data"]["latched"] == (state != "idle")
    daemon.devices[device].plug()
    if state != "idle":
        while daemon.run("status", "--clear-fault").returncode != 0:
            assert daemon.status()["state"] == "fault"
    daemon.until(lambda now: now["state"] == "idle")


# Its heartbeat is any word on the bus: a daemon that is started again at once would keep the light on.
def test_a_board_that_a_killed_daemon_left_playing_goes_dark_when_it_is_opened(daemon):
    daemon.bring_to("recording")
    daemon.process.end()
    daemon.start()
    daemon.until(lambda now: now["state"] == "idle")
    assert "was playing when it was opened" in daemon.run("log").stdout


def test_the_arm_button_begins_a_take_long_after_the_heartbeat(guest, camera, cable, chip):
    chip.pull("ARM", False)
    daemon = Daemon(guest, '[gpio]\nchip = "stage-lines"\n[gpio.arm]\nline = "ARM"\n' + STAGE)
    try:
        daemon.until(lambda now: now["state"] == "idle")
        begun = daemon.run("record", "--no-wait")
        assert begun.returncode == 0, begun.stderr + daemon.process.errors
        guest.run(["sleep", "8"])
        assert daemon.status()["waits_for"] == "the arm button"
        chip.pull("ARM", True)
        daemon.until(lambda now: now["take"] and now["take"]["triggers_fired"] > 3)
    finally:
        daemon.end()
