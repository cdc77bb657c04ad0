# SPDX-License-Identifier: MIT
# OpenEXR files of others, read as environment maps: what lies where, which channels, which colours. Truth: the same pixels by
# arithmetic here, in a plain file.
import json
import os
import pathlib
import struct
import subprocess

import numpy as np
import pytest
from exr_bytes import chromaticities, exr, multi_part_exr, text
from map_files import BIN, REC709, ROOT, refused, rf, to_rec709, to_xyz, weights, write

generator = np.random.default_rng(15)


def picture(height=8, width=16, channels=3):
    return generator.uniform(0.1, 4, (height, width, channels)).astype(np.float32)


def rgb(pixels, prefix=""):
    return {prefix + name: np.ascontiguousarray(pixels[..., c]) for c, name in enumerate("RGBA"[: pixels.shape[2]])}


def differs(path, truth, tmp_path, *options):
    """The largest error of a file against pixels, relative to the largest pixel; and what was said."""
    plain = write(tmp_path / "truth.exr", exr(rgb(truth.astype(np.float32))))
    done = rf("compare", path, plain, "--json", *options)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)["max_error"] / np.abs(truth).max(), done.stderr


# Where pixels lie


@pytest.mark.parametrize("origin, display", [
    ((4, 2), (0, 0, 31, 15)),          # smaller
    ((-4, -2), (0, 0, 7, 3)),          # overscan
    ((-4, 2), (0, 0, 7, 15)),          # both
    ((10, 6), (0, 0, 11, 11)),         # over one corner
    ((1000, 2000), (990, 1995, 1021, 2010)),
    ((-1000, -2000), (-1005, -2003, -990, -1990)),
    ((100, 0), (0, 0, 31, 15)),        # beside
])
def test_the_picture_is_the_display_window(tmp_path, origin, display):
    pixels = picture()
    left, top, right, bottom = display
    truth = np.zeros((bottom - top + 1, right - left + 1, 3), np.float32)
    for y in range(truth.shape[0]):
        for x in range(truth.shape[1]):
            inside = 0 <= y + top - origin[1] < 8 and 0 <= x + left - origin[0] < 16
            if inside:
                truth[y, x] = pixels[y + top - origin[1], x + left - origin[0]]
    path = write(tmp_path / "window.exr", exr(rgb(pixels), origin, display))
    error, said = differs(path, np.where(truth == 0, 0, truth) if truth.any() else truth + 1e-30, tmp_path)
    assert error < 1e-12 or not truth.any()
    assert "window.exr: the data window is 16 x 8" in said
    assert "fill" in said or "cropped" in said or "black" in said


def test_tiles_line_orders_and_lossless_compressions_are_the_same_picture(tmp_path):
    pixels = picture(48, 96).astype(np.float16).astype(np.float32)
    plain = write(tmp_path / "plain.exr", exr({n: c.astype(np.float16) for n, c in rgb(pixels).items()}))
    for compression in ("none", "rle", "zip", "zips", "piz", "pxr24"):
        subprocess.run(["oiiotool", plain, "--compression", compression, "-o", tmp_path / f"{compression}.exr"], check=True)
        subprocess.run(["oiiotool", plain, "--compression", compression, "--tile", "32", "16", "-o", tmp_path / f"tiled_{compression}.exr"], check=True)
    for flags in (["-m"], ["-r"], ["-z", "zip"], ["-t", "20", "30"]):
        subprocess.run(["exrmaketiled", *flags, plain, tmp_path / f"made{''.join(flags)}.exr"], check=True)
    files = sorted(set(tmp_path.glob("*.exr")) - {tmp_path / "truth.exr"})
    assert len(files) == 1 + 12 + 4
    for path in files:
        assert differs(path, pixels, tmp_path) == (0, ""), path
    for compression in ("dwaa", "dwab", "b44", "b44a"):
        subprocess.run(["oiiotool", plain, "--compression", compression, "-o", tmp_path / f"{compression}.exr"], check=True)
        assert differs(tmp_path / f"{compression}.exr", pixels, tmp_path)[0] < 0.2


# Which channels


def test_the_part_with_colour_is_taken_wherever_it_stands_and_the_rest_named(tmp_path):
    pixels = picture()
    depth = dict(name="depth", channels={"Z": picture()[..., 0]})
    beauty = dict(name="beauty", channels=rgb(pixels))
    for parts in ([depth, beauty], [beauty, depth]):
        path = write(tmp_path / "parts.exr", multi_part_exr(parts))
        error, said = differs(path, pixels, tmp_path)
        assert error == 0 and "left out: part" in said and "'depth'" in said


