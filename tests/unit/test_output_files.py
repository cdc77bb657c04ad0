# SPDX-License-Identifier: MIT
# Outputs of the programs from outside: beside, never onto what is read, and whole or not at all.
import json
import os
import pathlib
import resource
import signal
import stat
import subprocess

import numpy as np
import OpenEXR
import pytest

from chained_journal import chained, checksum, with_index

ROOT = pathlib.Path(__file__).resolve().parents[2]
BIN = ROOT / "build/host/bin"
SCENE = ROOT / "tools/stagesim/scenes/card.toml"


def run(*command, code=0, **options):
    done = subprocess.run([BIN / command[0], *map(str, command[1:])], capture_output=True, text=True, **options)
    assert done.returncode == code, (done.returncode, done.stdout, done.stderr)
    return done.stdout if code == 0 else done.stderr


def write_exr(path, pixels):
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    OpenEXR.File(header, {name: pixels for name in "RGB"}).write(str(path))


@pytest.fixture
def take(tmp_path):
    """An archive of two lamps with a map beside it."""
    (tmp_path / "photos").mkdir()
    generator = np.random.default_rng(1)
    for name in ("a", "b"):
        write_exr(tmp_path / f"photos/{name}.exr", generator.random((40, 50), dtype=np.float32))
    write_exr(tmp_path / "map.exr", np.ones((8, 16), dtype=np.float32))
    (tmp_path / "lights.lp").write_text("2\na.exr 0 0 1\nb.exr 1 0 0\n")
    run("stagectl", "ingest", tmp_path / "photos", "--lights", tmp_path / "lights.lp", "-o", tmp_path / "take.rfa")
    return tmp_path / "take.rfa"


def contents(folder):
    """Every file under a folder, links as what they name."""
    return {str(p.relative_to(folder)): os.readlink(p) if p.is_symlink() else p.read_bytes()
            for p in sorted(folder.rglob("*")) if p.is_symlink() or p.is_file()}


def relight(take, *options, code=0):
    return run("rf", "relight", take, "--env", take.parent / "map.exr", *options, code=code)


def test_no_spelling_of_an_input_is_written_to(take, tmp_path):
    target = take / "cam0/target_000000.exr"
    (tmp_path / "link.exr").symlink_to(target)
    (tmp_path / "hard.exr").hardlink_to(target)
    (tmp_path / "folder").symlink_to(take / "cam0", target_is_directory=True)
    before = contents(tmp_path)
    names = [target, take / "manifest.json", take / "new.exr", tmp_path / "photos/../take.rfa/lights.lp", tmp_path / "link.exr",
             tmp_path / "hard.exr", tmp_path / "folder/new.exr", tmp_path / "map.exr"]
    for name in names:
        for option in (("-o", name), ("-o", tmp_path / "relit.exr", "--png", name)):
            assert "choose another" in relight(take, *option, code=1)
        if name != tmp_path / "map.exr":
            assert "choose another" in run("rf", "export", take, "--contact-sheet", name, code=1)
        assert contents(tmp_path) == before
    assert "choose another" in run("rf", "export", take, "-o", take / "lamps", code=1)
    assert "archive" in run("stagectl", "basis", "design", "--counts", "50", "-o", take / "basis.csv", code=1)
    assert "archive" in run("stagesim", "render", SCENE, "--lamps", "1", "-o", take / "lit.exr", code=1)
    assert contents(tmp_path) == before
    run("rf", "verify", take)


def test_devices_pipes_and_folders_stay_what_they_are(take, tmp_path):
    os.mkfifo(tmp_path / "pipe")
    for name, kind in ((tmp_path / "pipe", "a pipe"), (tmp_path / "photos", "a folder"), ("/dev/null", "a device")):
        for option in (("-o", name), ("-o", tmp_path / "relit.exr", "--png", name)):
            assert kind in relight(take, *option, code=1)
        assert kind in run("stagesim", "render", SCENE, "--lamps", "1", "-o", name, code=1)
        assert kind in run("stagectl", "basis", "report", "s159", "--plot", name, code=1)
    assert stat.S_ISFIFO((tmp_path / "pipe").stat().st_mode) and stat.S_ISCHR(os.stat("/dev/null").st_mode)
    assert not (tmp_path / "relit.exr").exists()


