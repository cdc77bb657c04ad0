# SPDX-License-Identifier: MIT
# gige_bridge as a child process: a GigE Vision camera over a virtual stage's ring, which can be unplugged and plugged in again.
import os
import pathlib
import signal
import subprocess

BRIDGE = pathlib.Path(__file__).resolve().parents[2] / "build/host/bin/gige_bridge"


class GigeCamera:
    """At an address of the loopback that no other test's process has; use it with `with`, or start and unplug it."""

    def __init__(self, ring):
        self.ring, self.process = ring, None
        self.address = f"127.{1 + os.getpid() // 254 % 254}.{1 + os.getpid() % 254}.1"

    def __enter__(self):
        return self.start()

    def __exit__(self, *_):
        self.process.stdin.close()
        assert self.process.wait(60) == 0

    def start(self):
        command = [str(BRIDGE), str(self.ring), self.address]
        self.process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        assert self.process.stdout.readline() == "ready\n"
        return self

    def stand_still(self):
        self.process.send_signal(signal.SIGSTOP)

    def go_on(self):
        self.process.send_signal(signal.SIGCONT)

    def unplug(self):
        self.process.kill()
        self.process.wait(30)
