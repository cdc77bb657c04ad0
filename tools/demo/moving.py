# SPDX-License-Identifier: MIT
"""The moving head: recorded with and without motion compensation, relit as short films, and held against the virtual stage
frozen at each target's moment."""
import json
import tomllib
from pathlib import Path

import noise
from PIL import Image, ImageDraw, ImageFont
from session import BIN, Daemon, VirtualStage, run

SCENE = "tools/stagesim/scenes/motion_demo.toml"
STAGE = "tools/demo/stage_moving.toml"
BASIS, FPS = "s159", 24
# With the half cycle that targets need before and after them, half a second: the head turns from one side to the other, speaks a
# syllable and blinks.
SECONDS = 5 / 12
SLATE = "moving"
QUALITIES = ["none", "standard"]  # of motion compensation
SHUTTER_DEG = 180
# Of .cache/assets/env. Where a few lamps give most of the light, what moved between their slots shows; even light hides it.
ENVIRONMENT, ROTATE_DEG, EXPOSURE_EV = "city", 60, 0
LABELS = {"none": "not compensated", "standard": "compensated", "truth": "truth"}
LABEL_PX = 24  # the height of the line under a picture
SLOWER, COLORS = 2, 128  # than life, and altogether, in the animation
SHOWN = 5  # pictures of a film in the sequence


def record(clock, out):
    """One recording by the daemon, developed in each quality. Gives its report."""
    first, *others = QUALITIES[::-1]
    settings = f'sequence = "{BASIS}"\nnominal = true\nestimate = "clipped"\nproduction = "demo"\nslate = "{SLATE}"'
    with clock("record the moving head, every frame rendered: minutes"):
        with VirtualStage(SCENE, STAGE, out / "stage/moving") as stage, Daemon(STAGE, stage.work, out, settings) as daemon:
            take = daemon("record", "--seconds", SECONDS, "--fps", FPS, "--quality", first,
                          *[word for one in others for word in ("--also", one)])
            daemon("preview", "-o", out / "moving_preview.png")
            return take


def archive(out, quality):
    return out / f"{SLATE}_001{'' if quality == QUALITIES[-1] else f'-{quality}'}.rfa"


def film(clock, out, environment):
    """Relights every target, sharp and as a shutter sees it, and renders the scene frozen at its moment; the sharp pictures and
    the truth's by name of film."""
    folder = out / "moving"
    folder.mkdir(exist_ok=True)
    light = ["--env", environment, "--rotate", ROTATE_DEG, "--exposure", EXPOSURE_EV]
    relit = [*light, "--target", "all"]
    with clock("relight the moving head"):
        for quality in QUALITIES:
            run(BIN / "rf", "relight", archive(out, quality), *relit, "-o", folder / f"{quality}.exr", "--png", folder / f"{quality}.png")
        run(BIN / "rf", "relight", archive(out, "standard"), *relit, "--shutter", SHUTTER_DEG, "-o", folder / "blurred.exr",
            "--png", folder / "blurred.png")
    with clock("render the truth of the moving head"):
        for n, at_us in enumerate(moments_us(archive(out, "standard"))):
            run(BIN / "stagesim", "render", SCENE, "--stage", STAGE, *light, "--at-us", at_us, "--unit", "counts",
                "-o", folder / f"truth_{n:06d}.exr", "--png", folder / f"truth_{n:06d}.png", "--png-gain", 1 / counts_per_us())
    return {name: sorted(folder.glob(f"{name}_*.png")) for name in LABELS}


def counts_per_us():
    """What a nominal calibration divides by."""
    return tomllib.loads(Path(STAGE).read_text())["camera"][0]["counts_per_us"]


def moments_us(archive):
    """The scene's time at each target, the middle of its tracking exposure: scene time 0 is the board's first trigger."""
    sequence = json.loads((archive / "manifest.json").read_text())["extra"]["sequence"]
    journal = [json.loads(line) for line in (archive / "journal.jsonl").read_text().splitlines()]
    places = [event["provenance"] for event in journal if event["event"] == "target"]
    numbers = [place["cycle"] * sequence["slots"] + place["slot"] for place in places]
    period_us = 1e6 * sequence["period_ticks"] / sequence["tick_hz"]
    return [n * period_us + sequence["exposure_us"]["tracking"] / 2 for n in numbers]


def compare(out):
    """PSNR of each film against the truth, in the take's own unit: of all targets and of each."""
    folder, figures, by_target = out / "moving", {}, {}
    for quality in QUALITIES:
        pairs = [(noise.read_image(relit), noise.read_image(folder / relit.name.replace(quality, "truth")) / counts_per_us())
                 for relit in sorted(folder.glob(f"{quality}_*.exr"))]
        by_target[quality] = [round(noise.psnr_db(*pair), 2) for pair in pairs]
        figures[f"moving_psnr_{quality}_db"] = round(sum(by_target[quality]) / len(pairs), 2)
    return {**figures, "moving_psnr_by_target_db": by_target}


def labelled(picture, label):
    tile = Image.open(picture).convert("RGB")
    framed = Image.new("RGB", (tile.width, tile.height + LABEL_PX), "black")
    framed.paste(tile)
    if label:
        ImageDraw.Draw(framed).text((6, tile.height + 3), label, fill="white", font=ImageFont.load_default(15))
    return framed


def beside(tiles):
    row = Image.new("RGB", (sum(tile.width for tile in tiles), tiles[0].height))
    for n, tile in enumerate(tiles):
        row.paste(tile, (n * tile.width, 0))
    return row


def below(rows):
    sheet = Image.new("RGB", (rows[0].width, sum(row.height for row in rows)))
    for n, row in enumerate(rows):
        sheet.paste(row, (0, n * row.height))
    return sheet


def animate(films, path):
    """The films side by side, there and back; one palette for all pictures, so that nothing flickers."""
    frames = [beside([labelled(picture, LABELS[name]) for name, picture in zip(films, pictures)]) for pictures in zip(*films.values())]
    palette = below(frames).quantize(COLORS, dither=Image.Dither.NONE)
    frames = [frame.quantize(palette=palette, dither=Image.Dither.NONE) for frame in frames]
    loop = frames + frames[-2:0:-1]
    loop[0].save(path, save_all=True, append_images=loop[1:], duration=1000 * SLOWER / FPS, loop=0, optimize=True)


def sequence(films, path):
    """The films one below the other: SHOWN moments of each, evenly spaced from the first to the last."""
    count = len(films["truth"])
    shown = [round(n * (count - 1) / (SHOWN - 1)) for n in range(SHOWN)]
    below([beside([labelled(pictures[n], LABELS[name] if column == 0 else "") for column, n in enumerate(shown)])
           for name, pictures in films.items()]).save(path, quality=90, subsampling=0)