def test_two_outputs_of_one_name_are_refused(take, tmp_path):
    for second in (tmp_path / "x", tmp_path / "photos/../x"):
        assert "one file" in relight(take, "-o", tmp_path / "x", "--png", second, code=1)
    assert "one file" in relight(take, "-o", tmp_path / "x", "--png", tmp_path / "x", "--target", "all", code=1)
    assert "one file" in run("rf", "export", take, "-o", tmp_path / "x", "--contact-sheet", tmp_path / "x", code=1)
    assert "one file" in run("stagesim", "render", SCENE, "--lamps", "1", "-o", tmp_path / "x", "--png", tmp_path / "x", code=1)
    assert not (tmp_path / "x").exists()


def test_an_export_leaves_folders_of_others_alone(take, tmp_path):
    (tmp_path / "lamps.part").mkdir()
    (tmp_path / "lamps.part/notes.txt").write_text("mine")
    run("rf", "export", take, "-o", tmp_path / "lamps")
    assert (tmp_path / "lamps.part/notes.txt").read_text() == "mine"
    assert {p.name for p in (tmp_path / "lamps").iterdir()} == {"lamp_000.exr", "lamp_001.exr", "lights.lp"}


def test_a_scene_is_not_overwritten_by_its_picture(tmp_path):
    scene = tmp_path / "card.toml"
    scene.write_bytes(SCENE.read_bytes())
    assert "which is read" in run("stagesim", "render", scene, "--lamps", "1", "-o", scene, code=1)
    assert "which is read" in run("stagesim", "flow", scene, "--from-us", "0", "--to-us", "1", "-o", scene, code=1)
    assert "which is read" in run("stagesim", "run", scene, "--work", tmp_path / "work", "--vcd", scene, code=1)
    assert scene.read_bytes() == SCENE.read_bytes()


def limited(size):
    """Files may not grow beyond this, as on a full disk."""
    def limit():
        signal.signal(signal.SIGXFSZ, signal.SIG_DFL)
        resource.setrlimit(resource.RLIMIT_FSIZE, (size, size))
    return limit


def test_on_a_full_disk_older_files_stay_and_nothing_is_left_beside_them(take, tmp_path):
    outputs = ("-o", tmp_path / "relit.exr", "--png", tmp_path / "relit.png")
    relight(take, *outputs)
    before = contents(tmp_path)
    for size in (0, 200, 2000):
        error = run("rf", "relight", take, "--env", tmp_path / "map.exr", "--exposure", "1", *outputs, code=1,
                    preexec_fn=limited(size))
        assert "relit.exr" in error and "ulimit" in error
        assert "lamp_000" in run("rf", "export", take, "-o", tmp_path / "lamps", code=1, preexec_fn=limited(size))
        assert contents(tmp_path) == before


def add_targets(take):
    """Two more targets, and one that the recording noted as missing."""
    journal = [json.loads(line) for line in (take / "journal.jsonl").read_text().splitlines()]
    target = next(line for line in journal if line["event"] == "target")
    end = journal.pop()
    for index in (1, 3):
        file = f"cam0/target_{index:06}.exr"
        data = with_index((take / target["file"]).read_bytes(), index)
        (take / file).write_bytes(data)
        journal.append(target | checksum(data) | {"index": index, "file": file})
    journal.append({"event": "missing", "camera": 0, "index": 2, "why": "lost", "detail": None})
    journal.append({"event": "missing", "camera": 0, "index": 4, "through": 9, "why": "stopped"})
    journal.append({"event": "expect", "camera": 0, "targets": 12})
    (take / "journal.jsonl").write_bytes(chained([*journal, end | {"written": 3, "missing": 7}]))


