#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""The demo: the whole system once, end to end. The firmware image plays lamps on the emulated board, the virtual stage renders
what they light, the daemon records, the tools relight; then the pictures are compared with the truth.

    .venv/bin/python tools/demo/demo.py --out out/demo
"""
import argparse
import json
import shutil
import sys
import tomllib
from pathlib import Path

import bases
import checks
import moving
import noise
import numpy as np
from PIL import Image
from session import BIN, ROOT, Chapters, Clock, VirtualStage, run, run_json, use_root

STAGES = {"noisy": "tools/demo/stage.toml", "clean": "tools/demo/stage_clean.toml"}
HEAD = "tools/stagesim/scenes/head.toml"
CARD = "tools/stagesim/scenes/card.toml"
CARD_REFLECTANCE = 0.985
# Of .cache/assets/env: exposure in stops, turn about the vertical in degrees.
ENVIRONMENTS = {"courtyard": (0.2, 0), "city": (0.4, 0), "sunset": (1.3, 120)}
HEAD_BOX = (140, 40, 500, 480)  # of a relit picture: left, top, right, bottom
TRUTH_ENVIRONMENT = "sunset"
COMPARED = ["single", "hadamard156"]  # bases whose pictures are held against the truth
OTHERS = ["triangle", "triangle300", "planes156", "s155", "paley163", "spherical_harmonics:10"]  # recorded by name, without a sequence file
SHOWN = "s159"  # the basis of the take that is shown
CYCLES = {"noisy": 2, "clean": 1}
MODELS = {"noisy": "on", "clean": "off"}  # the camera model


def environment(name):
    return ROOT / f".cache/assets/env/{name}.exr"


def sequence_file(basis):
    return f"examples/sequence_{basis}.toml"


def masked_samples(basis):
    """A saturated highlight shows as white in the image of its own lamp; where every row shows many lamps, their images are
    estimated, or the pixel would be black."""
    return [] if basis in ("single", "triangle") else ["--estimate", "smooth"]


class Demo:
    def __init__(self, out):
        self.out = out
        self.clock = Clock()
        self.takes = {}

    def path(self, basis, model):
        name = basis.replace(":", "_")
        return self.out / (f"{name}.rfa" if model == "noisy" else f"{name}_{model}.rfa")

    def calibrate(self, model):
        settings, options = STAGES[model], ["--camera-model", MODELS[model]]
        calibration = self.out / f"calibration_{model}"
        with self.clock(f"calibrate on the white card ({model} camera)"):
            with VirtualStage(CARD, settings, self.out / f"stage/card_{model}", *options) as stage:
                # Without noise, few frames do.
                cycles = [] if model == "noisy" else ["--cycles", 2]
                run(BIN / "stagectl", "calibrate", "--stage", settings, *stage.devices(), "--card", CARD_REFLECTANCE,
                    *cycles, "-o", calibration)
    def render_head(self, model, name, *options):
        with self.clock(f"render the head under every lamp ({name})"):
            return VirtualStage(HEAD, STAGES[model], self.out / f"stage/head_{name.replace(' ', '_')}",
                                "--camera-model", MODELS[model], *options).__enter__()

    def record(self, stage, basis, model):
        with self.clock(f"record {basis} ({model} camera)"):
            account = stage.work / f"{basis}.account.jsonl"
            self.takes[basis, model] = run_json(
                BIN / "stagectl", "run", "--sequence", sequence_file(basis), "--stage", STAGES[model], *stage.devices(),
                "--calibration", self.out / f"calibration_{model}", "--production", "demo", "--scene", "head", "--take", basis,
                "--timecode", "01:00:00:00", "--cycles", CYCLES[model], "--frames", account,
                *masked_samples(basis), "-o", self.path(basis, model), "--json")
            self.takes[basis, model]["account"] = account

    def first_picture(self):
        """The still head, as README's "Using it" records it; its stage stays up for the other bases."""
        self.calibrate("noisy")
        self.head = self.render_head("noisy", "noisy camera", "--vcd", self.out / "board.vcd")
        self.record(self.head, SHOWN, "noisy")
        self.relight()

    def record_bases(self):
        """The head in the bases that are compared, with and without noise, and one noisy cycle in each basis that has no example
        of its own, on a stage of their own: its trace would be long."""
        for basis in COMPARED:
            self.record(self.head, basis, "noisy")
        self.head.__exit__()
        self.calibrate("clean")
        stage = self.render_head("clean", "clean camera")
        for basis in COMPARED:
            self.record(stage, basis, "clean")
        stage.__exit__()
        stage = self.render_head("noisy", "other bases")
        for basis in OTHERS:
            with self.clock(f"record {basis}"):
                run(BIN / "stagectl", "run", "--basis", basis, "--stage", STAGES["noisy"], *stage.devices(), "--calibration",
                    self.out / "calibration_noisy", *masked_samples(basis), "-o", self.path(basis, "noisy"))
        stage.__exit__()

    def relight(self):
        take = self.path(SHOWN, "noisy")
        with self.clock("relight under three environments"):
            for name, (stops, degrees) in ENVIRONMENTS.items():
                run(BIN / "rf", "relight", take, "--env", environment(name), "--exposure", stops, "--rotate", degrees,
                    "-o", self.out / f"relit_{name}.exr", "--png", self.out / f"relit_{name}.png")
        heads = [Image.open(self.out / f"relit_{name}.png").convert("RGB").crop(HEAD_BOX) for name in ENVIRONMENTS]
        moving.beside(heads).save(self.out / "demo.jpg", quality=90, subsampling=0)
        with self.clock("contact sheet"):
            run(BIN / "rf", "export", take, "--contact-sheet", self.out / "contact-sheet.png")

    def move(self):
        """A moving head, with motion compensation and without."""
        take = moving.record(self.clock, self.out)
        films = moving.film(self.clock, self.out, environment(moving.ENVIRONMENT))
        moving.animate(films, self.out / "moving.gif")
        moving.sequence(films, self.out / "moving.jpg")
        figures = moving.compare(self.out)
        figures["moving_slots_missing"] = take["slots_missing_total"]
        return figures

    def compare(self):
        """Relit takes against the virtual stage's own rendering under the same light."""
        light = ["--env", environment(TRUTH_ENVIRONMENT)]
        folder = self.out / "compare"
        folder.mkdir(exist_ok=True)
        with self.clock("render the truth"):
            run(BIN / "stagesim", "render", HEAD, "--stage", STAGES["clean"], *light, "--unit", "counts", "-o", folder / "truth.exr")
        # Counts a microsecond over the flat field: the unit of a calibrated take.
        truth = noise.read_image(folder / "truth.exr") / noise.read_image(self.out / "calibration_clean/cam0/flat.exr")
        figures = {}
        with self.clock("compare with the truth"):
            for basis in COMPARED:
                name = basis.removesuffix("156")
                for model, suffix in (("clean", ""), ("noisy", "_noisy")):
                    relit = folder / f"{basis}_{model}.exr"
                    run(BIN / "rf", "relight", self.path(basis, model), *light, "--float", "-o", relit)
                    figures[f"psnr_{name}{suffix}_db"] = round(noise.psnr_db(noise.read_image(relit), truth), 2)
        with self.clock("compare all bases"):
            bases.compare([SHOWN, *COMPARED, *OTHERS], lambda basis: self.path(basis, "noisy"), light, truth, STAGES["noisy"], self.out)
        return figures

    def predict_noise(self):
        """What the noise model says of the noisy takes, before demosaicing, where it is exact."""
        weights = run_json(BIN / "rf", "weights", "--env", environment(TRUTH_ENVIRONMENT), "--json")
        irradiance = np.array([lamp["irradiance"] for lamp in weights["lamps"]])
        flat = noise.read_image(self.out / "calibration_noisy/cam0/flat.exr")
        facts = tomllib.loads((self.out / "calibration_noisy/cam0/calibration.toml").read_text())
        facing = sum(max(0.0, lamp["direction"][2]) for lamp in weights["lamps"])  # the card faces +z
        card = facts["frames"], facts["card_exposure_us"] * CARD_REFLECTANCE * facing
        figures = {}
        with self.clock("compare noise with its model"):
            for basis in COMPARED:
                account = self.takes[basis, "noisy"]["account"]
                sequence = tomllib.loads((ROOT / sequence_file(basis)).read_text())
                figures[basis] = noise.compare(
                    self.path(basis, "noisy") / "cam0/target_000000.exr", self.path(basis, "clean") / "cam0/target_000000.exr",
                    flat, card, checks.lit_rows(account, account.parent / "cam0.frames.jsonl", basis),
                    irradiance, sequence["exposure_us"]["basis"], read=2.68, shot=0.492)
        return figures

    def check(self):
        noisy = [basis for basis, model in self.takes if model == "noisy"]
        figures = {"slots_total": 0, "slots_missing": 0, "frames_mislabelled": 0}
        for (basis, model), take in self.takes.items():
            figures["slots_total"] += take["slots_total"]
            figures["slots_missing"] += take["slots_missing"]
            frames = take["account"].parent / "cam0.frames.jsonl"
            figures["frames_mislabelled"] += checks.mislabelled(take["account"], frames, basis)
        with self.clock("check the board's trace, twice"):
            trace = checks.trace(self.out, [sequence_file(basis) for basis in noisy])
        figures["trigger_period_error_ticks"] = trace["trigger_period_error_ticks"]
        figures["trace"] = trace
        with self.clock("verify archives, white furnace"):
            for basis, model in self.takes:
                run(BIN / "rf", "verify", self.path(basis, model))
            figures["white_furnace_error"] = run_json(BIN / "rf", "furnace", "--json")["white_furnace_error"]
        return figures


