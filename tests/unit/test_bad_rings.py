# SPDX-License-Identifier: MIT
"""Camera rings that are not what they say, or change while they are mapped. `stagectl run` records from each, with a board that
plays honestly: it ends by itself, never by a signal, and the first Ctrl-C ends what waits. The rings are written here from the
layout that host/device/ring.hpp documents, by code of this file alone."""
import concurrent.futures
import fcntl
import mmap
import os
import pathlib
import random
import re
import resource
import signal
import struct
import subprocess
import tempfile
import threading
import time

from fake_board import FakeBoard

ROOT = pathlib.Path(__file__).resolve().parents[2]
STAGECTL = ROOT / "build/host/bin/stagectl"
SEQUENCE = ROOT / "examples/sequence_single.toml"
HANG_S = 60  # not a measure of speed
WIDTH, HEIGHT = 16, 8
STAGE = f"[[camera]]\nwidth = {WIDTH}\nheight = {HEIGHT}\n"
MAGIC = 0x33474e4952534c4f
HEADER_BYTES, META_BYTES = 192, 64
SLOTS, STRIDE = 8, (META_BYTES + WIDTH * HEIGHT * 2 + 63) // 64 * 64
# Where things are in the header, and as what.
SLOTS_AT, STRIDE_AT, WIDTH_AT, HEIGHT_AT, FORMAT_AT, CFA_AT, BITS_AT = 8, 12, 16, 20, 24, 28, 32
HEAD, WATERMARK, DROPPED, HEAD_FUTEX, CLOSED, STARTED, STARTED_NS, STARTED_HEAD = 64, 72, 80, 88, 92, 96, 104, 112
TAIL, TAIL_FUTEX, ASKED, RUNNING = 128, 136, 140, 144


class Ring(threading.Thread):
    """A ring and the program that fills it: frames until it is closed, of the honest kind but for what `odd` says."""

    def __init__(self, path, odd):
        super().__init__(daemon=True)
        self.odd, self.ended, self.was_odd = odd, False, False
        self.file = open(path, "w+b")
        self.file.truncate(odd.get("size", HEADER_BYTES + SLOTS * STRIDE))
        # A lock of the open file (fcntl(2)), as the other end's.
        if not odd.get("no writer"):
            fcntl.fcntl(self.file, 37, struct.pack("hhqqi", fcntl.F_WRLCK, 0, 1, 1, 0) + bytes(4))  # F_OFD_SETLK
        size = max(os.fstat(self.file.fileno()).st_size, 1)
        self.header = struct.pack("<QIIIIIIII", MAGIC, SLOTS, STRIDE, WIDTH, HEIGHT, 1, 1, 12, 0)
        for at, kind, value in odd.get("header", []):
            patched = bytearray(self.header.ljust(HEADER_BYTES, b"\0"))
            struct.pack_into(kind, patched, at, value)
            self.header = bytes(patched)
        self.file.write(odd.get("bytes", self.header)[:size])
        self.file.flush()
        self.memory = mmap.mmap(self.file.fileno(), min(size, HEADER_BYTES + SLOTS * STRIDE)) if size >= HEADER_BYTES else None
        self.frame_id = 0

    def get(self, kind, at):
        return struct.unpack_from(kind, self.memory, at)[0]

    def put(self, kind, at, value):
        struct.pack_into(kind, self.memory, at, value)

    def run(self):
        if self.memory is None:
            return
        while not self.ended:
            if self.get("<I", ASKED) != self.get("<I", STARTED) and not self.odd.get("deaf"):
                self.put("<Q", STARTED_NS, 1_000_000)
                self.put("<Q", STARTED_HEAD, self.odd.get("started head", self.get("<Q", HEAD)))
                self.put("<I", STARTED, self.get("<I", ASKED))
            elif self.get("<I", RUNNING):
                self.expose()
            time.sleep(0.0005)

    def expose(self):
        self.frame_id += 1
        is_odd = self.get("<Q", TAIL) >= self.odd.get("when", 20)
        if is_odd and not self.was_odd and "do" in self.odd:
            self.odd["do"](self)
        if is_odd and "always" in self.odd:
            self.odd["always"](self)
        self.was_odd |= is_odd
        head, tail = self.get("<Q", HEAD), self.get("<Q", TAIL)
        if 0 <= head - tail < SLOTS and not self.odd.get("mute"):
            meta = {"camera": 0, "width": WIDTH, "height": HEIGHT, "format": 1, "cfa": 1, "pitch": 2 * WIDTH, "id": self.frame_id,
                    "time": 1_000_000 + 462_960 * self.frame_id, "black": 64.0, "white": 4095.0, "bytes": 2 * WIDTH * HEIGHT,
                    "dropped": 0}
            meta |= self.odd.get("meta", {}) if is_odd and tail < self.odd.get("until", 1 << 64) else {}
            place = HEADER_BYTES + head % SLOTS * STRIDE
            if place + META_BYTES <= len(self.memory):
                self.memory[place:place + META_BYTES] = struct.pack("<IIIIIIQQffQQ", *meta.values())
            self.put("<Q", HEAD, head + 1)
        if not self.odd.get("clock stands"):
            self.put("<Q", WATERMARK, 1_000_000 + 462_960 * self.frame_id)
        self.put("<I", HEAD_FUTEX, self.frame_id & 0xffffffff)


