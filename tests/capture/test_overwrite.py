# SPDX-License-Identifier: MIT
"""What a take does to what stood there before, and what stands there after one that failed."""
import json
import subprocess
import time

import pytest

from virtual_take import BIN, VirtualStage, sequence, target_file, verify


def entries(folder):
    return sorted(path.name for path in folder.iterdir())


def contents(archive):
    return {path.relative_to(archive): path.read_bytes() for path in archive.rglob("*") if path.is_file()}


def run_arguments(archive, *options, cycles=1):
    return ["run", "--sequence", sequence("single"), "--nominal", "--cycles", cycles, "-o", archive, *options]


def test_a_board_that_refuses_leaves_the_old_take_whole_and_no_empty_new_one(tmp_path):
    takes = tmp_path / "takes"
    takes.mkdir()
    old, fresh = takes / "old.rfa", takes / "fresh.rfa"
    with VirtualStage(tmp_path / "work", "spheres.toml") as stage:
        stage.stagectl(*run_arguments(old))
        before = contents(old)
        # A host that dies while the board plays: host lost, latched.
        doomed = takes / "doomed.rfa"
        run = subprocess.Popen(stage.command(*run_arguments(doomed, cycles=2000)), stderr=subprocess.DEVNULL)
        while not target_file(doomed, 0).exists():
            assert run.poll() is None
            time.sleep(0.02)
        run.kill()
        run.wait()
        while stage.stagectl("status", "--json", camera=False)["state"] != "fault":
            time.sleep(0.05)
        for archive, options in ((old, ["--overwrite"]), (fresh, [])):
            assert "latched fault" in stage.stagectl(*run_arguments(archive, *options), code=1)
        assert contents(old) == before
        assert entries(takes) == ["doomed.rfa", "old.rfa"]
        stage.stagectl("status", "--clear-fault", camera=False)
        stage.stagectl(*run_arguments(fresh))
        stage.stagectl(*run_arguments(old, "--overwrite", cycles=2))
    assert entries(takes) == ["doomed.rfa", "fresh.rfa", "old.rfa"]
    assert "2 targets intact" in verify(old).stdout and verify(old).returncode == 0


def test_a_camera_that_is_not_the_stages_and_one_whose_frames_are_not_leave_the_old_take(tmp_path):
    takes = tmp_path / "takes"
    takes.mkdir()
    archive = takes / "take.rfa"
    faults = tmp_path / "faults.toml"
    # The second take's frames, all of them, are two rows short.
    faults.write_text("".join(f'[[fault]]\nkind = "wrong_size"\ntrigger = {trigger}\n' for trigger in range(180, 360)))
    with VirtualStage(tmp_path / "work", "spheres.toml", "--inject", faults) as stage:
        stage.stagectl(*run_arguments(archive))
        before = contents(archive)
        printed = stage.stagectl(*run_arguments(archive, "--overwrite"), code=1)
        assert "64 x 46 pixels" in printed and "nothing is kept" in printed
        stage.stage.write_text("[[camera]]\nwidth = 80\nheight = 48\n")
        printed = stage.stagectl(*run_arguments(archive, "--overwrite"), code=1)
        assert "width" in printed and "64" in printed and "80" in printed
    assert contents(archive) == before and entries(takes) == ["take.rfa"]


def test_a_take_that_is_being_recorded_is_not_overwritten(tmp_path):
    archive = tmp_path / "take.rfa"
    with VirtualStage(tmp_path / "work", "spheres.toml") as stage:
        first = subprocess.Popen(stage.command(*run_arguments(archive, cycles=12)), stderr=subprocess.PIPE, text=True)
        while not archive.exists():
            assert first.poll() is None
            time.sleep(0.02)
        assert "being recorded" in stage.stagectl(*run_arguments(archive, "--overwrite"), code=1)
        _, printed = first.communicate(timeout=300)
        assert first.returncode == 0, printed
    checked = verify(archive)
    assert checked.returncode == 0 and "12 targets intact" in checked.stdout


def test_a_disk_that_fills_up_during_a_take_names_every_target_it_cost(tmp_path):
    """The disk is a tmpfs in a mount namespace; what is on it is looked at there."""
    disk = tmp_path / "disk"
    disk.mkdir()
    # A target of 64 x 48 mosaic pixels, 156 lamps, half floats is 1 MB; the manifest's room and the journal's take 1.1.
    script = 'mount -t tmpfs -o size=4500k disk "$0" || exit 77; "$@"; echo "exit $?"; ' + (
        f'"{BIN}/rf" verify "$0/take.rfa"; echo "exit $?"; "{BIN}/rf" info --json "$0/take.rfa"'
    )
    with VirtualStage(tmp_path / "work", "spheres.toml") as stage:
        command = stage.command(*run_arguments(disk / "take.rfa", cycles=6))
        done = subprocess.run(["unshare", "-m", "sh", "-c", script, disk, *command], capture_output=True, text=True)
    if done.returncode == 77 or "unshare" in done.stderr:
        pytest.skip("mounting a small disk needs rights that are not given here")
    taken, checked, info = done.stdout.split("exit ")
    assert "No space left on device: free space there or choose another disk" in done.stderr
    assert checked.startswith("1\n") and info.startswith("0\n")
    report = json.loads(info[2:])
    missing = [target["index"] for target in report["targets"] if "missing" in target]
    written = [target["index"] for target in report["targets"] if "file" in target]
    assert report["finished"] and written and missing and sorted(written + missing) == list(range(6))
    assert all("No space left" in target["missing"] for target in report["targets"] if "missing" in target)
    assert f"{len(written)} targets intact, {len(missing)} missing, 0 problems" in checked