def text_report(report):
    lines = [f"{key:32} {value}" for key, value in report.items() if not isinstance(value, (dict, list))]
    for basis, figures in report["noise"].items():
        lines.append(f"noise of {basis}, relit mosaic: {figures['mosaic_psnr_db']} dB, the model predicts "
                     f"{figures['mosaic_psnr_predicted_db']} dB; {100 * figures['masked_fraction']:.2f} % masked")
    lines.append("seconds by step:")
    lines += [f"  {seconds:7.1f}  {step}" for step, seconds in report["seconds_by_step"].items()]
    return "\n".join(lines) + "\n"


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, default=Path("out/demo"), help="folder of the results; an older one is replaced")
    options = parser.parse_args()
    use_root()
    out = ROOT / options.out
    if out.exists() and not (out / "report.json").exists() and any(out.iterdir()):
        sys.exit(f"demo: {out} is there and is no older demo: choose another folder with --out")
    shutil.rmtree(out, ignore_errors=True)
    out.mkdir(parents=True)
    (out / "report.json").write_text("{}\n")

    demo = Demo(out)
    report = {}
    # What is worth looking at first comes first; minutes are those of two cores that nobody else uses.
    chapters = Chapters([
        ("the still head, recorded in s159 and relit", 1, demo.first_picture, "demo.jpg, relit_*.png, contact-sheet.png"),
        ("the still head in other bases", 2, demo.record_bases, None),
        ("is every label, edge and archive right?", 1, lambda: report.update(demo.check()), None),
        ("the bases against the truth", 2, lambda: report.update(demo.compare()), "bases.png"),
        ("noise against its model", 1, lambda: report.update(noise=demo.predict_noise()), None),
        ("the moving head, with and without compensation, every frame rendered", 3, lambda: report.update(demo.move()),
         "moving.gif, moving.jpg; for motion blur moving/blurred_*.png"),
    ], options.out)
    chapters.play()
    report["seconds"] = round(demo.clock.total(), 1)
    report["seconds_by_step"] = demo.clock.steps
    (out / "report.json").write_text(json.dumps(report, indent=1) + "\n")
    (out / "report.txt").write_text(text_report(report))
    print(text_report(report))


if __name__ == "__main__":
    main()
