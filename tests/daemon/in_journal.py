# SPDX-License-Identifier: MIT
"""Runs a program as systemd runs a service whose output the journal takes: in_journal.py FOLDER PROGRAM [ARGUMENT ...].

In a mount namespace of its own (`unshare --mount`) a systemd-journald serves /run/systemd/journal, and keeps what it is told in FOLDER.
Standard error is a stream to it, and $JOURNAL_STREAM says which (systemd.exec(5)); the program has this process's id.
"""
import ctypes
import os
import pathlib
import signal
import socket
import subprocess
import sys
import time

JOURNALD = "/lib/systemd/systemd-journald"
PR_SET_PDEATHSIG = 1


def end_with_parent():
    ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGTERM)


def main(folder, *program):
    for place in ("/run", "/var/log"):
        subprocess.run(["mount", "-t", "tmpfs", "tmpfs", place], check=True)
    kept = pathlib.Path("/run/log/journal")
    for made in (kept, pathlib.Path("/run/systemd/journal")):
        made.mkdir(parents=True)
    subprocess.run(["mount", "--bind", folder, kept], check=True)
    null = {"stdin": subprocess.DEVNULL, "stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    subprocess.Popen([JOURNALD], preexec_fn=end_with_parent, **null)
    stream = socket.socket(socket.AF_UNIX)
    for _ in range(3000):
        if stream.connect_ex("/run/systemd/journal/stdout") == 0:
            break
        time.sleep(0.01)
    else:
        sys.exit("no journald answers")
    # sd_journal_stream_fd(3): identifier, unit, priority, whether lines begin with one, and three forwards.
    stream.sendall(b"stagectl\n\n6\n0\n0\n0\n0\n")
    os.dup2(stream.fileno(), 2)
    facts = os.fstat(2)
    os.execvpe(program[0], program, {**os.environ, "JOURNAL_STREAM": f"{facts.st_dev}:{facts.st_ino}"})


if __name__ == "__main__":
    main(*sys.argv[1:])
