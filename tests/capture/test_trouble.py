# SPDX-License-Identifier: MIT
"""Trouble on the machine that records: a wall clock that jumps, a disk that is slow or full. What was finished stays readable, and the
rest is named."""
import json
import os
import pathlib
import subprocess

import pytest

from virtual_take import VirtualStage, missing_slots, sequence, verify

HERE = pathlib.Path(__file__).resolve().parent


@pytest.fixture(scope="module")
def trouble(tmp_path_factory):
    library = tmp_path_factory.mktemp("trouble") / "trouble.so"
    subprocess.run(["cc", "-Wall", "-Wextra", "-Werror", "-shared", "-fPIC", "-o", library, HERE / "trouble.c", "-ldl"], check=True)
    return library


def take(stage, archive, cycles, *wrapper, **environment):
    """A take of single lamps, with its report."""
    command = stage.command("run", "--sequence", sequence("single"), "--nominal", "--cycles", cycles, "-o", archive, "--json")
    done = subprocess.run([*map(str, wrapper), *command], env=os.environ | environment, capture_output=True, text=True, timeout=300)
    return done


def files_of(archive):
    return {path.relative_to(archive): path.read_bytes() for path in archive.rglob("*") if path.is_file()}


def test_a_wall_clock_that_jumps_by_days_changes_no_byte_of_a_take(tmp_path, trouble):
    archives = []
    for name, environment in (("still", {}), ("jumping", {"LD_PRELOAD": str(trouble), "JUMPING_CLOCK": "1"})):
        with VirtualStage(tmp_path / name, "spheres.toml") as stage:
            done = take(stage, tmp_path / f"{name}.rfa", 2, **environment)
        assert done.returncode == 0, done.stderr
        archives.append(files_of(tmp_path / f"{name}.rfa"))
    assert archives[0] == archives[1] and len(archives[0]) > 3


def test_a_slow_disk_is_named_as_the_cause_and_costs_no_target_that_was_written(tmp_path, trouble):
    with VirtualStage(tmp_path / "work", "spheres.toml", "--pace", "wall") as stage:
        done = take(stage, tmp_path / "take.rfa", 80, LD_PRELOAD=str(trouble), SLOW_DISK_MS="400")
    assert done.returncode == 2, done.stderr
    report = json.loads(done.stdout)
    # A machine that is busy may be late by itself; not as much as the disk.
    assert max(report["causes"], key=report["causes"].get) == "disk_was_late", report["causes"]
    assert {slot["cause"] for slot in missing_slots(tmp_path / "take.rfa")} == set(report["causes"])
    checked = verify(tmp_path / "take.rfa")
    assert checked.returncode == 0, checked.stdout
    assert sum(line.startswith("ok") for line in checked.stdout.splitlines()) >= report["targets_written"] > 0


# The take's disk is a small file system in a mount namespace of its own; what is left on it is copied out at the end.
ON_A_SMALL_DISK = """
set -e
size=$1 disk=$2 kept=$3; shift 3
mount -t tmpfs -o size=$size disk "$disk"
code=0; "$@" || code=$?
cp -r "$disk/." "$kept"
exit $code
"""


def on_small_disk(folder, size):
    """What goes before a command; its take is found at `folder / kept` afterwards."""
    for name in ("disk", "kept"):
        (folder / name).mkdir()
    rights = [] if os.geteuid() == 0 else ["--map-root-user"]
    return ["unshare", *rights, "--mount", "sh", "-c", ON_A_SMALL_DISK, "sh", size, folder / "disk", folder / "kept"]


def test_a_disk_that_is_full_in_the_middle_ends_the_take_and_keeps_what_was_finished(tmp_path):
    with VirtualStage(tmp_path / "work", "spheres.toml") as stage:
        done = take(stage, tmp_path / "disk/take.rfa", 30, *on_small_disk(tmp_path, "6m"))
        state = stage.stagectl("status", "--json", camera=False)["state"]
    assert done.returncode != 0 and "No space left" in done.stderr, (done.returncode, done.stderr)
    assert state != "playing"
    finished = list((tmp_path / "kept/take.rfa/cam0").glob("target_??????.exr"))
    checked = verify(tmp_path / "kept/take.rfa")
    intact = sum(line.startswith("ok") for line in checked.stdout.splitlines())
    # A target may have been renamed and not journalled: one at most.
    assert 1 <= len(finished) < 30 and len(finished) - 1 <= intact <= len(finished), checked.stdout