def test_a_choice_of_parts_is_refused_until_it_is_made(tmp_path):
    left, right = picture(), picture()
    path = write(tmp_path / "stereo.exr", multi_part_exr([dict(name="left", channels=rgb(left)), dict(name="right", channels=rgb(right))]))
    refused(path, "part 0 'left' (R G B)", "part 1 'right' (R G B)", "--part")
    for name, pixels in (("right", right), ("1", right), ("left", left), ("0", left)):
        plain = write(tmp_path / "plain.exr", exr(rgb(pixels)))
        assert np.array_equal(weights(path, "--part", name)[0], weights(plain)[0])
    done = rf("weights", "--env", path, "--part", "middle")
    assert done.returncode == 1 and "'middle'" in done.stderr
    done = rf("weights", "--env", write(tmp_path / "map.hdr", b"#?RADIANCE\n"), "--part", "1")
    assert done.returncode == 1 and "--part" in done.stderr


def test_layers_with_a_name(tmp_path):
    beauty, diffuse = picture(), picture()
    both = rgb(beauty, "beauty.") | rgb(diffuse, "a.b.diffuse.") | {"Z": beauty[..., 0]}
    path = write(tmp_path / "layers.exr", exr(both))
    refused(path, "beauty.R beauty.G beauty.B", "a.b.diffuse.R", "--layer")
    assert np.array_equal(weights(path, "--layer", "a.b.diffuse")[0], weights(write(tmp_path / "plain.exr", exr(rgb(diffuse))))[0])
    # One alone, and one without a name among several.
    error, said = differs(write(tmp_path / "one.exr", exr(rgb(beauty, "beauty."))), beauty, tmp_path)
    assert error == 0 and "its layer 'beauty' was taken" in said
    error, said = differs(write(tmp_path / "root.exr", exr(rgb(beauty) | rgb(diffuse, "diffuse."))), beauty, tmp_path)
    assert error == 0 and "left out: diffuse.B, diffuse.G, diffuse.R" in said


def test_colour_goes_before_grey_and_grey_is_light(tmp_path):
    pixels = picture()
    error, said = differs(write(tmp_path / "both.exr", exr(rgb(pixels) | {"Y": pixels[..., 0]})), pixels, tmp_path)
    assert error == 0 and "left out: Y" in said
    grey = np.repeat(pixels[..., :1], 3, 2)
    assert np.array_equal(weights(write(tmp_path / "grey.exr", exr({"Y": pixels[..., 0]})))[0], weights(write(tmp_path / "plain.exr", exr(rgb(grey))))[0])


@pytest.mark.parametrize("names", ["Z", "A", "depth", "N.x", "RG", "rgb", "R", "u v", "red green blue", "Y RY", "RY BY", "X Y Z", "P.X P.Y P.Z", "motion.X motion.Y"])
def test_what_is_no_light_is_refused_by_name(tmp_path, names):
    names = names.split() if " " in names or len(names) > 3 or "." in names else list(names)
    path = write(tmp_path / "other.exr", exr({name: picture()[..., 0] for name in names}))
    refused(path, "no light", *names)


def test_whole_numbers_and_half_sampled_colours_are_no_light(tmp_path):
    ids = {name: np.arange(128, dtype=np.uint32).reshape(8, 16) for name in "RGB"}
    refused(write(tmp_path / "ids.exr", exr(ids)), "R (whole numbers)")
    refused(write(tmp_path / "id.exr", exr({"Y": ids["R"]})), "Y (whole numbers)")
    pixels = picture()
    halved = rgb(pixels) | {"B": np.ascontiguousarray(pixels[::2, ::2, 2])}
    refused(write(tmp_path / "halved.exr", exr(halved, sampling={"B": (2, 2)})), "B (sampled 2 x 2)")


def test_deep_parts_are_named(tmp_path):
    deep = dict(name="d", channels=rgb(picture()), extra=[text("type", "deepscanline")])
    flat = dict(name="z", channels={"Z": picture()[..., 0]})
    path = write(tmp_path / "deep.exr", multi_part_exr([deep, flat]))
    done = rf("compare", path, path)
    assert done.returncode == 1 and "deep.exr" in done.stderr


# Which colours

SPACES = {
    "ap0": ((0.7347, 0.2653), (0.0, 1.0), (0.0001, -0.0770), (0.32168, 0.33767)),
    "ap1": ((0.713, 0.293), (0.165, 0.830), (0.128, 0.044), (0.32168, 0.33767)),
    "rec2020": ((0.708, 0.292), (0.170, 0.797), (0.131, 0.046), (0.3127, 0.3290)),
    "equal": ((0.64, 0.33), (0.29, 0.60), (0.15, 0.06), (1 / 3, 1 / 3)),
}


