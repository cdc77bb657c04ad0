# SPDX-License-Identifier: MIT
# What belongs to pictures in a folder of them: names, light positions, masks, damage, sizes, exposures.
import os
import struct
import subprocess

import numpy as np
import OpenEXR
import pytest
import tifffile
from PIL import Image
from PIL.TiffImagePlugin import IFDRational

from picture_files import png, png_chunk
from picture_folder import CODES8, CODES16, GREY8, HEIGHT, SRGB16, STAGECTL, WIDTH, folder, near

# --- names ---

def test_names_of_another_unicode_form_or_slash_find_their_pictures(folder):
    for name in ("Atelier_é.png", "ü 2.png", "plain.png"):
        folder.add(name, png(CODES16))
    (folder.path / "sub").mkdir()
    (folder.path / "sub/file.png").write_bytes(png(CODES16[::-1].copy()))
    text = "4\nAtelier_e\u0301.png 0 0 1\nu\u0308 2.PNG 0 1 0\nplain.png 1 0 0\nsub\\file.png 0 1 1\n"
    folder.lights.write_bytes(b"\xff\xfe" + text.encode("utf-16-le"))
    light = folder.light()
    near(light[3], SRGB16[::-1])


@pytest.mark.parametrize("encode", [lambda t: t.encode("utf-16"), lambda t: b"\xfe\xff" + t.encode("utf-16-be"), lambda t: t.encode("utf-16-le"),
                                    lambda t: t.encode("utf-8-sig"), lambda t: t.replace("\n", "\r").encode(),
                                    lambda t: t.replace("\n", "\r\n").encode()])
def test_light_files_of_any_system_are_read(folder, encode):
    folder.add("a.png", png(CODES16))
    folder.lights.write_bytes(encode("1\na.png 0,0 0 1e200\n"))
    near(folder.light()[0], SRGB16)
    assert (folder.archive / "lights.lp").read_text() == "1\nlamp_000 0.000000000 0.000000000 1.000000000\n"


@pytest.mark.parametrize("lines, word", [("b.png 0 0 2", "stands in the direction of 'a.png'"), ("b.png 0 0 nan", "no light"),
                                         ("b.png 0 0 0", "no light"), ("b.png 0 0 1e999", "no light"), ("b.png 0 1 1 0", "intensity"),
                                         ("b.png 0 1 1 2", "columns")])
def test_lights_that_cannot_be_are_named_at_ingest(folder, lines, word):
    for name in ("a.png", "b.png"):
        folder.add(name, png(CODES16))
    folder.lights.write_text(f"2\na.png 0 0 1\n{lines}\n")
    refusal = folder.refusal()
    assert word in refusal and "lights.lp:3" in refusal


def test_a_link_that_leads_nowhere_in_the_folder_harms_nothing(folder):
    folder.add("a.png", png(CODES16))
    folder.lights.write_text("1\nA.png 0 0 1\n")
    for i in range(20):
        (folder.path / f"{i}.png").symlink_to("none")
    near(folder.light()[0], SRGB16)


def test_intensities_all_have_names_or_none_has_and_a_path_tells_pictures_of_one_name_apart(folder, tmp_path):
    for name in ("x", "y"):
        (folder.path / name).mkdir()
        folder.add(f"{name}/1.png", png(CODES16))
    folder.lights.write_text("2\nx/1.png 0 0 1\ny/1.png 0 1 1\n")
    (tmp_path / "i.txt").write_text("y/1.png 4\nx/1.png 2\n")
    light = folder.light("--intensities", tmp_path / "i.txt")
    near(light[0], SRGB16 / 2)
    near(light[1], SRGB16 / 4)
    for text, line in (("2\ny/1.png 4\n", 2), ("y/1.png 4\n2\n", 2)):
        (tmp_path / "i.txt").write_text(text)
        done = folder.run("--intensities", tmp_path / "i.txt")
        assert done.returncode == 1 and f"i.txt:{line}: some lines have names and others none" in done.stderr


# --- masks ---

def outside(folder):
    part = OpenEXR.File(str(folder.archive / "cam0/target_000000.exr"), separate_channels=True).parts[1]
    return part.channels["Y"].pixels & 4 != 0


INSIDE = GREY8 > 100


@pytest.mark.parametrize("kind", ["white", "ones", "alpha", "palette", "bits"])
def test_masks_are_read_as_labelling_and_matting_programs_write_them(folder, tmp_path, kind):
    folder.add("a.png", png(CODES16))
    if kind == "white":
        Image.fromarray(np.where(INSIDE, 255, 0).astype(np.uint8)).save(tmp_path / "m.png")
    if kind == "ones":
        Image.fromarray(INSIDE.astype(np.uint8)).save(tmp_path / "m.png")
    if kind == "alpha":
        Image.fromarray(np.dstack([CODES8, np.where(INSIDE, 255, 0).astype(np.uint8)])).save(tmp_path / "m.png")
    if kind == "palette":
        picture = Image.fromarray(INSIDE.astype(np.uint8), "P")
        picture.putpalette([0, 0, 0, 128, 0, 0])
        picture.save(tmp_path / "m.png")
    if kind == "bits":
        Image.fromarray(np.where(INSIDE, 255, 0).astype(np.uint8)).convert("1").save(tmp_path / "m.tif")
    folder.light("--mask", tmp_path / ("m.tif" if kind == "bits" else "m.png"))
    assert (outside(folder) == ~INSIDE).all()
    assert ("is 1 of 255" in folder.said()) == (kind == "ones")
    assert ("alpha says" in folder.said()) == (kind == "alpha")


