# SPDX-License-Identifier: MIT
"""What each basis gains over single lamps, from 1 to 1000 counts a lamp: predicted, simulated, and bounded.

    make noise     runs this, too, and writes out/bench/basis_gain.json, the plot and the table of docs/bases.md

`stagectl basis design` designs a basis for each level and predicts; seeded Gaussian noise of the camera's sigma, rounded to counts, on
the designed and the known bases checks that. Gains are ratios of root mean variances of the recovered lamps over lamps and subjects,
so 2 is half the noise. Three questions: lamps that are all alike; a face (matte surfaces that the camera sees); and a face
before a sensor that saturates: the white card is four times as bright as the face, as in Wenger 5.1."""
import argparse
import json
import subprocess
import sys
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import marked_section  # noqa: E402
import numpy as np  # noqa: E402
from matplotlib import pyplot  # noqa: E402

ROOT = Path(__file__).resolve().parents[2]
STAGECTL = ROOT / "build/host/bin/stagectl"
COUNTS = [1, 2, 5, 10, 20, 50, 100, 200, 500, 1000]
READ, SHOT, SAMPLES = 2.68, 0.492, 400
FULL_SCALE = (4095 - 64) * 0.98  # as stagectl basis design has it
COLORS = {"designed": "#1f5fa8", "hadamard156": "#c0392b", "s159": "#d98200", "triangle300": "#3a8f4a"}
PANELS = {
    "equal": ("all lamps alike, nothing saturates", ["--subject", "equal"], None),
    "cosine": ("a face, nothing saturates", ["--subject", "cosine"], None),
    "saturating": ("a face; a card four times as bright must not saturate", ["--subject", "cosine"], 4),
}


def design(folder, panel, counts):
    _, options, card = PANELS[panel]
    path = folder / f"{panel}_{counts}.csv"
    limit = ["--card", str(card * counts)] if card else []
    command = [STAGECTL, "basis", "design", "--counts", str(counts), *options, *limit, "--starts", "2", "--json", "-o", path]
    done = subprocess.run(list(map(str, command)), capture_output=True, text=True)
    if done.returncode != 0:
        sys.exit(f"basis_gain: {done.stderr}")
    return json.loads(done.stdout), np.loadtxt(path, delimiter=",")


