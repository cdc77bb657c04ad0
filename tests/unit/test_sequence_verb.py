# SPDX-License-Identifier: MIT
# `stagectl sequence` from outside: what it says of a cycle without light, of a key that is none, and that docs/sequences.md
# knows every key that the program knows.
import json
import pathlib
import re
import subprocess

import pytest

ROOT = pathlib.Path(__file__).resolve().parents[2]
STAGECTL = ROOT / "build/host/bin/stagectl"


def sequence(path, *options, code=0):
    done = subprocess.run([STAGECTL, "sequence", path, *options], capture_output=True, text=True)
    assert done.returncode == code, done.stdout + done.stderr
    return done.stdout + done.stderr


def error_of(tmp_path, text):
    (tmp_path / "sequence.toml").write_text(text)
    return sequence(tmp_path / "sequence.toml", code=1)


def test_a_cycle_without_light_has_no_lamp_that_flickers():
    photo = ROOT / "examples/sequence_photo.toml"
    text = sequence(photo)
    assert "no lamp is lit" in text and not re.search(r"lamp -?\d", text)
    assert json.loads(sequence(photo, "--json"))["worst_lamp"] is None


def test_of_the_lamps_that_are_lit_the_one_that_flashes_least_is_named():
    # Lamps 10 to 12 once a cycle of four slots; lamps 0 to 7 once as well, but matte and tracking lamps are others.
    assert re.search(r"lamp (0|10) flashes least, 250\.0 times a second", sequence(ROOT / "examples/sequence_cameras.toml"))


def test_light_that_flickers_too_fast_to_harm_is_said_to_flicker_by_nothing(tmp_path):
    path = tmp_path / "sequence.toml"
    path.write_text('[[slot]]\nkind = "basis"\nexposure_us = 100\nperiod_us = 1000\nlamps = [5]\n')
    assert "flicker from 3 to 60 Hz: none" in sequence(path)


@pytest.mark.parametrize(
    "text, said",
    [
        ("cylces = 2\n", "did you mean cycles?"),
        ("frame_rate = 2160\n", "did you mean frame_rate_hz?"),
        ("[exposure_us]\nbasi = 80\n", "did you mean basis?"),
        ("[exposure]\nbasis = 80\n", "did you mean exposure_us?"),
        ("tracking = 50\n", "it belongs in the table exposure_us or in the table offset_us"),
        ("[exposure_us]\ncycles = 50\n", "it belongs before the file's first table"),
        ("[[trigger]]\nline = 0\nofset_us = 1\n", "did you mean offset_us?"),
        ("[[slot]]\nexposure_us = 1\nlamp = [1]\n", "did you mean lamps?"),
        ("[harmonics]\nzzzzzzzz = 1\n", "known there: order, planes, sign"),
    ],
)
def test_a_key_that_is_none_is_told_which_was_meant(tmp_path, text, said):
    text = 'basis = "spherical_harmonics"\n' + text if text.startswith("[harmonics]") else text
    assert said in error_of(tmp_path, text)


def known_keys(tmp_path, head, name):
    """Those of a table, as the program lists them to whoever writes nonsense there."""
    told = error_of(tmp_path, f"{head}zzzzzzzzzzzzzzzz = 1\n")
    assert f"{name}zzzzzzzzzzzzzzzz is not a key" in told, told
    return re.search(r"known there: (.*)", told)[1].split(", ")


def test_the_page_on_sequences_names_every_key_in_the_section_of_its_table(tmp_path):
    page = (ROOT / "docs/sequences.md").read_text()
    tables = {
        "": "",
        "[exposure_us]": "[exposure_us]\n",
        "[offset_us]": "[offset_us]\n",
        "[harmonics]": 'basis = "spherical_harmonics"\n[harmonics]\n',
        "[[trigger]]": "[[trigger]]\nline = 0\n",
        "[[slot]]": "[[slot]]\nexposure_us = 10\n",
    }
    for table, head in tables.items():
        heading = f"### `{table}`" if table else "### Before the first table"
        assert heading in page, heading
        section = page.split(heading)[1].split("\n#")[0]
        documented = re.findall(r"^\| `(\w+)` \|", section, re.MULTILINE)
        known = set(known_keys(tmp_path, head, table.strip("[]") + ("." if table else "")))
        tables_below = {name.strip("[]") for name in tables if name} if not table else set()
        assert known - tables_below == set(documented), table
