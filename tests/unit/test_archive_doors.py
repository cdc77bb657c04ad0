# SPDX-License-Identifier: MIT
"""What stands in an archive's place, and limits of the system: an error that names the file, and nothing half-written."""
import json
import os
import pathlib
import resource
import socket
import subprocess

import numpy as np
import OpenEXR
import pytest

from chained_journal import chained, note_anew

ROOT = pathlib.Path(__file__).resolve().parents[2]
BIN = ROOT / "build/host/bin"
MANIFEST, JOURNAL, LIGHTS, TARGET = "manifest.json", "journal.jsonl", "lights.lp", "cam0/target_000000.exr"
SECONDS = 20  # what hangs, hangs for ever


def run(*command, limit=None):
    return subprocess.run([BIN / command[0], *map(str, command[1:])], capture_output=True, text=True, timeout=SECONDS,
                          preexec_fn=(lambda: resource.setrlimit(*limit)) if limit else None, check=False)


def write_picture(path, size, seed):
    random = np.random.default_rng(seed)
    channels = {c: random.random(size, dtype=np.float32) for c in "RGB"}
    OpenEXR.File({"compression": OpenEXR.NO_COMPRESSION, "type": OpenEXR.scanlineimage}, channels).write(str(path))


def ingest(folder, size, lamps=3):
    (folder / "photos").mkdir()
    for lamp in range(lamps):
        write_picture(folder / f"photos/{lamp}.exr", size, lamp)
    angles = np.linspace(0, 3, lamps)
    lines = [f"{i}.exr {np.cos(a)} {np.sin(a)} 0\n" for i, a in enumerate(angles)]
    (folder / "lights.lp").write_text(f"{lamps}\n" + "".join(lines))
    write_picture(folder / "map.exr", (8, 16), 99)
    done = run("stagectl", "ingest", folder / "photos", "--lights", folder / "lights.lp", "-o", folder / "take.rfa")
    assert done.returncode == 0, done.stderr
    return folder / "take.rfa"


@pytest.fixture
def take(tmp_path):
    return ingest(tmp_path, (6, 8))


def readers(take):
    folder = take.parent
    return [("info", take), ("verify", take), ("verify", "--deep", take),
            ("relight", take, "--env", folder / "map.exr", "-o", folder / "relit.exr"),
            ("export", take, "-o", folder / "lamps")]


def outputs(take):
    return sorted(p.name for p in take.parent.iterdir() if p.name not in ("photos", "lights.lp", "map.exr", "take.rfa"))


def put_pipe(path):
    os.mkfifo(path)


def put_device_link(path):
    path.symlink_to("/dev/zero")


def put_random_link(path):
    path.symlink_to("/dev/random")


def put_folder(path):
    path.mkdir()


def put_socket(path):
    folder = os.getcwd()
    os.chdir(path.parent)  # addresses are short
    socket.socket(socket.AF_UNIX).bind(path.name)
    os.chdir(folder)


def put_link_to_itself(path):
    path.symlink_to(path.name)


def put_link_to_the_same(path):
    """The very file, moved away: its bytes are right, and its place is not."""
    path.symlink_to(path.with_name(path.name + ".away"))


def put_nothing(path):
    pass


PLACED = (put_pipe, put_device_link, put_random_link, put_folder, put_socket, put_link_to_itself, put_link_to_the_same,
          put_nothing)


@pytest.mark.parametrize("put", PLACED, ids=lambda put: put.__name__)
@pytest.mark.parametrize("name", (MANIFEST, JOURNAL, LIGHTS, TARGET))
def test_only_regular_files_of_the_archive_are_read(take, name, put):
    (take / name).rename(take / f"{name}.away")
    put(take / name)
    for verb in readers(take):
        done = run("rf", *verb)
        needs_it = name in (MANIFEST, JOURNAL) or verb[0] == "verify" or (name == TARGET and verb[0] != "info")
        assert done.returncode == (1 if needs_it else 0), (verb[0], done.stderr)
        if needs_it or name == TARGET:
            assert pathlib.Path(name).name in done.stdout + done.stderr
        if needs_it:
            assert outputs(take) == []
        elif verb[0] != "info":
            for path in take.parent.glob("relit.exr"):
                path.unlink()
            subprocess.run(["rm", "-rf", take.parent / "lamps"], check=True)


@pytest.mark.parametrize("put", (put_pipe, put_link_to_the_same, put_device_link), ids=lambda put: put.__name__)
def test_a_cameras_folder_is_a_folder(take, put):
    (take / "cam0").rename(take / "cam0.away")
    put(take / "cam0")
    for verb in readers(take)[1:]:
        done = run("rf", *verb)
        assert done.returncode == 1 and "cam0" in done.stdout + done.stderr
    assert outputs(take) == []


@pytest.mark.parametrize("name", ("../../take.rfa/cam0/target_000000.exr", "cam0/../cam0/target_000000.exr",
                                  "/etc/passwd", "cam0//target_000000.exr", "cam0/target_0.exr", "", ".", "cam1/x"))
