# SPDX-License-Identifier: MIT
"""The moving head: recorded with and without motion compensation, relit as short films, and held against the virtual stage
frozen at each target's moment."""
import json

import noise
from PIL import Image, ImageDraw, ImageFont
from session import BIN, VirtualStage, run, run_json

SCENE = "tools/stagesim/scenes/motion_demo.toml"
STAGE = "tools/demo/stage_moving.toml"
BASIS, CYCLES, FPS = "s159", 3, 24
QUALITIES = ["none", "standard"]  # of motion compensation
SHUTTER_DEG = 180
EXPOSURE_EV = 1.3
TICKS_A_MICROSECOND = 125
COUNTS_PER_US = 2.52  # the default stage's gain
LABELS = {"none": "no compensation", "standard": "compensated", "blurred": f"compensated, {SHUTTER_DEG}° shutter", "truth": "truth"}


def record(clock, out):
    """One take a quality: the virtual stage is the same to the bit each time. Gives stagectl's reports."""
    takes = {}
    for quality in QUALITIES:
        with clock(f"record the moving head ({LABELS[quality]})"):
            with VirtualStage(SCENE, STAGE, out / f"stage/moving_{quality}") as stage:
                takes[quality] = run_json(
                    BIN / "stagectl", "run", "--basis", BASIS, "--cycles", CYCLES, "--fps", FPS, "--quality", quality, "--stage", STAGE,
                    *stage.devices(), "--nominal", "--estimate", "clipped",
                    "--production", "demo", "--scene", "moving head", "--take", quality, "-o", out / f"moving_{quality}.rfa", "--json")
    return takes


def film(clock, out, light):
    """Relights every target; the pictures by name of strip."""
    folder = out / "moving"
    folder.mkdir(exist_ok=True)
    light = [*light, "--exposure", EXPOSURE_EV, "--target", "all"]
    with clock("relight the moving head"):
        for quality in QUALITIES:
            run(BIN / "rf", "relight", out / f"moving_{quality}.rfa", *light, "-o", folder / f"{quality}.exr", "--png", folder / f"{quality}.png")
        run(BIN / "rf", "relight", out / "moving_standard.rfa", *light, "--shutter", SHUTTER_DEG, "-o", folder / "blurred.exr",
            "--png", folder / "blurred.png")
    return {name: sorted(folder.glob(f"{name}_*.png")) for name in [*QUALITIES, "blurred"]}


def moments_us(archive):
    """The scene's time at each target, the middle of its tracking exposure: scene time 0 is the board's first trigger."""
    sequence = json.loads((archive / "manifest.json").read_text())["extra"]["sequence"]
    journal = [json.loads(line) for line in (archive / "journal.jsonl").read_text().splitlines()]
    places = [event["provenance"] for event in journal if event["event"] == "target"]
    numbers = [place["cycle"] * sequence["slots"] + place["slot"] for place in places]
    return [n * sequence["period_ticks"] / TICKS_A_MICROSECOND + sequence["exposure_us"]["tracking"] / 2 for n in numbers]


def compare(clock, out, light):
    """PSNR of each target in each film against the scene frozen at its moment, in the take's own unit (counts over the stage's
    gain, which is what a nominal calibration divides by)."""
    folder = out / "moving"
    figures = {f"moving_psnr_{quality}_db": [] for quality in QUALITIES}
    with clock("compare the moving head with the truth"):
        for n, at_us in enumerate(moments_us(out / "moving_standard.rfa")):
            truth_file = folder / f"truth_{n:06d}.exr"
            run(BIN / "stagesim", "render", SCENE, "--stage", STAGE, *light, "--exposure", EXPOSURE_EV, "--at-us", at_us, "--unit", "counts",
                "-o", truth_file, "--png", folder / f"truth_{n:06d}.png", "--png-gain", 1 / COUNTS_PER_US)
            truth = noise.read_image(truth_file) / COUNTS_PER_US
            for quality in QUALITIES:
                relit = noise.read_image(folder / f"{quality}_{n:06d}.exr")
                figures[f"moving_psnr_{quality}_db"].append(round(noise.psnr_db(relit, truth), 2))
    return figures


def animate(films, path):
    """Side by side, one film beside the other, at FPS pictures a second, there and back."""
    frames = []
    for pictures in zip(*films.values()):
        tiles = [Image.open(picture).convert("RGB") for picture in pictures]
        width, height = tiles[0].size
        frame = Image.new("RGB", (width * len(tiles), height + 24), "black")
        draw, font = ImageDraw.Draw(frame), ImageFont.load_default(15)
        for n, (name, tile) in enumerate(zip(films, tiles)):
            frame.paste(tile, (n * width, 0))
            draw.text((n * width + 6, height + 3), LABELS[name], fill="white", font=font)
        frames.append(frame)
    loop = frames + frames[-2:0:-1]
    loop[0].save(path, save_all=True, append_images=loop[1:], duration=1000 / FPS * 2, loop=0)
    return frames
