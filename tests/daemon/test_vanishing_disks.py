# SPDX-License-Identifier: MIT
# Disks that go away while a take is recorded: the takes', and the one that frames are spilled to. The disks are file systems of the test's
# own (vanishing_disk.py), mounted where only the daemon sees them; what is on them is looked at in the folders that they are made of.
import contextlib
import json
import os
import pathlib
import subprocess
import sys

import pytest

from stage_daemon import BIN, Daemon, Refused, Stage, assert_frames_have_their_slots, bring_to, targets_written, until

PROGRAM = pathlib.Path(__file__).resolve().parent / "vanishing_disk.py"


class VanishingDisk:
    """Files in `folder`; the daemon has them at `mount`."""

    def __init__(self, folder, mount):
        self.folder, self.mount, self.mood = folder, mount, folder.with_suffix(".mood")
        folder.mkdir(parents=True)
        mount.mkdir(parents=True)

    def be(self, mood=""):
        """In one step: the disk looks at it with every call."""
        new = self.mood.with_suffix(".new")
        new.write_text(mood)
        new.rename(self.mood)

    def run_by(self):
        return [sys.executable, PROGRAM, self.folder, self.mount, self.mood]


def under(*disks):
    """What a program is run by for the disks to be there."""
    rights = [] if os.geteuid() == 0 else ["--map-root-user"]
    return ["unshare", *rights, "--mount", *(word for disk in disks for word in disk.run_by())]


@pytest.fixture
def on_disks(tmp_path):
    """A stage whose daemon has its takes, and what it spills, on disks that can vanish."""
    with contextlib.ExitStack() as made:

        def make(spills=False, options=()):
            takes = VanishingDisk(tmp_path / "disks/takes", tmp_path / "takes")
            spill = VanishingDisk(tmp_path / "disks/spill", tmp_path / "spill")
            daemon = Daemon(tmp_path, f'memory_mb = 2\nspill = "{spill.mount}"' if spills else "")
            daemon.under = under(takes, spill)
            tried = subprocess.run([*map(str, daemon.under), "/bin/true"], capture_output=True, text=True, timeout=60)
            if tried.returncode != 0:
                pytest.skip(f"no file system of one's own can be mounted here: {tried.stderr.strip().splitlines()[-1]}")
            made.enter_context(Stage(daemon.work, *options))
            made.enter_context(daemon)
            for disk in (takes, spill):
                made.callback(disk.be)
            daemon.until_state("idle")
            return daemon, takes, spill

        yield make


def triggers_without_frame(daemon):
    take = daemon.call("status")["take"]
    return take["triggers_fired"] - take["cameras"][0]["frames_received"]


def verify(archive):
    done = subprocess.run([BIN / "rf", "verify", archive, "--json"], capture_output=True, text=True, timeout=60)
    return json.loads(done.stdout)


# All that it had said of itself is forgotten, or it is still read while nothing can be written.
@pytest.mark.parametrize("mood", ["gone", "broken"])
def test_a_takes_disk_that_vanishes_ends_the_take_and_is_named(on_disks, mood):
    daemon, takes, _ = on_disks()
    bring_to(daemon, "recording")
    until(lambda: targets_written(daemon) >= 3)
    takes.be(mood)
    before = len(verify(takes.folder / "cut_001.rfa")["intact"])
    daemon.until_state("fault")
    fault = daemon.call("status")
    assert "Input/output error" in fault["fault"] and str(daemon.takes) in fault["fault"], fault["fault"]
    assert fault["fault_is_latched"]
    end = daemon.events("take_finished")[-1]["data"]
    assert end["cameras"][0]["frames"] < 60 * 2160 / 4, "the light has gone out early"
    kinds = [event["event"] for event in daemon.events()]
    assert kinds.index("disk_failed") < kinds.index("dark") < kinds.index("fault")
    assert daemon.run("stop", "--json")["dark"]
    assert mood != "gone" or "Input/output error" in daemon.run("takes", code=1)
    daemon.run("status", "--clear-fault")
    assert "Input/output error" in daemon.run("record", "--slate", "none", code=1) and daemon.until_state("idle")
    takes.be()
    assert daemon.run("record", "--slate", "after", "--json")["targets_missing"] == 0
    assert len(verify(takes.folder / "after_001.rfa")["intact"]) == 2
    kept = verify(takes.folder / "cut_001.rfa")
    assert_frames_have_their_slots(takes.folder / "cut_001.rfa")
    assert len(kept["intact"]) >= max(before, end["targets_written"]) >= 3, kept
    listed = {take["take"]: take for take in daemon.run("takes", "--json")["takes"]}
    assert listed["cut_001"]["targets_written"] == len(kept["intact"])


@pytest.mark.parametrize("mood", ["gone", "broken"])
def test_a_takes_disk_that_has_vanished_before_the_light_is_an_error_and_no_light(on_disks, mood):
    daemon, takes, _ = on_disks()
    daemon.run("arm")
    takes.be(mood)
    said = daemon.run("record", code=1)
    assert "Input/output error" in said and str(daemon.takes) in said
    assert not daemon.events("take_began") and daemon.until_state("idle", "armed")
    takes.be()
    assert daemon.run("record", "--json")["targets_missing"] == 0


# The takes' disk stands still, so that frames wait, and go to the other one.
def test_a_spill_disk_that_vanishes_is_named_and_costs_what_was_on_it(on_disks):
    daemon, takes, spill = on_disks(True, ("--pace", "wall"))
    daemon.run("record", "--seconds", "600", "--no-wait", "--slate", "cut")
    until(lambda: targets_written(daemon) >= 3)
    takes.be("still")
    until(lambda: daemon.call("status")["take"]["cameras"][0]["frames_spilled"] > 100, 300)
    spill.be("gone")
    until(lambda: triggers_without_frame(daemon) > 600, 300)  # the camera's own buffers are full, too
    takes.be()
    until(lambda: daemon.call("status")["take"]["cameras"][0]["slots_missing"].get("disk_was_late", 0) > 100, 300)
    daemon.run("stop")
    daemon.until_state("fault")
    fault = daemon.call("status")
    assert "Input/output error" in fault["fault"] and str(spill.mount) in fault["fault"], fault["fault"]
    end = daemon.events("take_finished")[-1]["data"]
    late = {cause: end["causes"].get(cause, 0) for cause in ("disk_was_late", "host_was_late")}  # a busy machine's host is late, too
    assert late["disk_was_late"] > max(100, late["host_was_late"]), end["causes"]
    report = verify(takes.folder / "cut_001.rfa")
    assert len(report["intact"]) == end["targets_written"] >= 3
    archive = takes.folder / "cut_001.rfa"
    lines = [json.loads(line) for line in (archive / "journal.jsonl").read_text().splitlines()]
    missing = [line for line in lines if line["event"] == "missing"]
    assert any("spilled frames cannot be read" in line["why"] for line in missing), missing
    assert_frames_have_their_slots(archive)
    daemon.run("status", "--clear-fault")
    with pytest.raises(Refused, match="Input/output error"):
        daemon.call("record", slate="none")
    daemon.until_state("idle")
    spill.be()
    assert daemon.run("record", "--slate", "after", "--json")["targets_missing"] == 0