def test_a_mask_without_an_inside_is_warned_of(folder, tmp_path):
    folder.add("a.png", png(CODES16))
    Image.fromarray(np.zeros((HEIGHT, WIDTH), np.uint8)).save(tmp_path / "m.png")
    folder.light("--mask", tmp_path / "m.png")
    assert "nothing is inside" in folder.said()


# --- damage ---

def pictures_to_damage(path):
    y, x = np.mgrid[0:120, 0:160]
    noise = np.random.default_rng(2).normal(0, 4, (120, 160, 3))
    picture = np.clip(np.dstack([128 + 100 * np.sin(x / 17 + y / 40), x * 1.5, y * 2.0]) + noise, 0, 255).astype(np.uint8)
    Image.fromarray(picture).save(path / "d.png")
    Image.fromarray(picture).save(path / "d.jpg", quality=90)
    Image.fromarray(picture).save(path / "p.jpg", quality=90, progressive=True)
    Image.fromarray(picture).save(path / "d.webp")
    tifffile.imwrite(path / "z.tif", picture, photometric="rgb", compression="zlib", rowsperstrip=16, metadata=None)
    tifffile.imwrite(path / "n.tif", picture, photometric="rgb", rowsperstrip=16, metadata=None)
    tifffile.imwrite(path / "l.tif", picture, photometric="rgb", compression="lzw", rowsperstrip=16, metadata=None)
    return ["d.png", "d.jpg", "p.jpg", "d.webp", "z.tif", "n.tif", "l.tif"]


def test_pictures_that_are_cut_short_are_refused_by_name(folder, tmp_path):
    for name in pictures_to_damage(tmp_path):
        whole = (tmp_path / name).read_bytes()
        for share in (0.3, 0.6, 0.95):
            path = folder.add(name, whole[:int(len(whole) * share)])
            refusal = folder.refusal()
            assert name in refusal and refusal.count("\n") == 0, refusal
        path.unlink()
        folder.lights.unlink()


@pytest.mark.parametrize("name", ["d.png", "z.tif"])
def test_one_wrong_bit_in_a_format_with_checksums_is_refused(folder, tmp_path, name):
    pictures_to_damage(tmp_path)
    whole = (tmp_path / name).read_bytes()
    generator = np.random.default_rng(3)
    for place in generator.integers(len(whole) // 3, len(whole) * 2 // 3, 12):
        damaged = bytearray(whole)
        damaged[place] ^= 1 << int(generator.integers(8))
        folder.add(name, bytes(damaged))
        refusal = folder.refusal()
        assert name in refusal and refusal.count("\n") == 0


def test_zeros_in_the_middle_of_a_jpeg_file_are_refused(folder, tmp_path):
    # A third of the file. Short ones can give valid codes and leave no trace: T.81 has no checksums.
    pictures_to_damage(tmp_path)
    for name in ("d.jpg", "p.jpg"):
        whole = bytearray((tmp_path / name).read_bytes())
        third = len(whole) // 3
        whole[third:2 * third] = bytes(third)
        path = folder.add(name, bytes(whole))
        assert f"{name}' is damaged" in folder.refusal()
        path.unlink()
        folder.lights.unlink()


# --- what is no picture, and sizes ---

def test_what_is_no_file_is_refused_without_waiting(folder, tmp_path):
    folder.add("a.png", png(CODES16))
    os.mkfifo(tmp_path / "pipe")
    for mask in (tmp_path / "pipe", tmp_path, "/dev/zero", tmp_path / "none.png"):
        done = folder.run("--mask", mask)
        assert done.returncode == 1 and str(mask) in done.stderr


@pytest.mark.parametrize("content, word", [(b"GIF89a" + bytes(40), "GIF"), (b"8BPS" + bytes(40), "Photoshop"), (b"", "empty"),
                                           (b"hello, world " * 9, "no picture")])
def test_other_kinds_are_refused_with_what_to_do(folder, content, word):
    folder.add("a.png", content)
    assert word in folder.refusal()


def test_a_small_file_that_says_it_is_huge_takes_no_memory(folder):
    header = struct.pack(">IIBBBBB", 60000, 60000, 16, 6, 0, 0, 0)
    folder.add("a.png", b"\x89PNG\r\n\x1a\n" + png_chunk(b"IHDR", header) + png_chunk(b"IDAT", bytes(50)) + png_chunk(b"IEND", b""))
    folder.lights.write_text("1\na.png 0 0 1\n")
    command = ["bash", "-c", f"ulimit -v 3000000; exec '{STAGECTL}' ingest '{folder.path}' --lights '{folder.lights}' -o '{folder.archive}'"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60)
    assert done.returncode == 1 and "60000 x 60000" in done.stderr


def test_different_exposures_are_warned_of(folder):
    for name, seconds in (("a.jpg", 0.01), ("b.jpg", 0.02)):
        exif = Image.Exif()
        exif.get_ifd(0x8769)[33434] = IFDRational(round(seconds * 1000), 1000)
        Image.fromarray(np.full((16, 16, 3), 90, np.uint8)).save(folder.path / name, exif=exif)
    folder.light()
    assert "different times of exposure" in folder.said()
