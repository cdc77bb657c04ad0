# SPDX-License-Identifier: MIT
# `stagectl play --share` lends the board out while it plays, and `stagectl swap` lets another sequence follow at a cycle's end:
# on the trace, no slot is missing or late.
import json
import signal
import socket
import struct
import subprocess
import threading

import pytest

import check_trace
from ols_board import wire
from ols_board.board import BOARD, ROOT, Link
from ols_board.program import CHAIN_BITS
from ols_board.usb import Usb

STAGECTL = ROOT / "build/host/bin/stagectl"
PERIOD_US, EXPOSURE_US = 5000, 400

pytestmark = pytest.mark.skipif(BOARD != "emulated", reason="needs the emulated board's USB and trace")


def write_sequence(folder, name, lamps, cycles=1, extra=""):
    """A slot for each of `lamps`, which are on the chain bits of their numbers."""
    slots = "".join(f'[[slot]]\nkind = "basis"\nlamps = [{lamp}]\nexposure_us = {EXPOSURE_US}\nperiod_us = {PERIOD_US}\n'
                    for lamp in lamps)
    path = folder / f"{name}.toml"
    path.write_text(f"cycles = {cycles}\n{extra}{slots}")
    return path


def slots_of(lamps):
    return [{"kind": wire.BASIS, "trigger_mask": 1, "exposure_ticks": EXPOSURE_US * 125, "period_ticks": PERIOD_US * 125,
             "bits": [int(n == lamp) for n in range(CHAIN_BITS)]} for lamp in lamps]