@pytest.mark.parametrize("name", SPACES)
def test_other_primaries_become_rec709_and_white_stays_white(tmp_path, name):
    pixels = picture()
    pixels[0, 0] = 1
    flat = [v for point in SPACES[name] for v in point]
    truth = pixels.astype(np.float64) @ to_rec709(SPACES[name]).T
    assert np.allclose(truth[0, 0], 1)
    error, said = differs(write(tmp_path / "space.exr", exr(rgb(pixels), extra=[chromaticities(*flat)])), truth, tmp_path)
    assert error < 1e-6 and "converted to Rec. 709" in said


def test_rec709_stays_as_it_is_to_the_bit_and_names_of_spaces_count(tmp_path):
    pixels = picture()
    flat = [v for point in REC709 for v in point]
    assert differs(write(tmp_path / "rec709.exr", exr(rgb(pixels), extra=[chromaticities(*flat)])), pixels, tmp_path) == (0, "")
    truth = pixels.astype(np.float64) @ to_rec709(SPACES["ap1"]).T
    named = write(tmp_path / "named.exr", exr(rgb(pixels), extra=[text("colorInteropID", "lin_ap1_scene")]))
    assert differs(named, truth, tmp_path)[0] < 1e-6
    for space in ("ACEScg", "lin_ap1"):
        named = write(tmp_path / "named.exr", exr(rgb(pixels), extra=[text("oiio:ColorSpace", space)]))
        assert differs(named, truth, tmp_path)[0] < 1e-6
    both = [text("colorInteropID", "lin_rec709_scene"), chromaticities(*[v for point in SPACES["ap1"] for v in point])]
    error, said = differs(write(tmp_path / "both.exr", exr(rgb(pixels), extra=both)), truth, tmp_path)
    assert error < 1e-6 and "these were taken" in said
    error, said = differs(write(tmp_path / "srgb.exr", exr(rgb(pixels), extra=[text("oiio:ColorSpace", "sRGB")])), pixels, tmp_path)
    assert error == 0 and "'sRGB'" in said
    refused(write(tmp_path / "encoded.exr", exr(rgb(pixels), extra=[text("colorInteropID", "srgb_rec709_scene")])), "srgb_rec709_scene")
    refused(write(tmp_path / "data.exr", exr(rgb(pixels), extra=[text("colorInteropID", "data")])), "data")


@pytest.mark.parametrize("eight", [[0.3] * 8, [0] * 8, [np.nan] * 8, [0.64, 0.33, 0.3, 0.6, 0.15, 0.06, 0.9, 0.05],
                                   [0.64, 0.33, 0.3, 0.6, 0.15, 0.06, 0.3127, 0], [1e30] * 8])
def test_primaries_that_span_no_colours_are_refused(tmp_path, eight):
    refused(write(tmp_path / "flat.exr", exr(rgb(picture()), extra=[chromaticities(*eight)])), "primaries")


@pytest.mark.parametrize("space, halved", [("rec709", True), ("rec709", False), ("ap1", True), ("ap1", False)])
def test_luminance_and_chroma_become_the_colour_they_were_made_of(tmp_path, space, halved):
    primaries = REC709 if space == "rec709" else SPACES[space]
    colour = np.array([0.5, 2.0, 8.0])
    y = to_xyz(primaries)[1] @ colour
    whole = np.full((8, 16), 1, np.float32)
    chroma = np.full((4, 8), 1, np.float32) if halved else whole
    channels = {"Y": whole * np.float32(y), "RY": chroma * np.float32(colour[0] / y - 1), "BY": chroma * np.float32(colour[2] / y - 1)}
    sampling = {"RY": (2, 2), "BY": (2, 2)} if halved else {}
    extra = [] if space == "rec709" else [chromaticities(*[v for p in primaries for v in p])]
    path = write(tmp_path / "ycc.exr", exr(channels, (-2, 4), (-2, 4, 13, 11), sampling, extra))
    truth = np.broadcast_to(colour if space == "rec709" else to_rec709(primaries) @ colour, (8, 16, 3))
    error, said = differs(path, truth, tmp_path)
    assert error < 1e-3 and "Y RY BY" in said  # halved chroma passes through half floats


# What is said