def write(kind, at, value):
    """A word of the header that changes while the ring is read."""
    return {"do": lambda ring: ring.put(kind, at, value)}


def cut(size):
    def work(ring):
        ring.memory = mmap.mmap(-1, HEADER_BYTES + SLOTS * STRIDE)  # or this program would be the one to end
        ring.file.truncate(size)

    return {"do": work}


def jump(ring):
    ring.put("<Q", HEAD, random.Random(ring.frame_id).randrange(1 << 64))


def close_and_open(ring):
    ring.put("<I", CLOSED, ring.frame_id & 1)


# Refused when it is opened, with its reason.
REFUSED = {
    "an empty file": {"size": 0, "bytes": b""},
    "a file of 10 bytes": {"size": 10, "bytes": b"0123456789"},
    "a header cut short": {"size": 100},
    "zeros": {"bytes": bytes(64)},
    "noise": {"bytes": random.Random(1).randbytes(192)},
    "another version": {"header": [(0, "<Q", MAGIC + (1 << 56))]},
    "no slots": {"header": [(SLOTS_AT, "<I", 0)]},
    "2^32 - 1 slots": {"header": [(SLOTS_AT, "<I", 0xffffffff)]},
    "a slot more than there is room for": {"header": [(SLOTS_AT, "<I", SLOTS + 1)]},
    "a stride of 0": {"header": [(STRIDE_AT, "<I", 0)]},
    "a stride of 64": {"header": [(STRIDE_AT, "<I", 64)]},
    "a stride of 2^32 - 64": {"header": [(STRIDE_AT, "<I", 0xffffffc0)]},
    "a stride that is odd": {"header": [(STRIDE_AT, "<I", STRIDE + 1)]},
    "slots times stride beyond 2^32": {"header": [(SLOTS_AT, "<I", 0x10000), (STRIDE_AT, "<I", 0x10000)]},
    "a file a byte too short": {"size": HEADER_BYTES + SLOTS * STRIDE - 1},
    "frames of no width": {"header": [(WIDTH_AT, "<I", 0)]},
    "frames 2^32 - 1 wide": {"header": [(WIDTH_AT, "<I", 0xffffffff)]},
    "frames 2^31 by 2^31": {"header": [(WIDTH_AT, "<I", 1 << 31), (HEIGHT_AT, "<I", 1 << 31)]},
    "frames of no height": {"header": [(HEIGHT_AT, "<I", 0)]},
    "frames larger than their records": {"header": [(HEIGHT_AT, "<I", 4 * HEIGHT)]},
    "another size than the stage's": {"header": [(WIDTH_AT, "<I", WIDTH - 1)]},
    "format 0": {"header": [(FORMAT_AT, "<I", 0)]},
    "format 99": {"header": [(FORMAT_AT, "<I", 99)]},
    "a colour filter of 2^32 - 1": {"header": [(CFA_AT, "<I", 0xffffffff)]},
    "0 bits": {"header": [(BITS_AT, "<I", 0)]},
    "77 bits": {"header": [(BITS_AT, "<I", 77)]},
    "closed": {"header": [(CLOSED, "<I", 1)]},
    "nobody fills it": {"no writer": True},
}
# Read, and found to be broken.
BROKEN = {
    "started far before its head": {"started head": (1 << 64) - 1000},
    "started behind its head": {"started head": 1 << 40},
    "head far from tail": write("<Q", HEAD, 1 << 50),
    "head of 2^64 - 1": write("<Q", HEAD, (1 << 64) - 1),
    "head back at 0": write("<Q", HEAD, 0),
    "head a slot too far": {"do": lambda ring: ring.put("<Q", HEAD, ring.get("<Q", HEAD) + SLOTS + 1)},
    "a head that jumps about": {"always": jump},
    "2^64 - 1 frames dropped, of which no frame tells": write("<Q", DROPPED, (1 << 64) - 1),
    "frames that tell of drops that the header does not": {"meta": {"dropped": 1}},
    "drops that are taken back": {"do": lambda ring: ring.put("<Q", DROPPED, 5), "meta": {"dropped": 5}, "until": 30},
    "cut to nothing": cut(0),
    "cut to its header": cut(HEADER_BYTES),
    "cut within its header": cut(10),
    "cut in the middle of its records": cut(HEADER_BYTES + SLOTS * STRIDE // 2),
}
# What says where things lie changes, which nobody looks at again; frames that are none; counts that nothing hangs on.
BORNE = {
    "no slots any more": write("<I", SLOTS_AT, 0),
    "2^32 - 1 slots any more": write("<I", SLOTS_AT, 0xffffffff),
    "a stride of 0 any more": write("<I", STRIDE_AT, 0),
    "a stride of 2^32 - 1 any more": write("<I", STRIDE_AT, 0xffffffff),
    "another width any more": write("<I", WIDTH_AT, 0xffffffff),
    "another format any more": write("<I", FORMAT_AT, 7),
    "another magic any more": write("<Q", 0, 0),
    "another tail": write("<Q", TAIL, 1 << 60),
    "another start": write("<I", ASKED, 77),
    "closed": write("<I", CLOSED, 1),
    "closed and open by turns": {"always": close_and_open},
    "a watermark of 2^64 - 1": write("<Q", WATERMARK, (1 << 64) - 1),
    "a watermark that goes back": {"always": lambda ring: ring.put("<Q", WATERMARK, 1)},
    "grown": {"do": lambda ring: ring.file.truncate(1 << 24)},
} | {f"frames whose {key} is {value}": {"meta": {key: value}} for key, value in (
    ("camera", 77), ("width", 0), ("width", 0xffffffff), ("width", WIDTH + 1), ("height", 0xffffffff), ("height", 0), ("height", HEIGHT + 1),
    ("format", 0), ("format", 2), ("format", 0xffffffff), ("cfa", 5), ("cfa", 0xffffffff), ("pitch", 0), ("pitch", 1), ("pitch", 0xffffffff),
    ("pitch", 2 * WIDTH + 1), ("id", 0), ("id", (1 << 64) - 1), ("time", 0), ("time", (1 << 64) - 1), ("bytes", 0), ("bytes", 1),
    ("bytes", (1 << 64) - 1), ("bytes", STRIDE), ("black", float("nan")), ("black", 1e30), ("white", float("inf")), ("white", -1.0))}
# Never end by themselves, or after a minute only: the first Ctrl-C.
WAITS = {
    "a camera that answers no start": {"deaf": True},
    "a camera without a frame, whose clock stands": {"mute": True, "clock stands": True},
    "a camera that somebody else has stopped": write("<I", RUNNING, 0),
    "frames without end, all at one time": {"meta": {"time": 5}, "clock stands": True, "when": 0},
}


def limit_memory():
    resource.setrlimit(resource.RLIMIT_AS, (4 << 30, 4 << 30))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))


