# SPDX-License-Identifier: MIT
# What `stagectl ingest` makes of picture files as cameras and other programs write them: right by arithmetic, or refused by name.
# The files come from Pillow, tifffile, pillow-heif and bytes of our own; the truth is what was handed to them.
import json
import struct

import numpy as np
import OpenEXR
import pillow_heif
import pytest
import tifffile
from PIL import Image, ImageCms, ImageOps

from exr_bytes import chromaticities, exr
from picture_files import bmp, png, tga, write_dng
from picture_folder import ALPHA8, CODES8, CODES16, GENERATOR, GREY8, GREY16, HEIGHT, SRGB8, SRGB16, WIDTH, folder, linear_of, near

TIFFS = {
    "planar, 16 bits": (np.moveaxis(CODES16, 2, 0), {"planarconfig": "separate", "photometric": "rgb"}, SRGB16),
    "white is zero, 16 bits": (GREY16, {"photometric": "miniswhite"}, linear_of((65535 - GREY16.astype(int)) / 65535)),
    "white is zero, 8 bits": (GREY8, {"photometric": "miniswhite"}, linear_of((255 - GREY8.astype(int)) / 255)),
    "straight alpha": (np.dstack([CODES8, ALPHA8]), {"photometric": "rgb", "extrasamples": ["unassalpha"]}, SRGB8),
    "multiplied by alpha": (np.dstack([CODES8, ALPHA8]), {"photometric": "rgb", "extrasamples": ["assocalpha"]}, SRGB8),
    "another channel": (np.dstack([CODES8, ALPHA8]), {"photometric": "rgb", "extrasamples": ["unspecified"]}, SRGB8),
    "1 bit": (GREY8 > 99, {"photometric": "minisblack"}, (GREY8 > 99) * 1.0),
    "1 bit, white is zero": (GREY8 > 99, {"photometric": "miniswhite"}, (GREY8 <= 99) * 1.0),
    "half": ((CODES16 / 65535).astype(np.float16), {"photometric": "rgb"}, (CODES16 / 65535).astype(np.float16)),
    "double": (CODES16 / 65535, {"photometric": "rgb"}, CODES16 / 65535),
    "32-bit integers": (CODES16.astype(np.uint32) * 65537, {"photometric": "rgb"}, SRGB16),
    "tiles": (CODES16, {"photometric": "rgb", "tile": (16, 16)}, SRGB16),
    "big-endian": (CODES16, {"photometric": "rgb", "byteorder": ">"}, SRGB16),
    "BigTIFF": (CODES16, {"photometric": "rgb", "bigtiff": True}, SRGB16),
    "deflated with predictor": (CODES16, {"photometric": "rgb", "compression": "zlib", "predictor": True}, SRGB16),
}


@pytest.mark.parametrize("kind", TIFFS)
def test_every_kind_of_tiff_file_is_read_as_it_was_written(folder, kind):
    codes, options, truth = TIFFS[kind]
    tifffile.imwrite(folder.path / "a.tif", codes, metadata=None, **options)
    near(folder.light()[0], truth)


def test_a_compression_that_is_not_read_is_named(folder):
    tifffile.imwrite(folder.path / "a.tif", CODES8, photometric="rgb", compression="jpeg2000", metadata=None)
    assert "has a compression that libtiff does not read here (34712): save it with another" in folder.refusal()


def test_signed_integers_keep_their_sign(folder):
    codes = (CODES16.astype(int) - 32768).astype(np.int16)
    tifffile.imwrite(folder.path / "a.tif", codes, photometric="rgb", metadata=None)
    near(folder.light("--transfer", "linear")[0], np.maximum(codes / 32767, -1.00005), 4e-5)


