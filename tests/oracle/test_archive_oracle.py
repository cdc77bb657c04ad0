# SPDX-License-Identifier: MIT
"""Archives and exports as other programs see them: PNG files encoded by zlib alone, linear light by numpy, and the OpenEXR
module reading what was ingested and exported."""
import json
import struct
import subprocess
import zlib
from pathlib import Path

import numpy as np
import OpenEXR
import pytest

ROOT = Path(__file__).resolve().parents[2]
BIN = ROOT / "build/host/bin"
WIDTH, HEIGHT, LAMPS = 150, 90, 7


def run(program, *arguments, code=0):
    done = subprocess.run([BIN / program, *map(str, arguments)], capture_output=True, text=True)
    assert done.returncode == code, done.stderr
    return done.stdout + done.stderr


def write_png(path, pixels):
    def chunk(kind, data):
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    height, width, _ = pixels.shape
    depth = 8 * pixels.itemsize
    rows = pixels.astype(pixels.dtype.newbyteorder(">")).reshape(height, -1)
    raw = b"".join(b"\0" + row.tobytes() for row in rows)
    header = struct.pack(">IIBBBBB", width, height, depth, 2, 0, 0, 0)
    path.write_bytes(b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", zlib.compress(raw)) + chunk(b"IEND", b""))


def srgb_to_linear(code):
    return np.where(code <= 0.04045, code / 12.92, ((code + 0.055) / 1.055) ** 2.4)


def close_as_half(stored, truth):
    """Within half a unit in the last place of an 11-bit significand, or of the smallest normal half."""
    return np.all(np.abs(stored - truth) <= np.maximum(np.abs(truth), 2.0**-14) * 2.0**-11 * 1.001)


@pytest.fixture(scope="module")
def photographs(tmp_path_factory):
    """A folder with spaces in its names, 8-bit and 16-bit pictures mixed, and an .lp file in another order."""
    folder = tmp_path_factory.mktemp("my photographs")
    generator = np.random.default_rng(5)
    pictures, lines = [], []
    for n in range(LAMPS):
        kind = np.uint16 if n % 3 == 1 else np.uint8
        pixels = generator.integers(0, np.iinfo(kind).max, (HEIGHT, WIDTH, 3), dtype=kind, endpoint=True)
        name = f"view {LAMPS - n}.png"
        write_png(folder / name, pixels)
        pictures.append(srgb_to_linear(pixels / np.iinfo(kind).max))
        lines.append(f"somewhere/else/{name} {n - 3},5 1,25 2")
    (folder / "lights.lp").write_text(f"{LAMPS}\n" + "\n".join(lines))
    return folder, pictures


@pytest.fixture(scope="module")
def take(photographs, tmp_path_factory):
    folder, _ = photographs
    path = tmp_path_factory.mktemp("takes") / "take.rfa"
    run("stagectl", "ingest", folder, "--lights", folder / "lights.lp", "-o", path, "--scene", "12B")
    return path


def lamp_pixels(part, lamp):
    return np.stack([part.channels[f"lamp_{lamp:03}.{c}"].pixels for c in "RGB"], axis=-1).astype(np.float64)


def test_an_ingested_folder_is_its_pictures_in_linear_light(photographs, take):
    file = OpenEXR.File(str(take / "cam0/target_000000.exr"), separate_channels=True)
    parts = {part.name(): part for part in file.parts}
    assert set(parts) == {"lamps", "mask"}
    assert len(parts["lamps"].channels) == 3 * LAMPS
    for lamp, truth in enumerate(photographs[1]):
        assert close_as_half(lamp_pixels(parts["lamps"], lamp), truth)
    assert not parts["mask"].channels["Y"].pixels.any()


def test_the_header_says_what_the_numbers_are(take):
    header = OpenEXR.File(str(take / "cam0/target_000000.exr")).parts[0].header
    assert header["colorInteropID"] == "lin_rec709_scene"
    assert header["valueUnit"] == "pixel"
    assert header["slateScene"] == "12B"
    assert header["framesPerSecond"] == 24
    first = np.array(header["lights"].splitlines()[0].split()[1:], dtype=float)
    truth = np.array([-3.5, 1.25, 2])
    assert np.allclose(first, truth / np.linalg.norm(truth), atol=1e-9)


def test_verify_says_one_when_a_byte_has_changed_and_zero_before(take, tmp_path):
    report = json.loads(run("rf", "verify", take, "--json"))
    assert report["ok"] and report["intact"] == ["cam0/target_000000.exr"]
    damaged = tmp_path / "damaged.rfa"
    subprocess.run(["cp", "-r", take, damaged], check=True)
    target = damaged / "cam0/target_000000.exr"
    content = bytearray(target.read_bytes())
    content[len(content) // 2] ^= 1
    target.write_bytes(content)
    report = json.loads(run("rf", "verify", damaged, "--json", code=1))
    assert not report["ok"] and report["intact"] == []
    assert "target_000000.exr" in report["problems"][0]


def test_the_journal_holds_the_checksum_that_zlib_computes(take):
    lines = [json.loads(line) for line in (take / "journal.jsonl").read_text().splitlines()]
    assert [line["event"] for line in lines] == ["begin", "target", "end"]
    content = (take / "cam0/target_000000.exr").read_bytes()
    assert lines[1]["bytes"] == len(content)
    assert int(lines[1]["crc32"], 16) == zlib.crc32(content)


def test_exported_pictures_are_the_lamps_and_the_lp_file_names_them(photographs, take, tmp_path):
    out = tmp_path / "lamps"
    run("rf", "export", take, "-o", out)
    lines = (out / "lights.lp").read_text().splitlines()
    assert lines[0] == str(LAMPS)
    names = [line.split()[0] for line in lines[1:]]
    assert names == sorted(names) == [f"lamp_{n:03}.exr" for n in range(LAMPS)]
    for name, truth in zip(names, photographs[1]):
        channels = OpenEXR.File(str(out / name), separate_channels=True).channels()
        assert close_as_half(np.stack([channels[c].pixels for c in "RGB"], axis=-1).astype(np.float64), truth)


def test_a_png_export_ingests_to_the_same_take(photographs, take, tmp_path):
    run("rf", "export", take, "-o", tmp_path / "lamps", "--format", "png")
    again = tmp_path / "again.rfa"
    run("stagectl", "ingest", tmp_path / "lamps", "--lights", tmp_path / "lamps/lights.lp", "-o", again)
    lamps = OpenEXR.File(str(again / "cam0/target_000000.exr"), separate_channels=True).parts[0]
    for lamp, truth in enumerate(photographs[1]):
        # One 8-bit step of sRGB is at most 2.4 / 1.055 / 255 of full scale; rounding errs by half of one.
        assert np.abs(lamp_pixels(lamps, lamp) - truth).max() < 0.5 * 2.4 / 1.055 / 255 + 2.0**-12


def test_export_refuses_a_directory_that_exists_and_a_target_that_does_not(take, tmp_path):
    assert "exists" in run("rf", "export", take, "-o", tmp_path, code=1)
    assert "no finished target 4" in run("rf", "export", take, "-o", tmp_path / "new", "--target", 4, code=1)
    assert list(tmp_path.iterdir()) == []


def test_info_prints_the_lights_by_their_own_names(take):
    report = json.loads(run("rf", "info", take, "--json"))
    assert report["finished"] and report["lamps"] == LAMPS
    assert [light["name"] for light in report["lights"]] == [f"view {LAMPS - n}.png" for n in range(LAMPS)]
    assert report["targets"][0]["width"] == WIDTH


def test_an_ingest_that_fails_leaves_nothing(photographs, tmp_path):
    folder, _ = photographs
    (tmp_path / "lights.lp").write_text("1\nnot there.png 0 0 1\n")
    message = run("stagectl", "ingest", folder, "--lights", tmp_path / "lights.lp", "-o", tmp_path / "take.rfa", code=1)
    assert "not there.png" in message
    assert [path.name for path in tmp_path.iterdir()] == ["lights.lp"]
