# SPDX-License-Identifier: MIT
"""What stagectl writes beside a take: accounts and standard output that cannot be written are told, and stop nothing."""
import json
import subprocess

import pytest

from virtual_take import BIN, VirtualStage, sequence


@pytest.fixture
def stage(tmp_path):
    with VirtualStage(tmp_path / "work", "spheres.toml") as stage:
        yield stage


def run(command, **options):
    return subprocess.run(list(map(str, command)), stderr=subprocess.PIPE, text=True, timeout=300, **options)


def take_command(stage, archive, *options):
    return stage.command("run", "--sequence", sequence("single"), "--nominal", "--cycles", 1, "-o", archive, *options)


def test_an_account_on_a_full_disk_is_told_and_the_take_is_whole(stage, tmp_path):
    archive = tmp_path / "take.rfa"
    done = run(take_command(stage, archive, "--frames", "/dev/full", "--json"), stdout=subprocess.PIPE)
    assert done.returncode == 1 and "/dev/full" in done.stderr
    assert json.loads(done.stdout)["targets_written"] == 1
    assert run([BIN / "rf", "verify", archive], stdout=subprocess.DEVNULL).returncode == 0


def test_an_account_does_not_replace_the_sequence(stage, tmp_path):
    text = sequence("single").read_text()
    (tmp_path / "sequence.toml").write_text(text)
    command = stage.command("run", "--sequence", tmp_path / "sequence.toml", "--nominal", "-o", tmp_path / "take.rfa",
                            "--frames", tmp_path / "sequence.toml")
    done = run(command, stdout=subprocess.PIPE)
    assert done.returncode == 1 and "which is read" in done.stderr
    assert (tmp_path / "sequence.toml").read_text() == text and not (tmp_path / "take.rfa").exists()


def test_play_goes_on_when_its_lines_find_no_room_and_says_so(stage):
    with open("/dev/full", "w") as full:
        done = run(stage.command("play", sequence("single"), "--cycles", 1, "--json", camera=False), stdout=full)
    assert done.returncode == 1 and "did not all arrive" in done.stderr
    status = stage.stagectl("status", "--cycles", "--json", camera=False)
    assert (status["fault"], status["triggers_fired"], status["cycles_played"]) == ("none", 180, 1)
    assert [cycle["as_logged"] for cycle in status["cycles"]] == [True]