@pytest.mark.parametrize("pages", [(CODES8[::4, ::4], CODES8), (CODES8, CODES8[::-1])])
def test_a_page_of_several_is_chosen_or_refused(folder, pages):
    with tifffile.TiffWriter(folder.path / "a.tif") as file:
        for i, page in enumerate(pages):
            file.write(page, photometric="rgb", subfiletype=int(i == 0 and page.shape[0] < HEIGHT), metadata=None)
    assert "has 2 pages: choose one with --page 1 to 2" in folder.refusal()
    near(folder.light("--page", "2")[0], linear_of(pages[1] / 255))
    near(folder.light("--page", "1")[0], linear_of(pages[0] / 255))


def test_a_page_that_is_not_there_is_refused(folder):
    tifffile.imwrite(folder.path / "a.tif", CODES8, photometric="rgb", metadata=None)
    assert "there is no page 3" in folder.refusal("--page", "3")


UPRIGHT = {1: lambda a: a, 2: lambda a: a[:, ::-1], 3: lambda a: a[::-1, ::-1], 4: lambda a: a[::-1],
           5: lambda a: a.swapaxes(0, 1), 6: lambda a: np.rot90(a, -1), 7: lambda a: a[::-1, ::-1].swapaxes(0, 1),
           8: lambda a: np.rot90(a)}


@pytest.mark.parametrize("orientation", UPRIGHT)
def test_pictures_are_turned_as_exif_says_alike_in_every_format(folder, orientation):
    exif = Image.Exif()
    exif[274] = orientation
    picture = Image.fromarray(CODES8)
    truth = UPRIGHT[orientation](SRGB8)
    tags = [(274, "H", 1, orientation, True)]
    tifffile.imwrite(folder.path / "a.tif", CODES8, photometric="rgb", extratags=tags, metadata=None)
    picture.save(folder.path / "b.png", exif=exif)
    picture.save(folder.path / "c.webp", lossless=True, exif=exif)
    channels = {name: SRGB8[..., c].astype(np.float32) for c, name in enumerate("RGB")}
    (folder.path / "d.exr").write_bytes(exr(channels, extra=[("Orientation", "int", struct.pack("<i", orientation))]))
    light = folder.light()
    for lamp in light:
        near(lamp, truth)
    if orientation > 1:
        near(folder.light("--orientation", "ignore")[1], SRGB8)
        assert "orientation is left out" in folder.said()


def test_orientation_turns_jpeg_files_as_pillow_does(folder):
    exif = Image.Exif()
    exif[274] = 6
    smooth = np.add.outer(np.arange(32) * 3, np.arange(48) * 2).astype(np.uint8)
    Image.fromarray(smooth).save(folder.path / "a.jpg", quality=98, exif=exif)
    seen = np.asarray(ImageOps.exif_transpose(Image.open(folder.path / "a.jpg")))
    near(folder.light()[0], linear_of(seen / 255))


def test_pictures_that_are_turned_differently_are_refused_unless_taken_as_they_lie(folder):
    exif = Image.Exif()
    exif[274] = 3
    Image.fromarray(CODES8).save(folder.path / "a.png")
    Image.fromarray(CODES8).save(folder.path / "b.png", exif=exif)
    assert "say --orientation ignore" in folder.refusal()
    light = folder.light("--orientation", "ignore")
    near(light[0], light[1])


def test_rows_of_tga_and_bmp_files_may_begin_at_any_corner(folder):
    names = []
    for right in (False, True):
        for top in (False, True):
            names.append(folder.add(f"{right:d}{top:d}.tga", tga(CODES8, right, top)).name)
    for top in (False, True):
        names.append(folder.add(f"{top:d}.bmp", bmp(CODES8, top)).name)
    for lamp in folder.light(names=names):
        near(lamp, SRGB8)


@pytest.mark.parametrize("name, options", [("a.webp", {"lossless": True}), ("a.ppm", {}), ("a.bmp", {}), ("a.tga", {"compression": "tga_rle"}),
                                           ("a.png", {}), ("a.tif", {"compression": "tiff_lzw"})])