def simulated_deviation(light, subjects, exposure, seed):
    """Root mean square error of the recovered lamps, in counts of the full exposure; least squares, as the file is inverted."""
    random = np.random.default_rng(seed)
    inverse = np.linalg.pinv(light)
    clean = subjects @ light.T * exposure
    error2 = 0
    for _ in range(max(1, SAMPLES // len(subjects))):
        frames = np.round(clean + deviation(clean) * random.standard_normal(clean.shape))
        error2 += np.mean(((frames @ inverse.T) / exposure - subjects) ** 2)
    return float(np.sqrt(error2 / max(1, SAMPLES // len(subjects))))


def deviation(counts):
    return READ + SHOT * np.sqrt(counts)


def single_light(lamps=156):
    return np.eye(lamps)


def measure(folder):
    rows = []
    for panel, (_, _, card) in PANELS.items():
        for counts in COUNTS:
            if card and card * counts > FULL_SCALE:  # even one lamp saturates
                continue
            report, light = design(folder, panel, counts)
            bases = {basis["name"]: basis for basis in report["bases"]}
            subjects = np.array(report["subjects"])
            subjects = np.repeat(subjects, SAMPLES, axis=0) if len(subjects) == 1 else subjects
            single = simulated_deviation(single_light(), subjects, 1, 1)
            designed = simulated_deviation(light / light.max(), subjects, bases["designed"]["exposure_share"], 2)
            row = {"panel": panel, "counts": counts, "start": report["start"], "lit_max": bases["designed"]["lit_max"],
                   "simulated": single / designed}
            row |= {name: basis["gain_over_single"] for name, basis in bases.items()}
            if "bound_mean_variance" in report:
                row["bound"] = float(np.sqrt(bases["single"]["mean_variance"] / report["bound_mean_variance"]))
            rows.append(row)
            print(json.dumps(row), flush=True)
    return rows


def crossing(rows, name):
    """Counts at which a gain falls through 1, logarithmically between the levels; None where it does not."""
    for low, high in zip(rows, rows[1:]):
        a, b = np.log(low[name]), np.log(high[name])
        if a >= 0 > b:
            return float(np.exp(np.log(low["counts"]) + a / (a - b) * np.log(high["counts"] / low["counts"])))
    return None


def draw(rows, path):
    figure, panels = pyplot.subplots(1, 3, figsize=(15, 4.6), sharey=True)
    for axes, (panel, (title, _, _)) in zip(panels, PANELS.items()):
        here = [row for row in rows if row["panel"] == panel]
        counts = [row["counts"] for row in here]
        if "bound" in here[0]:
            axes.plot(counts, [row["bound"] for row in here], "--", color="#666666", label="no basis can do better")
            alone = np.array(counts)
            axes.plot(counts, 3 * deviation(alone) / deviation(3 * alone), ":", color=COLORS["triangle300"],
                      label="triangle, each triple a light of its own")
        for name, color in COLORS.items():
            axes.plot(counts, [row[name] for row in here], color=color, label=f"{name}, predicted")
        axes.plot(counts, [row["simulated"] for row in here], "o", color=COLORS["designed"], label="designed, simulated")
        axes.axhline(1, color="black", linewidth=0.8)
        axes.set(xscale="log", yscale="log", title=title, xlabel="counts of a lamp that the surface faces")
        axes.set_yticks([0.2, 0.3, 0.5, 0.7, 1, 1.5, 2, 3], ["0.2", "0.3", "0.5", "0.7", "1", "1.5", "2", "3"])
        axes.minorticks_off()
        axes.set_ylim(0.13, 4.3)
        axes.set_xlim(0.8, 1250)
        axes.grid(alpha=0.25)
    panels[0].set_ylabel("SNR over that of single lamps")
    panels[0].legend(fontsize=8, loc="lower left")
    figure.tight_layout()
    figure.savefig(path, dpi=90)


def table(rows):
    lines = ["| panel | counts | designed | simulated | bound | hadamard156 | s159 | triangle300 | lit | found from |",
             "| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |"]
    for row in rows:
        bound = f"{row['bound']:.3f}" if "bound" in row else ""
        lines.append(f"| {row['panel']} | {row['counts']} | {row['designed']:.3f} | {row['simulated']:.3f} | {bound} | {row['hadamard156']:.3f} "
                     f"| {row['s159']:.3f} | {row['triangle300']:.3f} | {row['lit_max']:.0f} | {row['start']} |")
    return "\n".join(lines) + "\n"


def main():
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--out", default="out/bench", help="folder for basis_gain.json and basis_gain.md")
    options.add_argument("--plot", default="out/bench/basis_gain.png")
    options.add_argument("--page", help="page whose section `gain` gets the table, docs/bases.md")
    arguments = options.parse_args()
    out = Path(arguments.out)
    folder = out / "designs"
    folder.mkdir(parents=True, exist_ok=True)
    rows = measure(folder)
    crossings = {panel: {name: crossing([row for row in rows if row["panel"] == panel], name) for name in COLORS}
                 for panel in PANELS}
    (out / "basis_gain.json").write_text(json.dumps({"rows": rows, "crossings": crossings}, indent=1) + "\n")
    (out / "basis_gain.md").write_text(table(rows))
    draw(rows, arguments.plot)
    if arguments.page:
        marked_section.replace(arguments.page, "gain", table(rows))
    worst = max(abs(row["simulated"] / row["designed"] - 1) for row in rows)
    print(table(rows))
    print("a basis falls behind single lamps at, counts:", json.dumps(crossings))
    print(f"simulation and prediction differ by at most {worst * 100:.1f} %")
    return 0 if worst < 0.03 else 1


if __name__ == "__main__":
    sys.exit(main())
