# SPDX-License-Identifier: MIT
"""What stands at the other end of a CAN link and misbehaves: `stagectl status` ends by itself, names the link, takes no memory, and
ends at the first Ctrl-C where it would wait for an hour. The bus is written here from architecture.md ("CAN frames over a socket")
and ISO 15765-2, and shares no code with ours."""
import concurrent.futures
import pathlib
import resource
import signal
import socket
import struct
import subprocess
import tempfile
import threading
import time

ROOT = pathlib.Path(__file__).resolve().parents[2]
STAGECTL = ROOT / "build/host/bin/stagectl"
HANG_S = 60  # not a measure of speed
TO_HOST, TELEMETRY, NOW = 0x608, 0x100, 0xffffffff
TICKS_A_MS = 125_000
CONTINUE, WAIT, OVERFLOW = b"\x30\0\0", b"\x31\0\0", b"\x32\0\0"


def record(can_id, data, length=None):
    return struct.pack("<IB3x8s", can_id, len(data) if length is None else length, data)


def now(milliseconds):
    return record(NOW, struct.pack("<Q", milliseconds * TICKS_A_MS & (1 << 64) - 1))


def silent():
    yield now(0)
    yield 3600


def as_time_goes_on(*frames):
    """Frames of a board to the host, one a millisecond, then its time alone."""
    yield now(0)
    for millisecond in range(1, 1 << 30):
        if millisecond <= len(frames):
            yield record(TO_HOST, frames[millisecond - 1])
        yield now(millisecond)


def without_end(piece, before=b""):
    yield before
    while True:
        yield piece


def consecutive(first, numbers):
    yield now(0)
    yield record(TO_HOST, CONTINUE)
    yield record(TO_HOST, first)
    for n in numbers:
        yield record(TO_HOST, bytes([0x20 | n & 15]) + bytes(7))
    yield from as_time_goes_on()


def trickle():
    while True:
        for byte in now(0):
            yield bytes([byte])
            yield 0.1


# What the bus sends after the connection; numbers are seconds to wait, None closes.
BUSES = {
    "nothing at all": lambda: [3600],
    "no time, ever": lambda: without_end(record(TELEMETRY, bytes(8)) * 1000),
    "a time, and nothing more": silent,
    "a time that stands still": lambda: without_end(now(5) * 1000),
    "a time that goes back": lambda: without_end(now(3) + now(1), now(5)),
    "a time of 2^64 - 1": lambda: without_end(now(0) + record(NOW, b"\xff" * 8)),
    "byte by byte": trickle,
    "half a record": lambda: [now(0), now(1)[:7], 3600],
    "a frame of 255 bytes": lambda: [now(0), record(TO_HOST, bytes(8), 255), 3600],
    "a frame of 9 bytes of somebody else's": lambda: [now(0), record(TELEMETRY, bytes(8), 9), 3600],
    "frames of others without end": lambda: without_end(record(TELEMETRY, bytes(8)) * 1000, now(0)),
    "empty frames without end": lambda: without_end(record(TO_HOST, b"") * 1000, now(0)),
    "wait, without end": lambda: without_end(record(TO_HOST, WAIT), now(0)),
    "wait, as time goes on": lambda: as_time_goes_on(*[WAIT] * 5000),
    "go on, without end": lambda: without_end(record(TO_HOST, CONTINUE) * 1000, now(0)),
    "go on, and then silence": lambda: as_time_goes_on(CONTINUE),
    "go on, a frame in 127 ms": lambda: as_time_goes_on(b"\x30\x01\x7f"),
    "no room": lambda: as_time_goes_on(OVERFLOW, OVERFLOW),
    "a flow status that there is not": lambda: as_time_goes_on(b"\x3f\0\0"),
    "a message of 4095 bytes, announced": lambda: as_time_goes_on(CONTINUE, b"\x1f\xff" + bytes(6)),
    "a message of 1024 bytes that ends early": lambda: consecutive(b"\x14\x00" + bytes(6), range(1, 20)),
    "a message whose frames are numbered wrong": lambda: consecutive(b"\x14\x00" + bytes(6), [1, 3, 2, 5]),
    "a message of 1024 zeros": lambda: consecutive(b"\x14\x00" + bytes(6), range(1, 147)),
    "messages of 1 byte without end": lambda: without_end(record(TO_HOST, b"\x01x") * 100, now(0) + record(TO_HOST, CONTINUE)),
    "first frames without end": lambda: without_end(record(TO_HOST, b"\x14\x00" + bytes(6)) * 100, now(0) + record(TO_HOST, CONTINUE)),
    "error frames without end": lambda: without_end(record(TO_HOST | 1 << 29, bytes(8)) * 100, now(0)),
    "zeros": lambda: without_end(bytes(4096)),
    "noise": lambda: without_end(bytes(n * 89 & 255 for n in range(4096)), now(0)),
    "gone at once": lambda: [None],
    "gone within a record": lambda: [now(0), now(1)[:9], None],
    "gone after its time": lambda: [now(0), None],
}