def test_lossless_formats_give_what_pillow_wrote(folder, name, options):
    Image.fromarray(CODES8).save(folder.path / name, **options)
    near(folder.light()[0], SRGB8)


@pytest.mark.parametrize("name", ["a.jpg", "a.heic", "a.avif"])
def test_lossy_formats_give_what_another_decoder_sees(folder, name):
    pillow_heif.register_heif_opener()
    y, x = np.mgrid[0:64, 0:96]
    smooth = np.dstack([100 + 60 * np.sin(x / 20), 80 + y, 200 - x]).astype(np.uint8)
    Image.fromarray(smooth).save(folder.path / name, quality=95)
    seen = np.asarray(Image.open(folder.path / name).convert("RGB"))
    near(folder.light()[0], linear_of(seen / 255), 0.03)  # decoders interpolate chroma in their own ways


@pytest.mark.parametrize("name", ["a.heic", "a.avif"])
def test_heif_pictures_of_ten_bits_keep_them(folder, name):
    """The decoder of pillow-heif is libheif, too, in another build: equal to a code of ten bits, where eight would be four apart."""
    y, x = np.mgrid[0:64, 0:96]
    codes = np.dstack([300 * 64 + 40 * y, 500 * 64 + 30 * x, 400 * 64 + 20 * (x + y)]).astype(np.uint16)
    pillow_heif.encode("RGB;16", (96, 64), codes.tobytes(), folder.path / name, quality=-1, chroma="444", matrix_coefficients=0)
    file = pillow_heif.open_heif(folder.path / name, convert_hdr_to_8bit=False)
    assert file.info["bit_depth"] == 10
    seen = np.asarray(file).astype(float)
    light = folder.light("--transfer", "linear")[0]
    assert len(np.unique(light[..., 0])) > 33  # 64 rows of 40 / 64 codes of ten bits
    near(light, (seen / 64 + 0.5).astype(int) / 1023 if seen.max() > 1023 else seen / 1023, 1.6 / 1023)


def test_a_heif_file_that_holds_less_than_it_says_is_damaged(folder):
    """`ispe` (ISO/IEC 14496-12, 6.5.3) says one row more than was coded: OpenImageIO 2.4 reads beyond its memory there."""
    pillow_heif.from_bytes("RGB", (64, 64), bytes(64 * 64 * 3)).save(folder.path / "a.heic")
    file = (folder.path / "a.heic").read_bytes()
    at = file.index(b"ispe") + 8
    assert struct.unpack_from(">II", file, at) == (64, 64)
    (folder.path / "a.heic").write_bytes(file[:at] + struct.pack(">II", 64, 640) + file[at + 8:])
    assert "is damaged" in folder.refusal()


def test_jpeg_files_with_fill_bytes_before_markers_are_read(folder):
    Image.fromarray(np.full((16, 16, 3), 90, np.uint8)).save(folder.path / "a.jpg", quality=95)
    file = (folder.path / "a.jpg").read_bytes()
    filled = file[:2] + b"\xff\xff\xff" + file[2:-2] + b"\xff\xff" + file[-2:]  # T.81, B.1.1.2
    folder.add("a.jpg", filled)
    near(folder.light()[0], linear_of(np.full((16, 16, 3), 90 / 255)), 0.01)


def test_a_name_that_does_not_fit_its_content_is_read_by_content(folder):
    (folder.path / "a.jpg").write_bytes(png(CODES16))
    near(folder.light()[0], SRGB16)


# --- camera raw ---

RAW = GENERATOR.integers(0, 4096, (96, 128), dtype=np.uint16)


@pytest.mark.parametrize("name", ["a.dng", "a.nef", "a.tif"])
def test_a_raw_file_is_refused_as_raw_and_never_its_preview_taken(folder, name):
    write_dng(folder.path / name, RAW)
    assert "is a camera's raw file: say --raw mosaic" in folder.refusal()


