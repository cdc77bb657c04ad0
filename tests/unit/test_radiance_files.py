# SPDX-License-Identifier: MIT
# Radiance pictures of others, read as environment maps. Truth: (mantissa) 2^(exponent - 136) by numpy, in a plain OpenEXR file;
# files of other writers.
import subprocess

import imagecodecs
import numpy as np
import pytest
from exr_bytes import exr
from map_files import adapted, refused, rf, to_rec709, weights, write

generator = np.random.default_rng(25)
SIZE = b"-Y %d +X %d\n"


def stored(height=8, width=16):
    """Bytes of pixels, with runs in them and some black."""
    rgbe = generator.integers(3, 256, (height, width, 4), dtype=np.uint8)
    rgbe[..., 3] = generator.integers(120, 136, (height, width))
    rgbe[:, width // 4 : width // 2] = rgbe[:, width // 4 : width // 4 + 1]
    rgbe[height // 2, -3:] = 0
    return rgbe


def light(rgbe):
    e = rgbe[..., 3:].astype(np.float64)
    return np.where(e == 0, 0, rgbe[..., :3] * 2.0 ** (e - 136))


def plain(tmp_path, pixels):
    pixels = pixels.astype(np.float32)
    return write(tmp_path / "truth.exr", exr({name: np.ascontiguousarray(pixels[..., c]) for c, name in enumerate("RGB")}))


def flat(rgbe):
    return rgbe.tobytes()


def runs_of(row):
    start = 0
    for i in range(1, len(row) + 1):
        if i == len(row) or not np.array_equal(row[i], row[start]):
            yield row[start], i - start
            start = i


def old_runs(rgbe):
    """1 1 1 n repeats the pixel before n times; the next such pixel counts 256 n."""
    data = b""
    for row in rgbe:
        for pixel, count in runs_of(row):
            data += pixel.tobytes()
            left = count - 1
            while left > 0:
                data += bytes([1, 1, 1, left & 255])
                left >>= 8
    return data


def new_runs(rgbe):
    data = b""
    for row in rgbe:
        data += bytes([2, 2, len(row) >> 8, len(row) & 255])
        for component in row.T:
            for value, count in runs_of(component):
                while count > 0:
                    n = min(count, 127)
                    data += bytes([128 + n, value]) if n > 2 else bytes([n]) + bytes([value]) * n
                    count -= n
    return data


def hdr(rgbe, coding=flat, header=b"FORMAT=32-bit_rle_rgbe\n", size=None):
    return b"#?RADIANCE\n" + header + b"\n" + (size or SIZE % rgbe.shape[:2]) + coding(rgbe)


def same(path, truth, tmp_path, tolerance=0.0):
    given, said = weights(path, "--env-convention", "openexr")
    wanted, _ = weights(plain(tmp_path, truth), "--env-convention", "openexr")
    assert wanted.max() > 0 and np.abs(given - wanted).max() <= tolerance * wanted.max(), path
    return said


@pytest.mark.parametrize("coding", [flat, old_runs, new_runs])
@pytest.mark.parametrize("height, width", [(2, 1), (4, 7), (4, 8), (8, 16), (64, 300)])
def test_every_coding_is_the_same_light(tmp_path, coding, height, width):
    if width < 8 and coding is new_runs:
        pytest.skip("rows of fewer than 8 pixels are never coded so")
    rgbe = stored(height, width)
    assert same(write(tmp_path / "map.hdr", hdr(rgbe, coding)), light(rgbe), tmp_path) == ""


@pytest.mark.parametrize("y, x", [(b"-Y", b"+X"), (b"-Y", b"-X"), (b"+Y", b"+X"), (b"+Y", b"-X")])
@pytest.mark.parametrize("columns", [False, True])
def test_all_eight_orders_of_pixels_are_set_upright(tmp_path, y, x, columns):
    upright = stored()
    lying = upright[:: -1 if y[:1] == b"+" else 1, :: -1 if x[:1] == b"-" else 1]
    height, width = lying.shape[:2]
    axes = [y + b" %d" % height, x + b" %d" % width]
    if columns:
        lying, axes = lying.transpose(1, 0, 2), axes[::-1]
    size = b" ".join(axes) + b"\n"
    path = write(tmp_path / "map.hdr", hdr(np.ascontiguousarray(lying), new_runs, size=size))
    assert same(path, light(upright), tmp_path) == ""


def test_exposure_and_colour_correction_are_divided_out_all_of_them(tmp_path):
    rgbe = stored()
    header = b"FORMAT=32-bit_rle_rgbe\nEXPOSURE= 4.0\nEXPOSURE=+5e-1\nCOLORCORR=2 1 .5\n\tEXPOSURE=100\nCOLORCORR= 1 4 1\nEXPOSURE = 3\n"
    said = same(write(tmp_path / "map.hdr", hdr(rgbe, header=header)), light(rgbe) / 6 / np.array([2, 4, 0.5]), tmp_path, 1e-6)
    assert "EXPOSURE of 6 " in said and "COLORCORR of 2 4 0.5" in said and said.count("\n") == 2


@pytest.mark.parametrize("line", [b"EXPOSURE=0", b"EXPOSURE=-1", b"EXPOSURE=nan", b"EXPOSURE=inf", b"EXPOSURE=1e999", b"EXPOSURE=",
                                  b"EXPOSURE=1,5", b"EXPOSURE=1e300\nEXPOSURE=1e300", b"EXPOSURE=1e-300\nEXPOSURE=1e-300", b"COLORCORR=1 1e300 1\nCOLORCORR=1 1e300 1", b"COLORCORR=1 1", b"COLORCORR=1 1 0", b"PRIMARIES=1 2 3", b"NCOMP=4", b"GAMMA=2.2",
                                  b"FORMAT=32-bit_rle_spectral", b"PRIMARIES=.3 .3 .3 .3 .3 .3 .3 .3"])
def test_a_header_that_cannot_be_is_refused_by_its_line(tmp_path, line):
    path = write(tmp_path / "map.hdr", hdr(stored(), header=line + b"\n"))
    refused(path, "primaries" if line.endswith(b".3") else line.decode().split("=")[0], verb="weights")


def test_xyze_becomes_rec709_radiance(tmp_path):
    """179 lm/W; equal energy is white, adapted to D65 by Bradford."""
    rgbe = stored()
    rec709 = to_rec709(((1, 0), (0, 1), (0, 0), (1 / 3, 1 / 3)))
    assert np.allclose(rec709 @ np.ones(3), 1)
    # Saturated colours lie outside of Rec. 709; these do not.
    rgbe[..., :3] = 200 + rgbe[..., :3] // 32
    truth = light(rgbe) @ rec709.T / 179
    assert truth.min() >= 0
    said = same(write(tmp_path / "map.hdr", hdr(rgbe, header=b"FORMAT=32-bit_rle_xyze\n")), truth, tmp_path, 1e-6)
    assert "XYZ" in said and "179" in said


def test_primaries_are_converted_to_rec709(tmp_path):
    rgbe = stored()
    rgbe[..., :3] = 200 + rgbe[..., :3] // 32
    radiance = ((0.64, 0.33), (0.29, 0.60), (0.15, 0.06), (1 / 3, 1 / 3))  # its own standard
    wide = ((0.708, 0.292), (0.170, 0.797), (0.131, 0.046), (0.3127, 0.3290))
    for space in (radiance, wide):
        line = b"PRIMARIES= " + " ".join(f"{v:.6f}" for point in space for v in point).encode() + b"\n"
        said = same(write(tmp_path / "map.hdr", hdr(rgbe, header=line)), light(rgbe) @ to_rec709(space).T, tmp_path, 1e-5)
        assert "PRIMARIES were converted" in said and "no FORMAT line" in said
    zero = write(tmp_path / "zero.hdr", hdr(rgbe, header=b"FORMAT=32-bit_rle_rgbe\nPRIMARIES=0 0 0 0 0 0 0 0\n"))
    assert "all 0" in same(zero, light(rgbe), tmp_path)
    rec709 = hdr(rgbe, header=b"FORMAT=32-bit_rle_rgbe\r\nPRIMARIES=0.6400 0.3300 0.3000 0.6000 0.1500 0.0600 0.3127 0.3290\r\n")
    assert same(write(tmp_path / "rec709.hdr", rec709), light(rgbe), tmp_path) == ""
    assert np.abs(adapted(radiance[3], radiance[3]) - np.eye(3)).max() < 1e-12


def test_files_of_other_writers(tmp_path):
    rgbe = stored(16, 32)
    source = plain(tmp_path, light(rgbe))
    subprocess.run(["oiiotool", source, "-o", tmp_path / "oiio.hdr"], check=True)
    written = imagecodecs.rgbe_encode(light(rgbe).astype(np.float32), header=True)
    write(tmp_path / "walter.hdr", bytes(written))
    for name in ("oiio.hdr", "walter.hdr"):
        same(tmp_path / name, light(rgbe), tmp_path, 0.01)  # half a mantissa's step, where three share an exponent


def test_what_is_not_pixels_is_said(tmp_path):
    rgbe = stored()
    for data, words in ((hdr(rgbe) + b"more", "4 bytes behind"), (hdr(rgbe, header=b"PIXASPECT=2\n"), "PIXASPECT"),
                        (hdr(rgbe, header=b"VIEW= -vth -vh 180\n"), "VIEW")):
        assert words in same(write(tmp_path / "map.hdr", data), light(rgbe), tmp_path)


@pytest.mark.parametrize("coding", [flat, old_runs, new_runs])
def test_a_file_that_is_cut_short_anywhere_is_an_error_that_names_it(tmp_path, coding):
    whole = hdr(stored(2, 16), coding)
    for length in [0, 1, 2, 11, 35, 36, 40, *range(50, len(whole), 29), len(whole) - 1]:
        refused(write(tmp_path / "torn.hdr", whole[:length]), verb="weights")


@pytest.mark.parametrize("size", [b"-Y 64000 +X 32000", b"-Y 32000 +X 64000", b"-Y 2147483647 +X 2147483647", b"-Y 2147483648 +X 1", b"-Y 1 +X 2147483647",
                                  b"-Y 2147483647 +X 1", b"-Y 0 +X 4", b"-Y -1 +X 4", b"-Y 8 -Y 16", b"-X 8 +X 16", b"-Y 8", b"-Y 8 +X 16 7",
                                  b"-Y 99999999999999999999 +X 1", b"-Y 1e3 +X 4", b"8 16", b""])
def test_a_size_that_the_file_cannot_hold_is_refused_before_memory_is_taken(tmp_path, size):
    refused(write(tmp_path / "vast.hdr", hdr(stored(), new_runs, size=size + b"\n")), verb="weights", limit_gb=1)


def test_an_old_run_of_2_to_the_31_takes_no_memory(tmp_path):
    runs = b"\x10\x20\x30\x80" + b"\1\1\1\xff" * 4
    data = b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 1 +X 2147483647\n" + runs
    refused(write(tmp_path / "run.hdr", data), "no more than", verb="weights", limit_gb=1)
    with open(tmp_path / "sparse.hdr", "wb") as file:
        file.write(data)
        file.truncate(1 << 40)
    refused(tmp_path / "sparse.hdr", "bytes", verb="weights", limit_gb=1)


def test_runs_that_leave_their_row_are_damage(tmp_path):
    row = b"\2\2\0\x10"
    start = b"#?RADIANCE\n\n-Y 1 +X 16\n"
    filling = bytes(64)
    for rows in (row + b"\x91\5" + filling, row + b"\0" + filling, b"\2\2\0\x11" + filling, b"\1\1\1\x05" + filling,
                 b"\5\5\5\x80" + b"\1\1\1\x10" + filling, b"\5\5\5\x80" + b"\1\1\1\0" * 5 + filling):
        refused(write(tmp_path / "runs.hdr", start + rows), "row 1 of 1", verb="weights")


def test_a_strip_is_no_map_of_a_sphere(tmp_path):
    path = write(tmp_path / "strip.hdr", hdr(stored(1, 17)))
    done = rf("weights", "--env", path, "--env-convention", "openexr")
    assert done.returncode == 1 and "17 x 1" in done.stderr and "2:1" in done.stderr


def test_a_part_or_layer_of_a_radiance_picture_is_refused(tmp_path):
    done = rf("weights", "--env", write(tmp_path / "map.hdr", hdr(stored())), "--layer", "beauty")
    assert done.returncode == 1 and "--layer" in done.stderr