def test_a_journal_names_its_own_files_alone(take, name):
    lines = [json.loads(line) for line in (take / JOURNAL).read_text().splitlines()]
    for line in lines:
        if line["event"] == "target":
            line["file"] = name
    (take / JOURNAL).write_bytes(chained(lines))
    done = run("rf", "verify", take)
    assert done.returncode == 1 and f"{JOURNAL}:" in done.stdout and "file" in done.stdout
    assert run("rf", *readers(take)[3]).returncode == 1
    assert outputs(take) == []


def test_one_changed_bit_is_refused_and_read_where_the_check_is_left_out(take):
    data = bytearray((take / TARGET).read_bytes())
    data[-40] ^= 1
    (take / TARGET).write_bytes(data)
    for verb in readers(take)[1:]:
        done = run("rf", *verb)
        assert done.returncode == 1 and "CRC-32" in done.stdout + done.stderr
        assert outputs(take) == []
    for verb in readers(take)[3:]:
        assert run("rf", *verb, "--unchecked").returncode == 0


def test_deep_finds_samples_that_were_wrong_before_they_were_noted(take):
    """A NaN in the lamps and a mask of unknown bits, with checksums that agree: by OpenEXR's own writer."""
    assert run("rf", "verify", "--deep", take).returncode == 0
    whole = (take / TARGET).read_bytes()
    lamps = OpenEXR.File(str(take / TARGET), separate_channels=True).parts[0].channels["lamp_001.G"].pixels
    at = whole.index(lamps[0].astype("<f2").tobytes())
    for value in (b"\x00\x7e", b"\x00\x7c"):
        data = whole[:at] + value + whole[at + 2:]
        (take / TARGET).write_bytes(data)
        note_anew(take)
        assert run("rf", "verify", take).returncode == 0
        done = run("rf", "verify", "--deep", take)
        assert done.returncode == 1 and TARGET in done.stdout and "lamps" in done.stdout


@pytest.mark.parametrize("size", ((1, 1), (1, 7), (7, 1), (1, 200), (2, 2)))
def test_the_smallest_pictures_go_through_every_verb(tmp_path, size):
    take = ingest(tmp_path, size)
    for verb in readers(take):
        done = run("rf", *verb)
        assert done.returncode == 0, (verb[0], done.stderr)
    assert OpenEXR.File(str(tmp_path / "relit.exr"), separate_channels=True).channels()["R"].pixels.shape == size


def is_started(limit):
    """Whether the system's loader and the libraries' own beginnings get by with the limit."""
    return run("rf", "--version", limit=limit).returncode == 0


def test_memory_that_runs_out_is_an_error_and_leaves_nothing(tmp_path):
    take = ingest(tmp_path, (480, 640), lamps=8)
    ended = set()
    for megabytes in (250, 280, 320, 400, 4000):
        limit = (resource.RLIMIT_AS, (megabytes << 20,) * 2)
        if not is_started(limit):
            continue
        for verb in readers(take):
            done = run("rf", *verb, limit=limit)
            ended.add((verb[0], done.returncode))
            assert done.returncode in (0, 1), (megabytes, verb[0], done.stderr)
            if done.returncode == 1:
                assert "memory ran out" in done.stdout + done.stderr
                assert outputs(take) == []
            subprocess.run(["rm", "-rf", tmp_path / "lamps", tmp_path / "relit.exr"], check=True)
    assert {("relight", 0), ("relight", 1), ("export", 0), ("export", 1)} <= ended


@pytest.mark.parametrize("verb", (3, 4))
def test_a_limit_of_file_sizes_is_an_error_and_leaves_nothing(tmp_path, verb):
    take = ingest(tmp_path, (200, 300))
    done = run("rf", *readers(take)[verb], limit=(resource.RLIMIT_FSIZE, (4096, 4096)))
    assert done.returncode == 1 and "ulimit -f" in done.stderr, done.stderr
    assert outputs(take) == []


def test_ingest_at_a_limit_of_file_sizes_leaves_nothing(tmp_path):
    take = ingest(tmp_path, (200, 300))
    done = run("stagectl", "ingest", tmp_path / "photos", "--lights", tmp_path / "lights.lp", "-o", tmp_path / "b.rfa",
               limit=(resource.RLIMIT_FSIZE, (16384, 16384)))
    assert done.returncode == 1 and done.stderr.startswith("stagectl ingest: "), done.stderr
    assert outputs(take) == []


def test_descriptors_that_run_out_are_an_error(take):
    codes = set()
    for most in (4, 5, 6, 8):
        for verb in readers(take):
            # Libraries are closed again once they are loaded.
            done = run("rf", *verb, limit=(resource.RLIMIT_NOFILE, (most, most)))
            if "shared libraries" in done.stderr:
                continue
            codes.add(done.returncode)
            assert done.returncode in (0, 1), (most, verb[0], done.stderr)
            assert done.returncode == 0 or done.stdout + done.stderr
            assert not [name for name in outputs(take) if "part" in name]
            subprocess.run(["rm", "-rf", take.parent / "lamps", take.parent / "relit.exr"], check=True)
    assert 1 in codes


@pytest.mark.parametrize("program", ("rf", "stagectl", "stagesim"))
@pytest.mark.parametrize("flags", (("--help",), ("-h",), ("--version",), ()))
def test_a_word_that_is_no_verb_is_an_error_with_help_too(program, flags):
    done = run(program, "relihgt", *flags)
    assert done.returncode not in (0, 1) and not done.stdout
    assert "relihgt" in done.stderr or not flags