def test_a_raw_mosaic_is_the_sensors_counts_between_black_and_white(folder):
    write_dng(folder.path / "a.dng", RAW, pattern=(1, 0, 2, 1))
    near(folder.light("--raw", "mosaic")[0], (RAW.astype(float) - 64) / (4095 - 64))
    assert folder.report["mosaic"]
    header = OpenEXR.File(str(folder.archive / "cam0/target_000000.exr"), separate_channels=True).parts[0].header
    assert header["cfa"] == "grbg"


@pytest.mark.parametrize("orientation, pattern", [(1, "bggr"), (3, "rggb"), (6, "gbrg"), (8, "grbg")])
def test_a_turned_or_cropped_mosaic_keeps_its_colours(folder, orientation, pattern):
    # Every pixel says its colour, so that the pattern of the result can be read off it.
    y, x = np.mgrid[0:96, 0:128]
    color = np.array([[0, 1], [1, 2]])[y % 2, x % 2]
    write_dng(folder.path / "a.dng", (1000 * (color + 1)).astype(np.uint16), black=0, white=4000, crop=(3, 5, 90, 70),
              orientation=orientation)
    light = folder.light("--raw", "mosaic")[0]
    truth = UPRIGHT[orientation](1000.0 * (color[5:75, 3:93] + 1)) / 4000
    near(light, truth)
    cfa = OpenEXR.File(str(folder.archive / "cam0/target_000000.exr"), separate_channels=True).parts[0].header["cfa"]
    seen = "".join("rgb"[int(round(light[y, x] * 4)) - 1] for y in (0, 1) for x in (0, 1))
    assert cfa == seen


def test_raw_rgb_is_linear_and_white_balanced_the_same_for_all_pictures(folder):
    # Camera colours are XYZ: a sensor that sees D65's XYZ sees white.
    white = np.array([0.95047, 1, 1.08883])
    y, x = np.mgrid[0:96, 0:128]
    color = np.array([[0, 1], [1, 2]])[y % 2, x % 2]
    for name, level in [("a.dng", 0.2), ("b.dng", 0.4)]:
        write_dng(folder.path / name, (level * 3000 * white[color]).round().astype(np.uint16), black=0, white=4095)
    dim, bright = folder.light("--raw", "rgb")[:, 20:-20, 20:-20]
    near(bright / dim, np.full_like(dim, 2), 1e-2)
    near(dim / dim[:, :, 1:2], np.ones_like(dim), 1e-2)
    assert "lin_rec709_scene" in (folder.archive / "manifest.json").read_text()


def test_a_preview_before_a_raw_that_no_one_knows_is_refused(folder):
    write_dng(folder.path / "a.tif", RAW, is_dng=False)
    assert "preview" in folder.refusal("--raw", "mosaic")


# --- labels ---

def converted(folder, *options):
    light = folder.light(*options)[0]
    manifest = json.loads((folder.archive / "manifest.json").read_text())
    return light, json.dumps(manifest)


def test_png_gamma_decides(folder):
    folder.add("a.png", png(CODES16, (b"gAMA", struct.pack(">I", 100000))))
    light, manifest = converted(folder)
    near(light, CODES16 / 65535, 2e-5)
    assert "lin_rec709_scene" in manifest
    folder.add("a.png", png(CODES16, (b"gAMA", struct.pack(">I", 45455))))
    near(converted(folder)[0], (CODES16 / 65535) ** 2.2, 2e-4)