class Bus(threading.Thread):
    """Serves one client, and takes in what it sends."""

    def __init__(self, path, pieces):
        super().__init__(daemon=True)
        self.pieces, self.ended = pieces, threading.Event()
        self.server = socket.socket(socket.AF_UNIX)
        self.server.bind(str(path))
        self.server.listen(1)
        self.start()

    def run(self):
        client, _ = self.server.accept()
        threading.Thread(target=self.drain, args=(client,), daemon=True).start()
        try:
            for piece in self.pieces:
                if piece is None or self.ended.is_set():
                    break
                if isinstance(piece, bytes):
                    client.sendall(piece)
                elif self.ended.wait(piece):
                    break
        except OSError:
            pass
        client.close()

    def drain(self, client):
        try:
            while client.recv(65536):
                pass
        except OSError:
            pass

    def close(self):
        self.ended.set()
        self.server.close()


def limit_memory():
    resource.setrlimit(resource.RLIMIT_AS, (2 << 30, 2 << 30))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))


def ask_on(pieces, folder, patience_s, interrupt_s=None):
    path = folder / "can.sock"
    bus = Bus(path, pieces)
    process = subprocess.Popen([STAGECTL, "status", "--json", "--board", f"can-socket:{path}", "--patience", str(patience_s)],
                               stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, preexec_fn=limit_memory)
    try:
        if interrupt_s is not None:
            time.sleep(interrupt_s)
            process.send_signal(signal.SIGINT)
        printed, errors = process.communicate(timeout=HANG_S)
    except subprocess.TimeoutExpired:
        process.kill()
        process.communicate()
        return "hangs", "", ""
    finally:
        bus.close()
    return process.returncode, printed, errors


def problem_of(name):
    with tempfile.TemporaryDirectory() as folder:
        code, printed, errors = ask_on(BUSES[name](), pathlib.Path(folder), 0.5)
        is_right = code == 1 and not printed and errors.startswith("stagectl: ") and f"the CAN bus at '{folder}/can.sock'" in errors
    return None if is_right else f"{name}: exit code {code}, {printed}{errors}"


def test_every_bad_can_link_is_given_up_by_name():
    with concurrent.futures.ThreadPoolExecutor(6) as pool:
        problems = [problem for problem in pool.map(problem_of, BUSES) if problem]
    assert not problems, f"{len(problems)} of {len(BUSES)}:\n" + "\n".join(problems)


def test_the_first_ctrl_c_ends_every_wait_for_a_can_link():
    for name in ("nothing at all", "a time, and nothing more", "a time that stands still", "byte by byte", "half a record"):
        with tempfile.TemporaryDirectory() as folder:
            code, _, errors = ask_on(BUSES[name](), pathlib.Path(folder), 3600, interrupt_s=0.5)
        assert code in (1, -signal.SIGINT), f"{name}: {code}, {errors}"
