# SPDX-License-Identifier: MIT
"""Nothing waits for ever, whoever stops, dies or does not come; and frames that were for nobody, or for somebody who has gone,
are not taken for a later take's. Bounds are minutes: what must not happen is a wait without end."""
import contextlib
import json
import os
import random
import signal
import socket
import struct
import subprocess
import threading
import time

import pytest

from virtual_take import VirtualStage, identification, sequence, target_file

CYCLE = 180
LONG_TAKE = ("run", "--sequence", sequence("single"), "--nominal", "--cycles", 2000)


@pytest.fixture
def stage(tmp_path):
    with VirtualStage(tmp_path / "work", "spheres.toml") as started:
        yield started


def begin(stage, archive, *options, verb=LONG_TAKE):
    """A take that is under way: its first target is written."""
    run = subprocess.Popen(stage.command(*verb, "-o", archive, *options), stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    while not target_file(archive, 0).exists():
        assert run.poll() is None, run.communicate()
        time.sleep(0.02)
    return run


def status(stage):
    return stage.stagectl("status", "--json", camera=False)


def record_whole_take(stage, name):
    if status(stage)["state"] == "fault":
        stage.stagectl("status", "--clear-fault", camera=False)
    report = stage.stagectl("run", "--sequence", sequence("single"), "--nominal", "--cycles", 2, "-o", stage.folder / name, "--json")
    assert report["slots_missing"] == 0 and report["targets_written"] == 2
    assert report["cameras"][0]["missing_ids"] == 0 and report["cameras"][0]["dropped"] == 0
    return report


def test_a_board_that_played_with_nobody_recording_answers_and_records_afterwards(stage):
    printed = stage.stagectl("play", sequence("s159"), "--cycles", 4, camera=False)
    assert f"{4 * CYCLE} triggers" in printed
    assert status(stage)["state"] == "done"
    record_whole_take(stage, "after.rfa")
    assert "nobody records from camera 0" in stage.read_log()


def test_after_kill_9_of_a_take_the_stage_answers_and_records(stage):
    """KILLS=50 for the long version."""
    generator = random.Random(5)
    for n in range(int(os.environ.get("KILLS", 4))):
        run = begin(stage, stage.folder / f"killed{n}.rfa")
        time.sleep(generator.uniform(0, 1))
        run.kill()
        run.communicate()
        assert status(stage)["state"] != "playing"
        record_whole_take(stage, f"after{n}.rfa")


def test_a_stage_that_was_stopped_for_a_while_loses_nothing_and_answers(stage):
    archive = stage.folder / "take.rfa"
    run = begin(stage, archive, "--json", verb=("run", "--sequence", sequence("single"), "--nominal", "--cycles", 6))
    stage.process.send_signal(signal.SIGSTOP)
    time.sleep(7)
    stage.process.send_signal(signal.SIGCONT)
    printed, errors = run.communicate(timeout=300)
    assert run.returncode == 0, errors
    assert identification(archive)["slots_missing"] == 0
    assert status(stage)["state"] == "done"
    record_whole_take(stage, "after.rfa")


def test_a_take_that_follows_play_or_is_followed_by_it_is_whole(stage):
    """TURNS=30 for the long version. What was played before the take is none of its frames."""
    for n in range(int(os.environ.get("TURNS", 4))):
        stage.stagectl("play", sequence("s159"), "--cycles", 1 + n % 3, camera=False)
        record_whole_take(stage, f"take{n}.rfa")


def test_a_stage_that_died_is_named_as_the_cause_in_report_journal_and_manifest(stage):
    archive = stage.folder / "take.rfa"
    run = begin(stage, archive)
    stage.process.kill()
    _, errors = run.communicate(timeout=300)
    told = identification(archive)
    # The camera dies, and its board a moment after it: either may be missed first. (Cameras that die alone: tests/daemon.)
    cause = "camera_gone" if told["causes"].get("camera_gone") else "board_gone"
    end, name = (told["cameras"][0]["end"], "the camera") if cause == "camera_gone" else (told["board_end"], "the board at")
    assert run.returncode == 2 and name in errors and "is gone" in errors, errors
    assert name in end["why"] and "is gone" in end["why"] and end["cause"] == cause and told["causes"].get(cause)
    journal = (archive / "journal.jsonl").read_text()
    last = json.loads(journal.splitlines()[-2])
    assert last["event"] == "missing" and last["through"] == 1999 and " is gone: " in last["why"], last


def test_a_board_and_a_camera_that_another_program_has_are_busy_and_not_gone(stage):
    run = begin(stage, stage.folder / "take.rfa")
    for verb in (("status",), ("play", sequence("s159"))):
        printed = stage.stagectl(*verb, camera=False, code=1)
        assert "the board at" in printed and "is busy" in printed and "gone" not in printed, printed
    printed = stage.stagectl("run", "--sequence", sequence("single"), "--nominal", "-o", stage.folder / "other.rfa", code=1)
    assert "camera" in printed and "is busy" in printed, printed
    run.send_signal(signal.SIGINT)
    run.communicate(timeout=300)
    assert status(stage)["state"] != "playing"


def test_a_camera_that_sees_no_trigger_while_its_clock_goes_on_ends_the_take(tmp_path):
    """Wired to another line of the board's. In wall pace the clock never rests, so the watermark goes on without end."""
    other_line = "[[camera]]\nwidth = 64\nheight = 48\ntrigger = 1\n"
    with VirtualStage(tmp_path / "work", "spheres.toml", "--pace", "wall", stage=other_line) as stage:
        stage.stage.write_text(other_line.replace("trigger = 1", "trigger = 0"))
        archive = stage.folder / "take.rfa"
        printed = stage.stagectl("run", "--sequence", sequence("single"), "--nominal", "--cycles", 1, "-o", archive, code=1)
        assert "no frame came; check the camera, its trigger cable" in printed and not archive.exists()


class DeafLog:
    """Stands between stagectl and the board's socket, and lets the reply to the n-th request for the trigger log time out."""

    REQUEST_BYTES, REPLY_BYTES, READ_TRIGGER_LOG, TIMED_OUT = 28, 16, 9, -3

    def __init__(self, path, board, spoiled):
        self.board, self.left, self.deaf = board, spoiled, set()
        self.server = socket.socket(socket.AF_UNIX)
        self.server.bind(str(path))
        self.server.listen(1)
        self.begin(self.serve)

    @staticmethod
    def begin(carry, *ends):
        """In a thread of its own, until either end hangs up."""

        def work():
            with contextlib.suppress(OSError):
                carry(*ends)

        threading.Thread(target=work, daemon=True).start()

    def serve(self):
        client, _ = self.server.accept()
        board = socket.socket(socket.AF_UNIX)
        board.connect(str(self.board))
        self.begin(self.carry_back, board, client)
        while head := self.receive(client, self.REQUEST_BYTES):
            _, tag, _, endpoint, _, length, _, _ = struct.unpack("<IIBBHII8s", head)
            payload = b"" if endpoint & 0x80 else self.receive(client, length)
            if payload and self.is_log_request(payload):
                self.left -= 1
            if endpoint & 0x80 and self.left < 0:
                self.left = 1 << 30
                client.sendall(struct.pack("<IIiI", 0x52425355, tag, self.TIMED_OUT, 0))
                continue
            board.sendall(head + payload)
        board.close()

    def is_log_request(self, payload):
        return struct.unpack_from("<HHH", payload)[2] == self.READ_TRIGGER_LOG  # PROTOCOL.md: sync, size, type

    def carry_back(self, board, client):
        while head := self.receive(board, self.REPLY_BYTES):
            client.sendall(head + self.receive(board, struct.unpack("<IIiI", head)[3]))

    @staticmethod
    def receive(end, count):
        data = b""
        while len(data) < count:
            part = end.recv(count - len(data))
            if not part:
                return b""
            data += part
        return data


def test_play_whose_log_cannot_be_read_is_an_error(stage, tmp_path):
    DeafLog(tmp_path / "deaf.sock", stage.folder / "board.sock", spoiled=3)
    command = stage.command("play", sequence("s159"), camera=False)
    command[command.index("--board") + 1] = f"socket:{tmp_path}/deaf.sock"
    done = subprocess.run(command, capture_output=True, text=True, timeout=300)
    assert done.returncode == 1, done.stderr
    assert "log could not be read" in done.stderr and "did not answer in time" in done.stderr
