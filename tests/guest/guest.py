# SPDX-License-Identifier: MIT
"""A Linux kernel of our own to test against: Debian's in QEMU (no KVM needed), with the host's files read-only below a layer
in memory, so that whatever is built here runs there by its own path.

usage: guest.py [--load 'MODULE PARAMETERS']... -- COMMAND...      boots, loads, runs, ends with the command's exit code
example: guest.py --load 'v4l2loopback devices=1' -- v4l2-ctl --list-devices
"""
import argparse
import codecs
import itertools
import json
import os
import pathlib
import queue
import secrets
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time

import kernel

AGENT = kernel.HERE / "inside/agent.py"
PATIENCE_S = 180  # for what takes seconds, on a machine that does other things


class Process:
    """A program in the guest. `output` and `errors` grow while it runs."""

    def __init__(self, guest, number):
        self.guest, self.number = guest, number
        self.output, self.errors = "", ""
        self.changed = threading.Condition()
        self.open_streams = 2
        self.returncode = None
        self.input = None

    def _take(self, kind, connection):
        if kind == "output":
            self.input = connection
        decoder = codecs.getincrementaldecoder("utf-8")("replace")
        while part := connection.recv(65536):
            with self.changed:
                if kind == "output":
                    self.output += decoder.decode(part)
                else:
                    self.errors += decoder.decode(part)
                self.changed.notify_all()
        # QEMU's network keeps a connection until both ends are closed, and never answers a later one from the same port of the guest.
        connection.close()
        with self.changed:
            self.open_streams -= 1
            self.changed.notify_all()

    def _end(self, returncode):
        with self.changed:
            self.returncode = returncode
            self.changed.notify_all()

    def wait_for(self, text, timeout=PATIENCE_S):
        """Until `text` has been written to standard output or standard error."""
        with self.changed:
            self.changed.wait_for(lambda: text in self.output or text in self.errors or self._over(), timeout)
            assert text in self.output or text in self.errors, f"no {text!r} in: {self.output}{self.errors}"

    def _over(self):
        return (self.returncode is not None and self.open_streams == 0) or not self.guest.alive()

    def wait(self, timeout=PATIENCE_S):
        with self.changed:
            if not self.changed.wait_for(self._over, timeout):
                raise TimeoutError(f"the guest's program does not end: {self.output}{self.errors}")
        if self.returncode is None:
            raise ConnectionError("the guest has gone: " + self.guest.console())
        return self.returncode

    def signal(self, number=signal.SIGTERM):
        self.guest.ask("signal", process=self.number, signal=int(number))

    def end(self):
        """Ends it if it still runs."""
        if self.returncode is None and self.guest.alive():
            self.signal(signal.SIGKILL)
            self.wait()