def rec709_from(primaries, white, rgb):
    """Linear R G B of other primaries to Rec. 709's, Bradford; by the textbook."""
    def to_xyz(p, w):
        columns = np.array([[x / y, 1, (1 - x - y) / y] for x, y in p]).T
        w_xyz = np.array([w[0] / w[1], 1, (1 - w[0] - w[1]) / w[1]])
        return columns * np.linalg.solve(columns, w_xyz), w_xyz
    here, w1 = to_xyz(primaries, white)
    there, w2 = to_xyz([(0.64, 0.33), (0.3, 0.6), (0.15, 0.06)], (0.3127, 0.329))
    bradford = np.array([[0.8951, 0.2664, -0.1614], [-0.7502, 1.7135, 0.0367], [0.0389, -0.0685, 1.0296]])
    adapt = np.linalg.inv(bradford) @ np.diag((bradford @ w2) / (bradford @ w1)) @ bradford
    return rgb @ (np.linalg.inv(there) @ adapt @ here).T


ADOBE = [(0.64, 0.33), (0.21, 0.71), (0.15, 0.06)]


def test_png_primaries_are_converted(folder):
    chrm = struct.pack(">8I", 31270, 32900, 64000, 33000, 21000, 71000, 15000, 6000)
    folder.add("a.png", png(CODES16, (b"gAMA", struct.pack(">I", 100000)), (b"cHRM", chrm)))
    light, manifest = converted(folder)
    near(light, rec709_from(ADOBE, (0.3127, 0.329), CODES16 / 65535), 1e-3)
    assert "converted from" in folder.said() and "lin_rec709_scene" in manifest


def test_tiff_primaries_and_transfer_function_are_converted(folder):
    rationals = sum(((int(v * 10000), 10000) for xy in ADOBE for v in xy), ())
    curve = np.round(65535 * (np.arange(256) / 255) ** 1.8).astype(np.uint16)
    tags = [(319, "2I", 6, rationals, True), (318, "2I", 2, (3127, 10000, 3290, 10000), True), (301, "H", 256, tuple(curve), True)]
    tifffile.imwrite(folder.path / "a.tif", CODES8, photometric="rgb", extratags=tags, metadata=None)
    light, _ = converted(folder)
    near(light, rec709_from(ADOBE, (0.3127, 0.329), (CODES8 / 255.0) ** 1.8), 1e-3)


def test_a_profile_of_srgb_changes_nothing_and_another_is_converted(folder):
    srgb = ImageCms.ImageCmsProfile(ImageCms.createProfile("sRGB")).tobytes()
    Image.fromarray(CODES8).save(folder.path / "a.png", icc_profile=srgb)
    near(converted(folder)[0], SRGB8)
    for name, options in (("b.heic", {"quality": -1}), ("c.avif", {}), ("d.webp", {"lossless": True}), ("e.tif", {}), ("f.jpg", {})):
        pillow_heif.register_heif_opener()
        Image.fromarray(CODES8).save(folder.path / name, icc_profile=srgb, **options)
    folder.lights.unlink()
    light = folder.light()
    near(light[3], SRGB8)
    assert "taken as sRGB" not in folder.said() and "lin_rec709_scene" in (folder.archive / "manifest.json").read_text()
    lab = ImageCms.ImageCmsProfile(ImageCms.createProfile("LAB")).tobytes()
    Image.fromarray(CODES8).save(folder.path / "a.png", icc_profile=lab)
    assert "profile" in folder.run().stderr


def test_a_transfer_that_is_asked_for_leaves_the_label_out_and_says_so(folder):
    folder.add("a.png", png(CODES16, (b"gAMA", struct.pack(">I", 45455))))
    light, manifest = converted(folder, "--transfer", "linear")
    near(light, CODES16 / 65535)
    assert "left out" in folder.said() and "lin_rec709_scene" not in manifest


def test_what_a_file_does_not_say_is_announced(folder):
    folder.add("a.png", png(CODES16))
    folder.light()
    assert "taken as sRGB" in folder.said()


@pytest.mark.parametrize("transfer, word", [(16, "display"), (18, "display")])
def test_pictures_coded_for_a_display_are_refused(folder, transfer, word):
    folder.add("a.png", png(CODES16, (b"cICP", bytes([9, transfer, 0, 1]))))
    assert word in folder.refusal()


