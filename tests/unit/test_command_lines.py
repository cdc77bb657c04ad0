# SPDX-License-Identifier: MIT
# What README promises of every program and verb: help with an example, --json, --version, and that nothing printed is lost.
import json
import pathlib
import re
import shutil
import subprocess

import numpy as np
import OpenEXR
import pytest

ROOT = pathlib.Path(__file__).resolve().parents[2]
BIN = ROOT / "build/host/bin"
SCENE = ROOT / "tools/stagesim/scenes/card.toml"
PROGRAMS = ("stagectl", "rf", "stagesim")
# What a board or a camera must answer; tests/capture and tests/hil run these with --json.
NEEDS_A_STAGE = {("stagectl", verb) for verb in ("run", "play", "swap", "status", "calibrate", "flash")} | {("stagesim", "run")}
# What a daemon must answer, or is; tests/daemon runs these with --json.
NEEDS_A_STAGE |= {("stagectl", verb) for verb in ("serve", "arm", "record", "stop", "takes", "preview", "log", "reload")}


def run(*command, **options):
    options = {"stdout": subprocess.PIPE} | options
    return subprocess.run([BIN / command[0], *map(str, command[1:])], stderr=subprocess.PIPE, text=True, **options)


def subcommands(*verb):
    """The verbs that a verb's help lists."""
    _, _, listing = run(*verb, "--help").stdout.partition("Subcommands:\n")
    return re.findall(r"^  (\S+)", listing.split("\n\n")[0], re.MULTILINE)


def verbs(*verb):
    """Every verb that does something, and those that it is under."""
    below = subcommands(*verb)
    return [verb] if not below else [found for name in below for found in verbs(*verb, name)]


VERBS = [verb for program in PROGRAMS for verb in verbs(program)]


def as_text(value):
    return " ".join(value) if isinstance(value, tuple) else str(value)


@pytest.mark.parametrize("verb", VERBS, ids=as_text)
def test_a_verb_has_help_with_an_example_and_json(verb):
    text = run(*verb, "--help").stdout
    assert re.search(rf"Example: {' '.join(verb)}\b", text), text
    assert re.search(r"^  --json\b", text, re.MULTILINE), text


@pytest.mark.parametrize("program", PROGRAMS)
def test_a_program_has_an_example_and_a_version(program):
    assert f"Example: {program} " in run(program, "--help").stdout
    version = re.search(r"project\(open_light_stage VERSION (\S+)", (ROOT / "CMakeLists.txt").read_text())[1]
    done = run(program, "--version")
    assert done.returncode == 0
    assert re.fullmatch(rf"{program} {re.escape(version)}( \(\w+(-dirty)?\))?\n", done.stdout), done.stdout


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    """A small archive, a map and lights."""
    folder = tmp_path_factory.mktemp("files")
    (folder / "photos").mkdir()
    for name, size in (("photos/a.exr", (6, 8)), ("photos/b.exr", (6, 8)), ("map.exr", (8, 16))):
        pixels = np.random.default_rng(1).random(size, dtype=np.float32)
        header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
        OpenEXR.File(header, {c: pixels for c in "RGB"}).write(str(folder / name))
    (folder / "lights.lp").write_text("2\na.exr 0 0 1\nb.exr 1 0 0\n")
    done = run("stagectl", "ingest", folder / "photos", "--lights", folder / "lights.lp", "-o", folder / "take.rfa")
    assert done.returncode == 0, done.stderr
    return folder


def command_of(verb, files, out):
    """A command that does the verb's work and succeeds."""
    take = files / "take.rfa"
    return verb + {
        ("stagectl", "sequence"): ("--basis", "single"),
        ("stagectl", "basis", "list"): (),
        ("stagectl", "basis", "report"): ("s159",),
        ("stagectl", "basis", "design"): ("--counts", "50", "--starts", "1", "--sweeps", "0", "-o", out / "basis.csv"),
        ("stagectl", "basis", "export"): ("s159",),
        ("stagectl", "grey"): (),
        ("stagectl", "doctor"): ("--list",),  # what it finds of this machine may be a failure: tests/capture/test_doctor.py
        ("stagectl", "ingest"): (files / "photos", "--lights", files / "lights.lp", "-o", out / "take.rfa"),
        ("rf", "info"): (take,),
        ("rf", "verify"): (take,),
        ("rf", "export"): (take, "-o", out / "lamps", "--contact-sheet", out / "sheet.png"),
        ("rf", "relight"): (take, "--env", files / "map.exr", "-o", out / "relit.exr"),
        ("rf", "weights"): ("--env", files / "map.exr"),
        ("rf", "furnace"): (),
        ("rf", "compare"): (files / "map.exr", files / "map.exr"),
        ("stagesim", "flow"): (SCENE, "--from-us", "0", "--to-us", "1", "-o", out / "flow.exr"),
        ("stagesim", "plan"): (SCENE,),
        ("stagesim", "render"): (SCENE, "--lamps", "3", "-o", out / "lit.exr"),
    }[verb]


OFFLINE = [verb for verb in VERBS if verb[:2] not in NEEDS_A_STAGE]


@pytest.mark.parametrize("verb", OFFLINE, ids=as_text)
def test_json_is_an_object_and_nothing_else(verb, files, tmp_path):
    done = run(*command_of(verb, files, tmp_path), "--json")
    assert done.returncode == 0, done.stderr
    assert isinstance(json.loads(done.stdout), dict)


@pytest.mark.parametrize("verb", OFFLINE, ids=as_text)
@pytest.mark.parametrize("options", [("--json",), ()], ids=["json", "text"])
def test_what_does_not_fit_on_a_full_disk_is_an_error(verb, options, files, tmp_path):
    command = command_of(verb, files, tmp_path)
    prints = run(*command, *options).stdout
    (tmp_path / "again").mkdir()
    with open("/dev/full", "w") as full:
        done = run(*command_of(verb, files, tmp_path / "again"), *options, stdout=full)
    assert (done.returncode, bool(done.stderr)) == ((1, True) if prints else (0, False)), done.stderr


@pytest.mark.parametrize("program", PROGRAMS)
@pytest.mark.parametrize("flag", ["--help", "--version"])
def test_help_and_version_that_do_not_arrive_are_an_error(program, flag):
    with open("/dev/full", "w") as full:
        done = run(program, flag, stdout=full)
    assert done.returncode == 1 and "what was printed did not all arrive" in done.stderr


def test_with_standard_output_closed_nothing_is_printed_into_a_file(files, tmp_path):
    command = [BIN / "rf", "relight", files / "take.rfa", "--env", files / "map.exr", "-o", tmp_path / "relit.exr", "--json"]
    shell = 'exec "$@" >&-'
    done = subprocess.run(["sh", "-c", shell, "sh", *map(str, command)], stderr=subprocess.PIPE, text=True)
    assert done.returncode == 1 and "did not all arrive" in done.stderr
    assert set(OpenEXR.File(str(tmp_path / "relit.exr"), separate_channels=True).channels()) == set("RGBA")


def test_ingest_without_the_program_beside_it_says_what_is_missing(tmp_path):
    alone = shutil.copy(BIN / "stagectl", tmp_path / "stagectl")
    done = subprocess.run([alone, "ingest", "photos", "--lights", "a.lp", "-o", "take.rfa"], cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 1 and "stagectl-ingest' (No such file or directory): install it beside stagectl" in done.stderr