class Guest:
    def __init__(self, cpus=2, memory_mb=1024):
        if shutil.which("qemu-system-x86_64") is None:
            raise kernel.Missing("qemu-system-x86_64 is missing: apt-get install qemu-system-x86")
        self.kernel = kernel.kernel()
        self.folder = tempfile.TemporaryDirectory(prefix="ols-guest")
        self.token = secrets.token_hex(16)
        self.listener = socket.create_server(("127.0.0.1", 0))
        self.numbers = itertools.count(1)
        self.processes, self.answers, self.channels = {}, {}, {}
        self.control, self.connected = None, threading.Event()
        self.monitor, self.paused_at, self.paused_s = None, None, 0.0
        self.qemu = subprocess.Popen(self._command(cpus, memory_mb), stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL,
                                     stderr=open(self._file("qemu"), "w"))
        threading.Thread(target=self._accept, daemon=True).start()
        self._wait_for_agent()

    def _file(self, name):
        return os.path.join(self.folder.name, name)

    def _command(self, cpus, memory_mb):
        port = self.listener.getsockname()[1]
        agent = f"{sys.executable} {AGENT} {self.kernel / 'modules'} {port} {self.token}"
        # Nice: an emulated board on the host has to keep its time as well.
        return ["nice", "-n", "5", "qemu-system-x86_64", "-machine", "q35", "-accel", "tcg,thread=multi", "-cpu", "max", "-smp", str(cpus),
                "-m", str(memory_mb), "-nodefaults", "-no-user-config", "-display", "none", "-no-reboot",
                "-kernel", str(self.kernel / "vmlinux"), "-initrd", str(self.kernel / "initramfs"),
                "-append", f"console=ttyS0 loglevel=4 panic=-1 no_timer_check -- {agent}", "-serial", "file:" + self._file("console"),
                "-fsdev", "local,id=host,path=/,security_model=none,readonly=on,multidevs=remap",
                "-device", "virtio-9p-pci,fsdev=host,mount_tag=host",
                "-qmp", f"unix:{self._file('qmp')},server=on,wait=off", "-netdev", "user,id=net", "-device", "virtio-net-pci,netdev=net,romfile="]

    def _wait_for_agent(self):
        end = time.monotonic() + PATIENCE_S
        while not self.connected.wait(0.1):
            if self.qemu.poll() is not None or time.monotonic() > end:
                told = pathlib.Path(self._file("qemu")).read_text() + self.console()
                self.close()
                raise kernel.Missing(f"the guest does not start: {told[-3000:]}")

    def _monitor(self, command):
        """QEMU's machine protocol: one command, once it has greeted."""
        if self.monitor is None:
            connection = socket.socket(socket.AF_UNIX)
            connection.connect(self._file("qmp"))
            self.monitor = connection.makefile("rw")
            self.monitor.readline()
            self._monitor("qmp_capabilities")
        self.monitor.write(json.dumps({"execute": command}))
        self.monitor.flush()
        while "return" not in json.loads(self.monitor.readline()):
            pass  # events

    def elapsed_s(self):
        """How far the guest's clock has come, which stands still while it is paused."""
        now = time.monotonic() if self.paused_at is None else self.paused_at
        return now - self.paused_s

    def pause(self):
        if self.paused_at is None and self.alive():
            self._monitor("stop")
            self.paused_at = time.monotonic()

    def resume(self):
        if self.paused_at is not None and self.alive():
            self.paused_s += time.monotonic() - self.paused_at
            self.paused_at = None
            self._monitor("cont")

    def console(self):
        """What the guest's kernel said."""
        return pathlib.Path(self._file("console")).read_text(errors="replace")

    def alive(self):
        return self.qemu.poll() is None

    def _accept(self):
        while True:
            try:
                connection, _ = self.listener.accept()
            except OSError:
                return
            connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            threading.Thread(target=self._greet, args=(connection,), daemon=True).start()

    def _greet(self, connection):
        line = b""
        while not line.endswith(b"\n") and (one := connection.recv(1)):
            line += one
        token, _, purpose = line.decode(errors="replace").strip().partition(" ")
        if token != self.token:
            connection.close()
            return
        kind, _, name = purpose.partition(" ")
        if kind == "control":
            self.control = connection
            self.connected.set()
            self._listen()
        elif kind == "channel":
            self.channels[name](connection)
        else:
            self.processes[int(name)]._take(kind, connection)

    def _listen(self):
        for line in self.control.makefile("rb"):
            answer = json.loads(line)
            if "rc" in answer:
                self.processes[answer["id"]]._end(answer["rc"])
            else:
                self.answers.pop(answer["id"]).put(answer)

    def _send(self, **asked):
        self.control.sendall(json.dumps(asked).encode() + b"\n")

    def ask(self, do, **what):
        number = next(self.numbers)
        answer = self.answers[number] = queue.Queue()
        self._send(do=do, id=number, **what)
        got = answer.get(timeout=PATIENCE_S)
        if "error" in got:
            raise OSError(got["error"])

    def load(self, module, parameters=""):
        self.ask("load", module=module, parameters=parameters)

    def unload(self, module):
        self.ask("unload", module=module)

    def channel(self, name, handler):
        """`handler` gets the connections that programs in the guest open by this name (inside/host.py)."""
        self.channels[name] = handler

    def start(self, argv, cwd=None, environment=None, user=None, groups=()):
        """A program in the guest, as root or as the user of that number who is in those groups."""
        number = next(self.numbers)
        process = self.processes[number] = Process(self, number)
        self._send(do="run", id=number, argv=[str(part) for part in argv], cwd=str(cwd or os.getcwd()),
                   environment=environment or {}, user=user, groups=list(groups))
        return process

    def run(self, argv, timeout=PATIENCE_S, **options):
        process = self.start(argv, **options)
        try:
            code = process.wait(timeout)
        finally:
            process.end()
        return subprocess.CompletedProcess(argv, code, process.output, process.errors)

    def close(self):
        if self.qemu.poll() is None:
            self.qemu.kill()
        self.qemu.wait()
        self.listener.close()
        self.folder.cleanup()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.close()


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--load", action="append", default=[], metavar="'MODULE PARAMETERS'")
    parser.add_argument("--timeout", type=float, default=600, metavar="SECONDS")
    parser.add_argument("command", nargs="+")
    options = parser.parse_args()
    try:
        with Guest() as guest:
            for module in options.load:
                guest.load(*module.split(" ", 1))
            done = guest.run(options.command, options.timeout)
    except kernel.Missing as problem:
        print(f"guest: {problem}", file=sys.stderr)
        return 125
    sys.stdout.write(done.stdout)
    sys.stderr.write(done.stderr)
    return done.returncode


if __name__ == "__main__":
    sys.exit(main())
