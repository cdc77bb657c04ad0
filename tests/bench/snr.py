# SPDX-License-Identifier: MIT
"""Wenger's comparison of bases (section 5.4) on the virtual stage: 100 cycles of a grey chart for each basis, recorded through the
emulated board, and the signal-to-noise ratio over the 100 images of each pixel, beside what the noise model predicts.

    make noise     runs this, too, and writes out/bench/snr.json, snr.md and the table of docs/bases.md

Prediction knows the stage's noise model, the light of one noise-free cycle, and the rows of the basis: var = sum over slots of
w^2 (sigma(mu)^2 + 1/12), the last for rounding to counts. The measured noise is that of archived images."""
import argparse
import json
import re
import sys
from pathlib import Path

import numpy as np
import OpenEXR

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tools/demo"))
import marked_section  # noqa: E402
from session import BIN, VirtualStage, run  # noqa: E402

CYCLES = 100
WIDTH, HEIGHT = 48, 32
COUNTS_PER_US, FULL_US = 2.52, 412
READ, SHOT = 2.68, 0.492
STAGE = f"""[[camera]]
preset = "phantom_v7.1"
width = {WIDTH}
height = {HEIGHT}
cfa = "none"
vignetting = 0
counts_per_us = {COUNTS_PER_US}
"""
# Columns of the patches, clear of their borders and of the shadow's edge.
PATCHES = {"skin as stated": slice(4, 14), "skin as measured": slice(20, 28)}
SHADOWED = (slice(12, 20), slice(38, 42))
FRONTAL, SHADOW = 71, 73  # lamps: straight ahead; whose light the ball keeps from the third patch
# Basis, exposure in us, and the SNR of Wenger's table. Wenger's Hadamard exposure is 100 us; hadamard156 has a row of all
# lamps, which saturates there.
TAKES = [("single", FULL_US, 45.4), ("triangle", FULL_US, 80.9), ("s155", 100, 40.1), ("s159", 100, None),
         ("hadamard156", 60, None)]


def sigma2(counts):
    return (READ + SHOT * np.sqrt(np.maximum(counts, 0))) ** 2


def write_sequence(folder, basis, exposure_us):
    path = folder / f"{Path(basis).stem}.toml"
    path.write_text(f'basis = "{basis}"\n[exposure_us]\nbasis = {exposure_us}\ntracking = 66\n')
    return path


def levels_of(sequence):
    """rows x lamps of the basis, as the compiled cycle lights them."""
    slots = json.loads(run(BIN / "stagectl", "sequence", sequence, "--json"))["slots"]
    rows = sorted((slot for slot in slots if slot["kind"] == "basis"), key=lambda slot: slot["row"])
    levels = np.zeros((len(rows), 156))
    for slot in rows:
        if slot["planes"]:
            levels[slot["row"]] = np.array(slot["levels"][:156]) / (2 ** slot["planes"] - 1)
        else:
            levels[slot["row"], [lamp for lamp in slot["lit"] if lamp < 156]] = 1
    return levels


def inverse_of(basis, levels):
    """images x rows: a triple's own image, a third of it; else the least squares that integer weights come close to."""
    if basis == "triangle":
        return np.eye(len(levels)) / 3
    return np.linalg.pinv(levels)


def record(folder, name, sequence, cycles, *disabled):
    """Plays a take and returns its images in counts of 412 us: cycles x lamps x height x width."""
    stage = folder / "stage.toml"
    # Without quantisation frames are counts above black.
    stage.write_text(STAGE + ("black = 0\n" if "quantisation" in disabled else ""))
    options = [part for effect in disabled for part in ("--disable-effect", effect)]
    archive = folder / f"{name}.rfa"
    with VirtualStage(ROOT / "tools/stagesim/scenes/chart.toml", stage, folder / name, *options) as virtual:
        run(BIN / "stagectl", "run", "--sequence", sequence, "--stage", stage, *virtual.devices(), "--nominal", "--float",
            "--cycles", cycles, "--overwrite", "-o", archive)
    targets = sorted((archive / "cam0").glob("target_*.exr"))
    return np.stack([read_lamps(path) for path in targets]) * COUNTS_PER_US * FULL_US


def read_lamps(path):
    with OpenEXR.File(str(path), separate_channels=True) as file:
        channels = {name: channel.pixels for part in file.parts for name, channel in part.channels.items()}
    lamps = sorted(int(match[1]) for match in map(re.compile(r"lamp_(\d+)\.Y$").match, channels) if match)
    return np.stack([channels[f"lamp_{lamp:03d}.Y"] for lamp in lamps])


def predicted_variance(levels, inverse, image, truth, exposure_us):
    """Of one image, in squared counts of 412 us, for each pixel of truth (lamps x height x width, counts of 412 us)."""
    share = exposure_us / FULL_US
    counts = np.tensordot(levels, truth[: levels.shape[1]], 1) * share
    return np.tensordot(inverse[image] ** 2, sigma2(counts) + 1 / 12, 1) / share**2


def snr_over(images, region):
    """Wenger's figure: mean over standard deviation of each pixel over the cycles, averaged over the pixels."""
    pixels = images[:, region[0], region[1]].reshape(len(images), -1)
    return float(np.mean(pixels.mean(0) / pixels.std(0, ddof=1)))


def noise_over(images, region):
    pixels = images[:, region[0], region[1]].reshape(len(images), -1)
    return float(np.sqrt(pixels.var(0, ddof=1).mean()))