def test_alpha_is_not_used_and_that_is_said_unless_it_is_1(tmp_path):
    pixels = picture(channels=4)
    plain = weights(write(tmp_path / "plain.exr", exr(rgb(pixels[..., :3]))))
    given, said = weights(write(tmp_path / "alpha.exr", exr(rgb(pixels))))
    assert np.array_equal(given, plain[0]) and "alpha is not used" in said
    pixels[..., 3] = 1
    assert weights(write(tmp_path / "opaque.exr", exr(rgb(pixels))))[1] == ""


def test_the_virtual_stage_says_the_same_in_its_report(tmp_path):
    square = write(tmp_path / "square.exr", exr(rgb(picture(16, 16))))
    done = subprocess.run([BIN / "stagesim", "render", ROOT / "tools/stagesim/scenes/card.toml", "--env", square, "-o", tmp_path / "lit.exr", "--json"],
                          capture_output=True, text=True, check=True)
    assert done.stderr.count("--env-convention angular") == 1 and "angular" in json.loads(done.stdout)["warnings"][0]


LIES = {2: lambda p: p[:, ::-1], 3: lambda p: p[::-1, ::-1], 4: lambda p: p[::-1], 5: lambda p: p.swapaxes(0, 1), 6: lambda p: np.rot90(p),
        7: lambda p: np.rot90(p, 2).swapaxes(0, 1), 8: lambda p: np.rot90(p, -1)}  # upright to stored: Exif 2.32, tag 274


@pytest.mark.parametrize("orientation", LIES)
def test_pixels_that_lie_turned_are_set_upright(tmp_path, orientation):
    pixels = picture()
    tag = ("Orientation", "int", struct.pack("<i", orientation))
    stored = write(tmp_path / "turned.exr", exr(rgb(np.ascontiguousarray(LIES[orientation](pixels))), extra=[tag]))
    code, said = differs(stored, pixels, tmp_path)
    assert code == 0 and f"Orientation {orientation}" in said
    if orientation in (5, 7): return  # OpenImageIO 2.4 takes one for the other
    subprocess.run(["oiiotool", stored, "--reorient", "-o", tmp_path / "made.exr"], check=True)
    assert differs(tmp_path / "made.exr", pixels, tmp_path) == (0, "")


def test_an_orientation_that_is_none_is_refused(tmp_path):
    refused(write(tmp_path / "nine.exr", exr(rgb(picture()), extra=[("Orientation", "int", struct.pack("<i", 9))])), "Orientation is 9", "1 to 8")
    pixels = picture()
    assert differs(write(tmp_path / "one.exr", exr(rgb(pixels), extra=[("Orientation", "int", struct.pack("<i", 1))])), pixels, tmp_path) == (0, "")


def test_pixels_that_are_not_square_and_a_warning_in_json(tmp_path):
    wide = write(tmp_path / "wide.exr", exr(rgb(picture()), replaced={"pixelAspectRatio": struct.pack("<f", 2)}))
    done = rf("weights", "--env", wide, "--json")
    assert "2 times as wide" in done.stderr and done.stderr.count("\n") == 1
    assert any("2 times as wide" in warning for warning in json.loads(done.stdout)["environment"]["warnings"])


@pytest.mark.parametrize("height, width, word", [(16, 16, "angular"), (8, 12, "latitude-longitude"), (9, 16, "latitude-longitude")])
def test_a_map_that_is_not_twice_as_wide_as_high_is_warned_of_with_what_fits(tmp_path, height, width, word):
    path = write(tmp_path / "odd.exr", exr(rgb(picture(height, width))))
    done = rf("weights", "--env", path)
    assert done.returncode == 0 and "--env-convention" in done.stderr and word in done.stderr
    assert rf("weights", "--env", path, "--env-convention", "openexr").stderr == ""


@pytest.mark.parametrize("height, width", [(4, 24), (24, 4), (12, 16), (16, 12)])
def test_maps_of_the_shape_of_unfolded_cubes_are_refused_until_their_layout_is_said(tmp_path, height, width):
    path = write(tmp_path / "cube.exr", exr(rgb(picture(height, width))))
    refused(path, "cube", "exrenvmap", "--env-convention", verb="weights")
    assert rf("weights", "--env", path, "--env-convention", "mirrored").returncode == 0


def test_the_envmap_attribute_counts(tmp_path):
    cube = write(tmp_path / "cube.exr", exr(rgb(picture()), extra=[("envmap", "envmap", b"\1")]))
    refused(cube, "cube map", "exrenvmap", verb="weights")
    assert "cube map" in rf("weights", "--env", cube, "--env-convention", "openexr").stderr
    latlong = write(tmp_path / "latlong.exr", exr(rgb(picture(16, 16)), extra=[("envmap", "envmap", b"\0")]))
    assert "angular" in rf("weights", "--env", latlong, "--env-convention", "angular").stderr


