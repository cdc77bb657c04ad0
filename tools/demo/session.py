# SPDX-License-Identifier: MIT
"""Processes of the demo: a virtual stage that stays up while the daemon records from it, and programs that print JSON."""
import atexit
import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
BIN = ROOT / "build/host/bin"


class Clock:
    """Where the wall time went, by step; a step that comes again adds up."""

    def __init__(self):
        self.steps = {}
        self.start = time.monotonic()

    def __call__(self, name):
        return _Step(self, name)

    def total(self):
        return time.monotonic() - self.start


class _Step:
    def __init__(self, clock, name):
        self.clock, self.name = clock, name

    def __enter__(self):
        self.began = time.monotonic()
        print(f"{self.clock.total():6.1f} s  {self.name}", flush=True)

    def __exit__(self, *_):
        spent = time.monotonic() - self.began
        self.clock.steps[self.name] = round(self.clock.steps.get(self.name, 0) + spent, 2)


class Chapters:
    """What the demo does, in order: (what, minutes, how, pictures to look at or None), told before, between and after."""

    def __init__(self, chapters, out):
        self.chapters, self.out = chapters, out

    def play(self):
        print("The demo has these parts (minutes on two cores that nobody else uses):", flush=True)
        self.tell(0)
        for number, (what, _, how, pictures) in enumerate(self.chapters):
            print(f"\n{number + 1} of {len(self.chapters)}: {what}", flush=True)
            how()
            if pictures:
                print(f"LOOK in {self.out}: {pictures}", flush=True)
            if number + 1 < len(self.chapters):
                print("Still to come (Ctrl-C leaves what is there):", flush=True)
                self.tell(number + 1)

    def tell(self, first):
        for number, (what, minutes, _, pictures) in enumerate(self.chapters[first:], first + 1):
            shown = f": {pictures}" if pictures else ""
            print(f"  {number}. some {minutes} min  {what}{shown}", flush=True)


def run(*command):
    """Runs a program of the project and returns what it printed; on failure, ends the demo with its own words. On a terminal its
    progress shows."""
    errors = None if sys.stderr.isatty() else subprocess.PIPE
    done = subprocess.run([str(part) for part in command], cwd=ROOT, stdout=subprocess.PIPE, stderr=errors, text=True)
    if done.returncode != 0:
        sys.exit(f"demo: this failed with exit code {done.returncode}:\n  {' '.join(map(str, command))}\n{done.stdout}{done.stderr or ''}")
    return done.stdout


def run_json(*command):
    return json.loads(run(*command))


class VirtualStage:
    """`stagesim run`: an emulated board and a camera around a simulated scene, until the `with` block ends."""

    def __init__(self, scene, stage, work, *options):
        self.work = Path(work)
        self.work.mkdir(parents=True, exist_ok=True)
        for stale in [*self.work.glob("*.sock"), *self.work.glob("*.ring")]:
            stale.unlink()
        self.command = [BIN / "stagesim", "run", scene, "--stage", stage, "--work", self.work, *options]
        self.log = self.work / "stagesim.log"

    def __enter__(self):
        with open(self.log, "w") as log:
            self.process = subprocess.Popen([str(part) for part in self.command], cwd=ROOT, stdout=log, stderr=log)
        atexit.register(self.__exit__)  # also when a step fails
        while not (self.work / "board.sock").exists():  # it appears when everything is ready
            if self.process.poll() is not None:
                sys.exit(f"demo: the virtual stage ended early; it said:\n{self.log.read_text()}")
            time.sleep(0.05)
        return self

    def __exit__(self, *_):
        self.process.send_signal(signal.SIGTERM)
        self.process.wait()

    def devices(self):
        return ["--board", f"socket:{self.work}/board.sock", "--camera", f"ring:{self.work}/cam0.ring"]


class Daemon:
    """`stagectl serve` for the virtual stage at `work`, until the `with` block ends. `settings`: lines of [daemon]."""

    def __init__(self, stage, work, takes, settings):
        self.work, self.socket = Path(work), Path(work) / "control.sock"
        links = f'[board]\nlink = "socket:{self.work}/board.sock"\n'
        daemon = f'[daemon]\nsocket = "{self.socket}"\ntakes = "{takes}"\n{settings}\n'
        camera = f'[[camera]]\nsource = "ring:{self.work}/cam0.ring"'
        self.config = self.work / "daemon.toml"
        self.config.write_text(links + daemon + Path(stage).read_text().replace("[[camera]]", camera))

    def __enter__(self):
        log = self.work / "daemon.log"
        with open(log, "w") as lines:
            self.process = subprocess.Popen([BIN / "stagectl", "serve", "--config", self.config], cwd=ROOT, stdout=lines, stderr=lines)
        atexit.register(self.__exit__)
        while subprocess.run([BIN / "stagectl", "status", "--socket", self.socket], capture_output=True).returncode != 0:
            if self.process.poll() is not None:
                sys.exit(f"demo: the daemon ended early; it said:\n{log.read_text()}")
            time.sleep(0.05)
        return self

    def __exit__(self, *_):
        self.process.send_signal(signal.SIGTERM)
        self.process.wait()

    def __call__(self, verb, *words):
        return run_json(BIN / "stagectl", verb, "--socket", self.socket, *words, "--json")


def use_root():
    os.chdir(ROOT)