def test_inks_and_lab_are_refused(folder):
    Image.fromarray(CODES8).convert("CMYK").save(folder.path / "a.jpg")
    assert "CMYK" in folder.refusal()
    (folder.path / "a.jpg").unlink()
    tifffile.imwrite(folder.path / "a.jpg", CODES8, photometric="cielab", metadata=None)
    assert "save it as R G B" in folder.refusal()


# --- full scale and intensities ---

def test_twelve_bits_in_sixteen_are_noticed_and_full_scale_says_it(folder):
    codes = CODES16 >> 4
    folder.add("a.png", png(codes))
    folder.light("--transfer", "linear")
    assert "say --full-scale 4095" in folder.said()
    near(folder.light("--transfer", "linear", "--full-scale", "4095")[0], codes / 4095)


def test_a_netpbm_file_of_twelve_bits_knows_its_full_scale(folder):
    codes = GREY16 >> 4
    folder.add("a.pgm", b"P5\n%d %d\n4095\n" % (WIDTH, HEIGHT) + codes.astype(">u2").tobytes())
    near(folder.light("--transfer", "linear")[0], codes / 4095, 1e-5)


@pytest.mark.parametrize("kind", ["lines", "names", "column", "grey column"])
def test_pictures_are_divided_by_their_lights_intensities(folder, kind, tmp_path):
    intensities = np.array([[1.5, 1.25, 0.75], [0.5, 2, 1]])
    if kind == "grey column":
        intensities = np.repeat(intensities[:, :1], 3, 1)
    for i, name in enumerate(("a.png", "b.png")):
        folder.add(name, png(CODES16))
    numbers = [" ".join(map(str, row if kind != "grey column" else row[:1])) for row in intensities]
    options = []
    if "column" in kind:
        folder.lights.write_text(f"2\na.png 0 0 1 {numbers[0]}\nb.png 0 1 1 {numbers[1]}\n")
    else:
        text = [f"b.png {numbers[1]}", f"a.png {numbers[0]}"] if kind == "names" else numbers
        (tmp_path / "light_intensities.txt").write_text("\n".join(text) + "\n")
        options = ["--intensities", tmp_path / "light_intensities.txt"]
    near(folder.light("--transfer", "linear", *options), CODES16[None] / 65535 / intensities[:, None, None], 4e-6)


@pytest.mark.parametrize("text, word", [("1 1 1\n", "has 1 intensities"), ("1\n0\n", "no intensity"), ("1\nnan\n", "no intensity"),
                                        ("a.png 1\nc.png 1\n", "none of the lights"), ("a.png 1\na.png 1\n", "already")])
def test_intensities_that_do_not_fit_are_refused_by_line(folder, text, word, tmp_path):
    for name in ("a.png", "b.png"):
        folder.add(name, png(CODES16))
    (tmp_path / "i.txt").write_text(text)
    assert word in folder.refusal("--intensities", tmp_path / "i.txt")


def palette_tiff(bits, indices, colors):
    """One strip of packed indices and a ColorMap of 16-bit R, then G, then B (TIFF 6.0, section 5)."""
    height, width = indices.shape
    rows = np.packbits(((indices[:, :, None] >> np.arange(bits - 1, -1, -1)) & 1).reshape(height, -1).astype(np.uint8), axis=1)
    data, table = rows.tobytes(), (colors.astype(np.uint16) * 257).T.tobytes()
    tags = [(256, 4, 1, width), (257, 4, 1, height), (258, 3, 1, bits), (259, 3, 1, 1), (262, 3, 1, 3), (273, 4, 1, 8), (277, 3, 1, 1), (278, 4, 1, height),
            (279, 4, 1, len(data)), (320, 3, 3 * 2**bits, 8 + len(data))]
    head = struct.pack("<2sHI", b"II", 42, 8 + len(data) + len(table))
    return head + data + table + struct.pack("<H", len(tags)) + b"".join(struct.pack("<HHII", *tag) for tag in tags) + bytes(4)