# What breaks


def test_a_file_that_is_cut_short_anywhere_is_an_error_that_names_it(tmp_path):
    whole = exr(rgb(picture(4, 8)), extra=[chromaticities(*[v for p in SPACES["ap1"] for v in p])])
    for length in [*range(0, 600, 67), *range(600, len(whole), 101), len(whole) - 1]:
        refused(write(tmp_path / "torn.exr", whole[:length]))


def test_missing_rows_are_refused(tmp_path):
    whole = bytearray(exr(rgb(picture(4, 8))))
    table = len(whole) - 4 * (8 + 3 * 8 * 4) - 4 * 8
    whole[table + 8 : table + 16] = bytes(8)
    refused(write(tmp_path / "rows.exr", bytes(whole)), "incomplete")


@pytest.mark.parametrize("window", [
    (0, 0, 2**31 - 1, 2**31 - 1), (-(2**31), -(2**31), 2**31 - 1, 2**31 - 1), (0, 0, 2**30 - 2, 2**30 - 2), (0, 0, 63999, 31999),
    (0, 0, 2**30 - 2, 0), (0, 0, 0, 2**30 - 2), (5, 5, 4, 4), (0, 0, -(2**31), -(2**31)), (0, 0, 99999, 9999)])
@pytest.mark.parametrize("which, compression", [(("dataWindow",), 0), (("displayWindow",), 0), (("dataWindow", "displayWindow"), 3),
                                                (("dataWindow", "displayWindow"), 9)])
def test_a_size_that_the_file_cannot_hold_is_refused_before_memory_is_taken(tmp_path, window, which, compression):
    replaced = {name: struct.pack("<4i", *window) for name in which} | {"compression": bytes([compression])}
    refused(write(tmp_path / "vast.exr", exr(rgb(picture()), replaced=replaced)), limit_gb=1)


def test_a_chunk_of_256_lines_is_not_taken_for_one_line(tmp_path):
    window = struct.pack("<4i", 0, 0, 800000, 0)
    whole = exr(rgb(picture()), replaced={"dataWindow": window, "displayWindow": window, "compression": b"\x09"})
    refused(write(tmp_path / "chunk.exr", whole), "in a chunk", limit_gb=1)


def test_attributes_that_say_more_bytes_than_there_are(tmp_path):
    whole = exr(rgb(picture()), extra=[text("comments", "x" * 50)])
    at = whole.index(b"comments\0string\0") + len(b"comments\0string\0")
    for length in (2**31 - 1, -1, 10**6):
        refused(write(tmp_path / "long.exr", whole[:at] + struct.pack("<i", length) + whole[at + 4 :]), "damaged")


def test_a_black_map_that_compresses_best_is_read(tmp_path):
    for compression in ("rle", "zip", "piz", "pxr24", "b44a", "dwaa", "dwab"):
        path = tmp_path / f"{compression}.exr"
        subprocess.run(["oiiotool", "--create", "2048x1024", "3", "-d", "half", "--compression", compression, "-o", path], check=True)
        done = rf("weights", "--env", path)
        assert done.returncode == 0, (compression, done.stderr)


@pytest.mark.parametrize("content, kind", [(b"", "empty"), (b"\x89PNG\r\n\x1a\n", "PNG"), (b"\xff\xd8\xff\xe0", "JPEG"), (b"no map", "no file of a kind")])
def test_other_files_are_named_for_what_they_are(tmp_path, content, kind):
    for name in ("map.exr", "map.hdr", "map.jpg"):
        refused(write(tmp_path / name, content), kind, verb="weights")


def test_a_map_is_known_by_its_bytes_not_by_its_name(tmp_path):
    path = write(tmp_path / "map.hdr", exr(rgb(picture())))
    assert np.array_equal(weights(path)[0], weights(write(tmp_path / "map.exr", path.read_bytes()))[0])


def test_pipes_folders_and_devices_are_not_opened(tmp_path):
    os.mkfifo(tmp_path / "pipe.exr")
    (tmp_path / "folder.exr").mkdir()
    for path, word in ((tmp_path / "pipe.exr", "a pipe"), (tmp_path / "folder.exr", "a folder"), (pathlib.Path("/dev/zero"), "a device"),
                       (tmp_path / "nothing.exr", "not there")):
        refused(path, word)
        refused(path, word, verb="weights")