def record_from(folder, odd, interrupt_s=None):
    stage, ring_path, board_path = folder / "stage.toml", folder / "cam0.ring", folder / "board.sock"
    stage.write_text(STAGE)
    board, ring = FakeBoard(board_path), Ring(ring_path, odd)
    ring.start()
    command = [STAGECTL, "run", "--stage", stage, "--sequence", SEQUENCE, "--nominal", "--board", f"socket:{board_path}",
               "--camera", f"ring:{ring_path}", "-o", folder / "out.rfa"]
    process = subprocess.Popen(list(map(str, command)), stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, errors="replace",
                               preexec_fn=limit_memory)
    try:
        if interrupt_s is not None:
            time.sleep(interrupt_s)
            process.send_signal(signal.SIGINT)
        _, errors = process.communicate(timeout=HANG_S)
        return process.returncode, errors
    except subprocess.TimeoutExpired:
        process.kill()
        process.communicate()
        return "hangs", ""
    finally:
        ring.ended = True
        ring.join()
        board.close()


def problem_of(case):
    name, odd, codes, said, interrupt_s = case
    with tempfile.TemporaryDirectory(dir="/dev/shm") as folder:
        code, errors = record_from(pathlib.Path(folder), odd, interrupt_s)
    is_right = code in codes and re.search(said, errors)
    return None if is_right else f"{name}: exit code {code}, {errors}"


# A camera of this kind has nothing to show to the optical code: an honest one records no slot, which is exit code 1.
CASES = [(name, odd, {1}, r"cam0\.ring", None) for name, odd in REFUSED.items()]
CASES += [(name, odd, {1, 2}, "ring.* is broken, its (count|file)", None) for name, odd in BROKEN.items()]
CASES += [(name, odd, {1, 2}, "stagectl: ", None) for name, odd in BORNE.items()]
CASES += [(name, odd, {1, 2}, "stagectl: ", 2) for name, odd in WAITS.items()]


def test_every_bad_ring_is_refused_or_ended_by_name():
    with concurrent.futures.ThreadPoolExecutor(6) as pool:
        problems = [problem for problem in pool.map(problem_of, CASES) if problem]
    assert not problems, f"{len(problems)} of {len(CASES)}:\n" + "\n".join(problems)


def test_what_is_no_file_is_no_ring(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    for path in (tmp_path / "pipe", "/dev/zero", "/dev/null", tmp_path):
        done = subprocess.run([STAGECTL, "run", "--sequence", SEQUENCE, "--nominal", "--board", "socket:/none", "--camera", f"ring:{path}",
                               "-o", tmp_path / "out.rfa"], capture_output=True, text=True, timeout=HANG_S)
        assert done.returncode == 1 and f"'{path}'" in done.stderr, done.stderr