@pytest.mark.parametrize("bits", [1, 4, 8])
def test_a_palette_is_read_through_its_colours(folder, bits):
    indices = GENERATOR.integers(0, 2**bits, (HEIGHT, WIDTH)).astype(np.uint8)
    colors = GENERATOR.integers(0, 256, (2**bits, 3))
    folder.add("a.tif", palette_tiff(bits, indices, colors))
    truth = linear_of(colors[indices] / 255)
    assert np.array_equal(np.asarray(Image.open(folder.path / "a.tif").convert("RGB")), colors[indices])
    near(folder.light()[0], truth)


@pytest.mark.parametrize("grey, type", [(GREY16, np.uint16), (GREY8, np.uint8)])
def test_white_is_zero_and_alpha_has_no_white(folder, grey, type):
    last = np.iinfo(type).max
    alpha = np.zeros((HEIGHT, WIDTH), type)
    alpha[3:9, 4:20] = last
    for name, photometric in (("m.tif", "miniswhite"), ("n.tif", "minisblack")):
        tifffile.imwrite(folder.path.parent / name, np.dstack([grey, alpha]), photometric=photometric, extrasamples=["unassalpha"], planarconfig="contig", metadata=None)
    folder.add("a.png", CODES8)
    masks = []
    for name in ("m.tif", "n.tif"):
        folder.light("--mask", folder.path.parent / name)
        masks.append(OpenEXR.File(str(folder.archive / "cam0/target_000000.exr"), separate_channels=True).parts[1].channels["Y"].pixels.copy())
    assert np.array_equal(masks[0], masks[1]) and (masks[0] > 0).sum() == HEIGHT * WIDTH - 96
    tifffile.imwrite(folder.path / "a.png", np.dstack([grey, alpha]), photometric="miniswhite", extrasamples=["unassalpha"], planarconfig="contig", metadata=None)
    near(folder.light()[0], linear_of((last - grey.astype(int)) / last))


def test_a_flat_picture_may_be_packed_tightly_and_a_tile_of_gigabytes_not(folder):
    disc = np.hypot(*np.mgrid[-1000:1000, -1000:1000]) < 800
    Image.fromarray(disc).save(folder.path / "a.tif", compression="group4")
    assert (folder.path / "a.tif").stat().st_size < 2000  # of 4 MB
    near(folder.light()[0], disc * 1.0)
    tifffile.imwrite(folder.path / "a.tif", CODES8, photometric="rgb", tile=(16, 16), metadata=None)
    file = bytearray((folder.path / "a.tif").read_bytes())
    for tag in (322, 323):
        at = file.index(struct.pack("<H", tag))
        file[at:at + 12] = struct.pack("<HHII", tag, 4, 1, 32768)
    (folder.path / "a.tif").write_bytes(file)
    done = folder.run()
    assert done.returncode == 1 and "a.tif' says that a tile takes" in done.stderr


def test_primaries_of_openexr_are_of_light_and_not_of_codes(folder):
    codes = {name: (CODES8[..., c] / 255).astype(np.float32) for c, name in enumerate("RGB")}
    wide = chromaticities(0.708, 0.292, 0.170, 0.797, 0.131, 0.046, 0.3127, 0.3290)
    (folder.path / "a.exr").write_bytes(exr(codes, extra=[wide]))
    as_file = folder.light()[0]
    assert "converted" in folder.said()
    near(folder.light("--transfer", "linear")[0], as_file)
    near(folder.light("--transfer", "srgb")[0], SRGB8)
    assert "its primaries are left out" in folder.said() and "lin_rec709_scene" not in (folder.archive / "manifest.json").read_text()
    (folder.path / "a.exr").write_bytes(b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 1 +X 4\n" + bytes(16))
    done = folder.run("--transfer", "srgb")
    assert done.returncode == 1 and "leave out --transfer srgb" in done.stderr