class Play:
    """`stagectl play` in its own process, with its board lent out."""

    def __init__(self, board, sequence, *arguments):
        self.shared = board.path / "shared.sock"
        board.plug_usb().usb.close()  # it is up
        command = [STAGECTL, "play", sequence, "--cycles", 0, "--board", f"socket:{board.path}/board.sock", "--json", *arguments]
        self.process = subprocess.Popen(list(map(str, command)), stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        self.triggers, self.plays = [], threading.Event()
        self.reader = threading.Thread(target=self._read)
        self.reader.start()
        self.plays.wait()

    def _read(self):
        for line in self.process.stdout:
            if line.endswith("\n"):  # not what a killed one had begun
                self.triggers.append(json.loads(line))
            self.plays.set()
        self.plays.set()

    def swap(self, sequence, *arguments):
        command = [STAGECTL, "swap", sequence, "--board", f"socket:{self.shared}", *arguments]
        return subprocess.run(list(map(str, command)), capture_output=True, text=True, timeout=300)

    def end(self, with_signal=None):
        if with_signal:
            self.process.send_signal(with_signal)
        errors = self.process.stderr.read()
        self.reader.join()
        return self.process.wait(timeout=300), errors


@pytest.fixture
def play(emulated, tmp_path):
    started = []

    def start(lamps, *arguments, board=None):
        board = board or emulated(trace=True)
        started.append(Play(board, write_sequence(tmp_path, "first", lamps), "--share", board.path / "shared.sock", *arguments))
        started[-1].board = board
        return started[-1]

    yield start
    for one in started:
        if one.process.poll() is None:
            one.process.kill()
            one.end()


def test_a_swapped_sequence_follows_without_a_gap_by_the_trace_and_the_log(play, tmp_path):
    first, second = [3, 50, 100, 150], [7, 8, 9]
    playing = play(first)
    swapped = playing.swap(write_sequence(tmp_path, "second", second), "--cycles", 5, "--json")
    assert swapped.returncode == 0, swapped.stderr
    report = json.loads(swapped.stdout)
    code, errors = playing.end()
    assert code == 0, errors
    assert (report["program"], report["slots"], report["cycles"], report["follows"]) == (1, 3, 5, True)
    cycles = report["after_cycles"]
    wanted = [(0, cycle, slot) for cycle in range(cycles) for slot in range(4)]
    wanted += [(1, cycle, slot) for cycle in range(5) for slot in range(3)]
    assert [(one["program"], one["cycle"], one["slot"]) for one in playing.triggers] == wanted
    playing.board.stop()
    whole = {"cycles": 1, "chain_bits": CHAIN_BITS, "slots": slots_of(first) * cycles + slots_of(second) * 5}
    found = check_trace.check(playing.board.trace, whole)
    assert found["right"], found


def test_the_board_is_asked_by_others_while_it_plays_and_one_at_a_time(play):
    playing = play([1, 2])
    command = [STAGECTL, "status", "--json", "--board", f"socket:{playing.shared}"]
    asked = subprocess.run(command, capture_output=True, text=True, timeout=300)
    assert asked.returncode == 0 and json.loads(asked.stdout)["state"] == "playing", asked.stderr
    link = Link(Usb(playing.shared))  # our own client, which shares no code with stagectl's
    assert link.status()["state"] == wire.PLAYING
    other = subprocess.run(command, capture_output=True, text=True, timeout=300)
    assert other.returncode == 1 and "is busy: another program has it" in other.stderr, other.stderr
    link.usb.close()
    code, errors = playing.end(signal.SIGINT)
    assert code == 0, errors
    assert [(one["cycle"], one["slot"]) for one in playing.triggers] == [divmod(n, 2) for n in range(len(playing.triggers))]
    assert not playing.shared.exists()


def test_who_comes_when_another_has_just_left_is_answered(play):
    playing = play([1, 2])
    for _ in range(60):
        link = Link(Usb(playing.shared))
        assert link.status()["state"] == wire.PLAYING
        link.usb.close()
    code, errors = playing.end(signal.SIGINT)
    assert code == 0, errors


@pytest.mark.parametrize("damage", [b"x" * 100, struct.pack("<IIBBHII8x", 0x54425355, 1, 1, 1, 0, 1 << 31, 0),
                                    struct.pack("<IIBBHII8x", 0x54425355, 1, 1, 0x82, 0, 64, 0) * 2,
                                    struct.pack("<IIBBHII8x", 0x54425355, 1, 1, 1, 0, 5000, 0) + bytes(5000)])
def test_a_client_that_speaks_nonsense_does_not_disturb_what_plays(play, damage):
    playing = play([1, 2])
    with socket.socket(socket.AF_UNIX) as client:
        client.connect(str(playing.shared))
        client.sendall(damage)
        client.settimeout(0.2)
        try:
            while client.recv(4096):
                pass
        except (TimeoutError, ConnectionError):
            pass
    link = Link(Usb(playing.shared))
    before = link.status()["cycles_played"]
    while link.status()["cycles_played"] < before + 3:
        pass
    link.usb.close()
    code, errors = playing.end(signal.SIGINT)
    assert code == 0, errors


def test_what_another_program_stops_ends_play_by_name(play):
    playing = play([1, 2])
    link = Link(Usb(playing.shared))
    link.ask(wire.STOP)
    code, errors = playing.end()
    assert code == 1 and "somebody stopped the board" in errors


def test_a_swap_is_refused_by_name_and_what_plays_goes_on(play, tmp_path):
    playing = play([1, 2])
    other_stage = tmp_path / "stage.toml"
    other_stage.write_text("[chain]\nbits = 200\n")
    inverted = "[[trigger]]\nline = 0\nactive_low = true\n"
    cases = [(write_sequence(tmp_path, "other", [5]), ["--stage", other_stage], "chain has 200 bits and the board's 176"),
             (write_sequence(tmp_path, "inverted", [5], extra=inverted), [], "refused: "),
             (write_sequence(tmp_path, "long", [5] * 1025), [], "1024"),
             (tmp_path / "none.toml", [], "none.toml")]
    for sequence, arguments, words in cases:
        swapped = playing.swap(sequence, *arguments)
        assert swapped.returncode == 1 and words in swapped.stderr, (words, swapped.stderr)
    before = len(playing.triggers)
    code, errors = playing.end(signal.SIGINT)
    assert code == 0, errors
    assert len(playing.triggers) > before and {one["program"] for one in playing.triggers} == {0}


def test_nothing_is_swapped_into_a_board_that_does_not_play(emulated, tmp_path):
    board = emulated()
    board.plug_usb().usb.close()
    sequence = write_sequence(tmp_path, "second", [5])
    command = [STAGECTL, "swap", sequence, "--board", f"socket:{board.path}/board.sock"]
    swapped = subprocess.run(list(map(str, command)), capture_output=True, text=True, timeout=300)
    assert swapped.returncode == 1 and "nothing plays" in swapped.stderr and "is idle" in swapped.stderr, swapped.stderr


def test_a_path_that_is_taken_is_not_shared(play, emulated, tmp_path):
    playing = play([1, 2])
    board = emulated()
    board.plug_usb().usb.close()
    taken = tmp_path / "file"
    taken.write_text("mine")
    for path, words in ((playing.shared, "another program listens"), (taken, "is not a socket"), (tmp_path / "no/where", "is there such a folder?")):
        command = [STAGECTL, "play", write_sequence(tmp_path, "another", [5]), "--board", f"socket:{board.path}/board.sock", "--share", path]
        refused = subprocess.run(list(map(str, command)), capture_output=True, text=True, timeout=300)
        assert refused.returncode == 1 and words in refused.stderr, refused.stderr
    assert taken.read_text() == "mine"