def test_all_targets_are_exported_under_the_names_that_relight_gives_them(take, tmp_path):
    add_targets(take)
    done = subprocess.run([BIN / "rf", "export", take, "--target", "all", "-o", tmp_path / "lamps", "--contact-sheet",
                           tmp_path / "sheet.png", "--json"], capture_output=True, text=True, check=True)
    report = json.loads(done.stdout)
    assert [entry["target"] for entry in report["targets"]] == [0, 1, 3] and report["missing_targets"] == [{"index": 2}, {"index": 4, "through": 9}, {"index": 10, "through": 11}]
    assert "9 targets are missing" in done.stderr and "target 2, targets 4 to 9, targets 10 to 11" in done.stderr
    relight(take, "--target", "all", "-o", tmp_path / "relit.exr")
    for index in (0, 1, 3):
        assert (tmp_path / f"relit_{index:06}.exr").exists() and (tmp_path / f"sheet_{index:06}.png").exists()
        assert len(list((tmp_path / f"lamps_{index:06}").iterdir())) == 3
    run("rf", "export", take, "--target", "3", "-o", tmp_path / "third")
    assert (tmp_path / "third/lamp_000.exr").read_bytes() == (tmp_path / "lamps_000003/lamp_000.exr").read_bytes()


def test_an_export_of_all_targets_is_refused_before_the_first_where_one_has_no_place(take, tmp_path):
    add_targets(take)
    (tmp_path / "lamps_000003").mkdir()
    assert "lamps_000003' exists" in run("rf", "export", take, "--target", "all", "-o", tmp_path / "lamps", code=1)
    assert not (tmp_path / "lamps_000000").exists()


def test_a_name_that_ends_as_another_kind_of_file_is_refused(take, tmp_path):
    before = contents(tmp_path)
    for name in ("lit.png", "lit.jpg", "lit.exr.png", "lit", "lit.", "exr", ".exr"):
        assert ".exr" in relight(take, "-o", tmp_path / name, code=1)
        assert ".exr" in run("stagesim", "render", SCENE, "--lamps", "1", "-o", tmp_path / name, code=1)
    for name in ("lit.jpg", "other.exr", "lit"):
        assert ".png" in relight(take, "-o", tmp_path / "lit.exr", "--png", tmp_path / name, code=1)
        assert ".png" in run("rf", "export", take, "--contact-sheet", tmp_path / name, code=1)
    assert contents(tmp_path) == before
    relight(take, "-o", tmp_path / "lit.EXR", "--png", tmp_path / "lit.Png")
    assert (tmp_path / "lit.EXR").read_bytes()[:4] == b"\x76\x2f\x31\x01" and (tmp_path / "lit.Png").read_bytes()[:4] == b"\x89PNG"


def test_a_folder_that_is_not_there_is_named_before_anything_is_done(take, tmp_path):
    before = contents(tmp_path)
    for said in (relight(take, "-o", tmp_path / "no/lit.exr", code=1), relight(take, "-o", tmp_path / "lit.exr", "--png", tmp_path / "no/lit.png", code=1),
                 run("rf", "export", take, "-o", tmp_path / "no/lamps", code=1), run("rf", "export", take, "--contact-sheet", tmp_path / "no/sheet.png", code=1),
                 run("stagesim", "render", SCENE, "--lamps", "1", "-o", tmp_path / "no/lit.exr", code=1)):
        assert str(tmp_path / "no") in said and "check that the folder exists" in said and said.count("\n") == 1
    assert contents(tmp_path) == before


@pytest.mark.parametrize("target", ["1-5", "1,2", "-1", "+1", "0x0", "last", "ALL", " 0", "0 ", "1e0", "4294967296"])
def test_targets_that_are_no_choice_are_refused_as_such(take, tmp_path, target):
    said = relight(take, f"--target={target}", "-o", tmp_path / "lit.exr", code=1)
    assert "--target" in said and "`first`" in said and "`all`" in said
    assert "--target" in run("rf", "export", take, f"--target={target}", "-o", tmp_path / "lamps", code=1)


def test_a_target_that_is_not_there_is_named(take, tmp_path):
    assert "no finished target 7" in relight(take, "--target", "7", "-o", tmp_path / "lit.exr", code=1)
    relight(take, "--target", "0", "-o", tmp_path / "lit.exr")