def frontal_triple(levels):
    """The row of the triangle basis whose lamps are brightest on the chart."""
    rows = [row for row in range(len(levels)) if levels[row, FRONTAL]]
    return rows[0]


def measure(basis, exposure_us, paper, images, levels, truth):
    """A row of the table: the frontal lamp on both patches, and the shadowed one in the shadow."""
    inverse = inverse_of(basis, levels)
    whole = slice(None)
    if basis == "triangle":
        front = frontal_triple(levels)
        signal = truth[np.flatnonzero(levels[front])].mean(0)
        dark = None
    else:
        front, dark, signal = FRONTAL, SHADOW, truth[FRONTAL]
    row = {"basis": basis, "exposure_us": exposure_us, "paper": paper}
    variance = predicted_variance(levels, inverse, front, truth, exposure_us)
    for patch, columns in PATCHES.items():
        region = (whole, columns)
        row[patch] = {"snr": snr_over(images[:, front], region),
                      "predicted": float(np.mean((signal / np.sqrt(variance))[region])),
                      "counts": float(signal[region].mean())}
    if dark is not None:
        variance = predicted_variance(levels, inverse, dark, truth, exposure_us)
        row["shadow"] = {"noise": noise_over(images[:, dark], SHADOWED),
                         "predicted": float(np.sqrt(variance[SHADOWED].mean())),
                         "counts": float(truth[dark][SHADOWED].mean())}
    return row


def triples_of_singles(images, truth, triangle_levels):
    """Wenger's last remark: triples of single images added up."""
    lamps = np.flatnonzero(triangle_levels[frontal_triple(triangle_levels)])
    total, row = images[:, lamps].sum(1), {"basis": "triples of single, added", "exposure_us": FULL_US, "paper": None}
    variance = (sigma2(truth[lamps]) + 1 / 12).sum(0)
    for patch, columns in PATCHES.items():
        region = (slice(None), columns)
        row[patch] = {"snr": snr_over(total, region),
                      "predicted": float(np.mean((truth[lamps].sum(0) / np.sqrt(variance))[region])),
                      "counts": float(truth[lamps].mean(0)[region].mean())}
    return row


def table(rows):
    lines = ["| basis | exposure | SNR, Wenger | SNR on the brighter patch | predicted | SNR on the 6 % patch | predicted | noise in shadow, counts | predicted |",
             "| --- | --- | --- | --- | --- | --- | --- | --- | --- |"]
    for row in rows:
        bright, stated, shadow = row["skin as measured"], row["skin as stated"], row.get("shadow")
        dark = f"{shadow['noise']:.2f} | {shadow['predicted']:.2f}" if shadow else "| "
        lines.append(f"| {row['basis']} | {row['exposure_us']:g} us | {row['paper'] or ''} | {bright['snr']:.1f} | {bright['predicted']:.1f} "
                     f"| {stated['snr']:.1f} | {stated['predicted']:.1f} | {dark} |")
    return "\n".join(lines) + "\n"


def worst_disagreement(rows):
    pairs = [(row[p]["snr"], row[p]["predicted"]) for row in rows for p in PATCHES]
    pairs += [(row["shadow"]["noise"], row["shadow"]["predicted"]) for row in rows if "shadow" in row]
    return max(abs(measured / predicted - 1) for measured, predicted in pairs)


def design_for_chart(folder):
    """A basis for the brighter patch, in full exposure, whose slots stay darker than the tracking slots that prove the cycle."""
    path = folder / "designed.csv"
    run(BIN / "stagectl", "basis", "design", "--counts", "612", "--card", "800", "-o", path)
    return path


def main():
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--out", default="out/bench", help="folder for snr.json and snr.md")
    options.add_argument("--page", help="page whose section `snr` gets the table, docs/bases.md")
    options.add_argument("--cycles", type=int, default=CYCLES)
    arguments = options.parse_args()
    out = Path(arguments.out).resolve()
    folder = out / "snr"
    folder.mkdir(parents=True, exist_ok=True)

    single = write_sequence(folder, "single", FULL_US)
    truth = record(folder, "truth", single, 1, "noise", "quantisation")[0]
    rows, of_single = [], None
    triangle_levels = levels_of(write_sequence(folder, "triangle", FULL_US))
    for basis, exposure_us, paper in [*TAKES, (str(design_for_chart(folder)), FULL_US, None)]:
        name = Path(basis).stem
        sequence = write_sequence(folder, basis, exposure_us)
        images = record(folder, name, sequence, arguments.cycles)
        row = measure(basis, exposure_us, paper, images, levels_of(sequence), truth)
        rows.append({**row, "basis": name})
        print(json.dumps(rows[-1]), flush=True)
        if basis == "single":
            of_single = images
    rows.append(triples_of_singles(of_single, truth, triangle_levels))
    worst = worst_disagreement(rows)
    (out / "snr.json").write_text(json.dumps({"cycles": arguments.cycles, "worst_disagreement": worst, "rows": rows}, indent=1) + "\n")
    (out / "snr.md").write_text(table(rows))
    if arguments.page:
        marked_section.replace(arguments.page, "snr", table(rows))
    print(table(rows))
    print(f"simulation and prediction differ by at most {worst * 100:.1f} %")
    return 0 if worst < 0.03 else 1


if __name__ == "__main__":
    sys.exit(main())
