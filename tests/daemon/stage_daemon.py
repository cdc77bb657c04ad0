# SPDX-License-Identifier: MIT
# A virtual stage with the daemon that holds it, and two clients that are not ours: curl and a plain socket.
import json
import os
import pathlib
import signal
import socket
import subprocess
import time

import numpy as np
import OpenEXR

ROOT = pathlib.Path(__file__).resolve().parents[2]
BIN = ROOT / "build/host/bin"
SERVE = ROOT / os.environ.get("SERVE", BIN / "stagectl")  # whose daemon is tested: one with a sanitizer, mostly
SCENES = ROOT / "tools/stagesim/scenes"
WIDTH, HEIGHT = 32, 24


def until(condition, seconds=60, what="it"):
    """What `condition` returns, as soon as that is true."""
    deadline = time.monotonic() + seconds
    while not (found := condition()):
        assert time.monotonic() < deadline, f"{what} did not come about within {seconds} s"
        time.sleep(0.02)
    return found


class Stage:
    """The virtual stage's process: board and camera; with `with`. Can be ended, and started again at the same place."""

    def __init__(self, folder, *options, scene="spheres.toml"):
        self.folder, self.options, self.scene = folder, options, scene
        folder.mkdir(parents=True, exist_ok=True)
        self.process = None

    def __enter__(self):
        return self.start()

    def __exit__(self, *_):
        self.end()

    def start(self, *options):
        for name in ("board.sock", "cam0.ring"):
            (self.folder / name).unlink(missing_ok=True)
        self.log = (self.folder / "stagesim.log").open("w+")
        command = [BIN / "stagesim", "run", SCENES / self.scene, "--stage", self.folder / "stage.toml"]
        command += ["--work", self.folder, *self.options, *options]
        self.process = subprocess.Popen(list(map(str, command)), stdout=self.log, stderr=self.log, start_new_session=True)
        until(lambda: self.is_there() or self.process.poll() is not None, 120, "the virtual stage")
        assert self.process.poll() is None, self.read_log()
        return self

    def is_there(self):
        return (self.folder / "board.sock").exists()

    def board_process(self):
        """The emulated board: the stage's child."""
        children = pathlib.Path(f"/proc/{self.process.pid}/task/{self.process.pid}/children").read_text().split()
        return int(children[0])

    def end(self, how=signal.SIGTERM):
        if self.process and self.process.poll() is None:
            self.process.send_signal(how)
            self.process.wait(30)
            for pid in self.left_over():
                os.kill(pid, signal.SIGKILL)

    def left_over(self):
        """Children of a stage that was killed: they are of its session."""
        found = []
        for entry in pathlib.Path("/proc").iterdir():
            if entry.name.isdigit():
                try:
                    fields = (entry / "stat").read_text().rsplit(")", 1)[1].split()
                except OSError:
                    continue
                if int(fields[3]) == self.process.pid and fields[0] != "Z":
                    found.append(int(entry.name))
        return found

    def read_log(self):
        self.log.seek(0)
        return self.log.read()


class Daemon:
    """`stagectl serve`, of a stage in `folder`; with `with`."""

    def __init__(self, folder, settings="", stage="", program=SERVE, camera=None):
        self.folder, self.work, self.program = folder, folder / "work", program
        self.work.mkdir(parents=True, exist_ok=True)
        self.socket, self.takes, self.config = folder / "run/control.sock", folder / "takes", self.work / "stage.toml"
        self.port = free_port()
        defaults = {"seconds": "0.1", "nominal": "true", "reserve_mb": "10", "sequence": '"single"'}
        for line in settings.splitlines():
            if "=" in line:
                defaults.pop(line.split("=")[0].strip(), None)
        daemon = "\n".join(f"{key} = {value}" for key, value in defaults.items())
        self.text = f"""calibration = "{folder}/calibration"
[board]
link = "socket:{self.work}/board.sock"
[daemon]
socket = "{self.socket}"
http_port = {self.port}
takes = "{self.takes}"
sequences = "{folder}/sequences"
{daemon}
{settings}
{stage}
[[camera]]
width = {WIDTH}
height = {HEIGHT}
source = "{camera or f'ring:{self.work}/cam0.ring'}"
"""
        (folder / "sequences").mkdir(exist_ok=True)
        self.config.write_text(self.text)
        self.process = None
        self.under = []  # what the program is run by, which becomes the program

    def __enter__(self):
        return self.start()

    def __exit__(self, *_):
        self.end()

    def start(self, **environment):
        self.log_path = self.folder / "serve.log"
        self.log = self.log_path.open("a+")
        self.process = subprocess.Popen(
            [*map(str, self.under), str(self.program), "serve", "--config", str(self.config)],
            stdout=self.log, stderr=self.log, env={**os.environ, **environment},
        )  # fmt: skip
        until(lambda: self.is_listening() or self.process.poll() is not None, 30, "the daemon")
        return self

    def is_listening(self):
        with socket.socket(socket.AF_UNIX) as probe:
            return probe.connect_ex(str(self.socket)) == 0

    def end(self, how=signal.SIGTERM, patience=60):
        if self.process and self.process.poll() is None:
            self.process.send_signal(how)
            self.process.wait(patience)
        found = self.read_log().find("Sanitizer")
        assert found < 0, self.read_log()[max(found - 200, 0):][:6000]
        return self.process.returncode

    def read_log(self):
        return self.log_path.read_text()

    # The command line.
    def run(self, *words, code=0, timeout=120):
        done = subprocess.run(
            [str(BIN / "stagectl"), *map(str, words)], capture_output=True, text=True, timeout=timeout,
            env={**os.environ, "STAGECTL_SOCKET": str(self.socket)},
        )  # fmt: skip
        assert done.returncode == code, (done.returncode, done.stdout, done.stderr, self.read_log())
        return json.loads(done.stdout) if "--json" in words else done.stdout + done.stderr

    def background(self, *words):
        return subprocess.Popen(
            [str(BIN / "stagectl"), *map(str, words)], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
            env={**os.environ, "STAGECTL_SOCKET": str(self.socket)},
        )  # fmt: skip

    # The API.
    def connect(self):
        return Client(self.socket)

    def call(self, method, **params):
        with self.connect() as client:
            return client.call(method, **params)

    def state(self):
        return self.call("status")["state"]

    def until_state(self, *states, seconds=60):
        return until(lambda: (now := self.state()) in states and now, seconds, f"state {states}: {self.read_log()[-2000:]}")

    def events(self, kind=None):
        events = self.call("log", limit=2000)["events"]
        return [event for event in events if kind is None or event["event"] == kind]

    @property
    def token(self):
        return (self.socket.parent / "token").read_text().strip()

    def curl(self, path, *options, token=None):
        """Status and body."""
        command = ["curl", "-s", "-m", "20", "-o", "-", "-w", "\n%{http_code}", *options]
        command += ["-H", f"Authorization: Bearer {token or self.token}", f"http://127.0.0.1:{self.port}{path}"]
        body, _, status = subprocess.run(command, capture_output=True, text=True).stdout.rpartition("\n")
        return int(status), body

    def figures(self):
        """Of the process: resident bytes, descriptors, threads."""
        proc = pathlib.Path(f"/proc/{self.process.pid}")
        resident = int((proc / "statm").read_text().split()[1]) * os.sysconf("SC_PAGESIZE")
        return resident, len(list((proc / "fd").iterdir())), len(list((proc / "task").iterdir()))


