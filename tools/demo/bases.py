# SPDX-License-Identifier: MIT
"""The head relit from a take in every basis, side by side, with its error and what `stagectl basis report` foretold."""
import json

import noise
from PIL import Image, ImageDraw, ImageFont
from session import BIN, run, run_json

COLUMNS = 4
FORETOLD = {"condition": ("condition",), "noise_gain_mean": ("noise_gain", "mean"), "snr_chart": ("snr_chart", "facing"),
            "snr_shadow": ("snr_shadow", "facing"), "lux_mean": ("lux", "mean"), "strobe_hz": ("strobe_lowest_hz",),
            "slots": ("slots",)}


def foretold(basis, exposure_us, stage):
    """Figures of the report at the exposure that the take had."""
    report = run_json(BIN / "stagectl", "basis", "report", basis, "--stage", stage, "--exposure-us", exposure_us, "--json")
    figures = {}
    for name, keys in FORETOLD.items():
        value = report
        for key in keys:
            value = value[key]
        figures[name] = round(value, 4)
    return figures


def compare(bases, path_of, light, truth, stage, out):
    """Relights every take and writes bases.png and bases.json. `truth` is the virtual stage's own picture."""
    figures, tiles = {}, []
    for basis in bases:
        take = path_of(basis)
        extra = json.loads((take / "manifest.json").read_text())["extra"]
        exposure_us = extra["sequence"]["exposure_us"]["basis"]
        picture = out / "compare" / f"{take.stem}_bases"
        run(BIN / "rf", "relight", take, *light, "--exposure", 1.3, "--float", "-o", f"{picture}.exr", "--png", f"{picture}.png")
        relit = noise.read_image(f"{picture}.exr") / 2**1.3
        figures[basis] = {"psnr_db": round(noise.psnr_db(relit, truth), 2), "exposure_us": exposure_us,
                          "is_estimate": extra["basis"]["is_estimate"], **foretold(basis, exposure_us, stage)}
        tiles.append((basis, figures[basis], Image.open(f"{picture}.png").convert("RGB")))
    (out / "bases.json").write_text(json.dumps(figures, indent=1) + "\n")
    contact_sheet(tiles).save(out / "bases.png")


def contact_sheet(tiles):
    width, height = (side // 2 for side in tiles[0][2].size)
    caption, rows = 44, -(-len(tiles) // COLUMNS)
    sheet = Image.new("RGB", (COLUMNS * width, rows * (height + caption)), "white")
    draw, font = ImageDraw.Draw(sheet), ImageFont.load_default(15)
    for n, (basis, figures, picture) in enumerate(tiles):
        x, y = n % COLUMNS * width, n // COLUMNS * (height + caption)
        sheet.paste(picture.resize((width, height), Image.Resampling.LANCZOS), (x, y))
        text = f"{basis}{' (estimate)' if figures['is_estimate'] else ''}\n{figures['psnr_db']} dB, {figures['exposure_us']:g} us, {figures['lux_mean']:.0f} lux"
        draw.text((x + 6, y + height + 3), text, fill="black", font=font)
    return sheet