def bring_to(daemon, state):
    """Into a state that lasts; the client that records, where there is one."""
    if state == "armed":
        daemon.run("arm")
    if state == "recording":
        daemon.run("record", "--seconds", "60", "--no-wait", "--slate", "cut")
        until(lambda: daemon.call("status")["take"]["triggers_fired"] > 400)
    assert daemon.state() == state


def targets_written(daemon):
    """So far, of the take that runs."""
    outputs = (daemon.call("status")["take"] or {"outputs": []})["outputs"]
    return outputs[0]["targets_written"] if outputs else 0  # there are none before it develops


def assert_takes_are_whole(daemon, targets_at_least):
    """Every finished target reads, the rest is named."""
    for take in daemon.run("takes", "--json")["takes"]:
        assert take["state"] == "finished", take
        done = subprocess.run(
            [str(BIN / "rf"), "verify", take["archive"], "--json"], capture_output=True, text=True, timeout=60
        )
        report = json.loads(done.stdout)
        assert len(report["intact"]) == take["targets_written"] >= targets_at_least, report


def read_lamps(target):
    """[lamp, y, x]"""
    for part in OpenEXR.File(str(target), separate_channels=True).parts:
        if part.header["name"] == "lamps":
            return np.stack([part.channels[name].pixels for name in sorted(part.channels)])
    raise AssertionError("no part of lamps")


def misplaced_lamps(archive, truth):
    """Of a take of single lamps of a scene that stands still: (target, lamp) where the picture is another lamp's than in `truth`."""
    found = []
    for target in sorted((archive / "cam0").glob("target_??????.exr")):
        lamps = read_lamps(target)
        seen = lamps.any(axis=(1, 2))  # of the others no frame came
        # Noise is 0.02 of it; lamps side by side differ by 0.07 in the middle of them, some by all of it.
        differs = np.abs(lamps - truth).max(axis=(1, 2)) > 0.05 * np.abs(truth).max()
        found += [(target.name, int(lamp)) for lamp in np.flatnonzero(seen & differs)]
    return found


def assert_frames_have_their_slots(archive):
    """Its targets are those of the first."""
    assert misplaced_lamps(archive, read_lamps(min((archive / "cam0").glob("target_??????.exr")))) == []


class Refused(Exception):
    """An error of JSON-RPC."""

    def __init__(self, error):
        super().__init__(error["message"])
        self.code = error["code"]


class Client:
    """JSON-RPC 2.0, a line each, over a Unix socket: written from the specification alone."""

    def __init__(self, path):
        self.socket = socket.socket(socket.AF_UNIX)
        self.socket.connect(str(path))
        self.socket.settimeout(60)
        self.lines = self.socket.makefile("r", encoding="utf-8")
        self.events, self.last_id = [], 0

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.lines.close()
        self.socket.close()

    def send_line(self, text):
        self.socket.sendall(text.encode() + b"\n")

    def read(self):
        line = self.lines.readline()
        assert line, "the daemon has closed the connection"
        return json.loads(line)

    def call(self, method, **params):
        self.last_id += 1
        self.send_line(json.dumps({"jsonrpc": "2.0", "id": self.last_id, "method": method, "params": params}))
        while (message := self.read()).get("id") != self.last_id:
            self.events.append(message["params"])
        if "error" in message:
            raise Refused(message["error"])
        return message["result"]

    def next_event(self):
        return self.events.pop(0) if self.events else self.read()["params"]

    def until_event(self, *kinds):
        while (event := self.next_event())["event"] not in kinds:
            pass
        return event


def free_port():
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]
