#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""The demo: the whole system once, end to end. The firmware image plays lamps on the emulated board, the virtual stage renders
what they light, the daemon records, the tools relight; then the pictures are compared with the truth.

    .venv/bin/python tools/demo/demo.py --out out/demo
"""
import argparse
import json
import shutil
from pathlib import Path

import noise
import numpy as np
from session import BIN, ROOT, Clock, VirtualStage, run, run_json, use_root

STAGE = "examples/stage.toml"
HEAD = "tools/stagesim/scenes/head.toml"
CARD = "tools/stagesim/scenes/card.toml"
CARD_REFLECTANCE = 0.985
ENVIRONMENTS = ["courtyard", "sunset", "studio"]  # of .cache/assets/env
TRUTH_ENVIRONMENT = "sunset"
BASES = ["single", "hadamard156"]  # those whose pictures are compared; s159 is the take that is shown
SHOWN = "s159"
MODELS = {"noisy": "on", "clean": "off"}  # the camera model


def environment(name):
    return ROOT / f".cache/assets/env/{name}.exr"


class Demo:
    def __init__(self, out):
        self.out = out
        self.clock = Clock()
        self.reports = {}

    def take(self, basis, model):
        return self.out / (f"{basis}.rfa" if model == "noisy" else f"{basis}_{model}.rfa")

    def record(self):
        """Calibrates on the white card and records the head, with the camera model on and off."""
        for model, switch in MODELS.items():
            options = ["--camera-model", switch]
            with self.clock(f"calibrate on the white card ({model})"):
                with VirtualStage(CARD, STAGE, self.out / f"stage/card_{model}", *options) as stage:
                    run(BIN / "stagectl", "calibrate", "--stage", STAGE, *stage.devices(), "--card", CARD_REFLECTANCE,
                        "-o", self.out / f"calibration_{model}")
            bases = [SHOWN, *BASES] if model == "noisy" else BASES
            vcd = ["--vcd", self.out / "board.vcd"] if model == "noisy" else []
            with VirtualStage(HEAD, STAGE, self.out / f"stage/head_{model}", *options, *vcd) as stage:
                for basis in bases:
                    with self.clock(f"record the head, basis {basis} ({model})"):
                        self.reports[basis, model] = run_json(
                            BIN / "stagectl", "run", "--sequence", f"examples/sequence_{basis}.toml", "--stage", STAGE,
                            *stage.devices(), "--calibration", self.out / f"calibration_{model}",
                            "--production", "demo", "--scene", "head", "--take", basis, "-o", self.take(basis, model), "--json")

    def pictures(self):
        take = self.take(SHOWN, "noisy")
        with self.clock("contact sheet"):
            run(BIN / "rf", "export", take, "--contact-sheet", self.out / "contact-sheet.png")
        with self.clock("relight under three environments"):
            for name in ENVIRONMENTS:
                run(BIN / "rf", "relight", take, "--env", environment(name), "-o", self.out / f"relit_{name}.exr",
                    "--png", self.out / f"relit_{name}.png")

    def compare(self):
        """Relit takes against stagesim's own rendering of the same environment."""
        figures = {}
        light = ["--env", environment(TRUTH_ENVIRONMENT)]
        with self.clock("render the truth"):
            truth = self.out / "truth.exr"
            run(BIN / "stagesim", "render", HEAD, "--stage", STAGE, *light, "--calibration", self.out / "calibration_clean",
                "-o", truth)
        with self.clock("compare with the truth"):
            for basis in BASES:
                for model in MODELS:
                    relit = self.out / f"compare/{basis}_{model}.exr"
                    relit.parent.mkdir(exist_ok=True)
                    run(BIN / "rf", "relight", self.take(basis, model), *light, "--float", "-o", relit)
                    result = run_json(BIN / "rf", "compare", relit, truth, "--json")
                    name = basis.removesuffix("156")
                    figures[f"psnr_{name}{'_noisy' if model == 'noisy' else ''}_db"] = result["psnr_db"]
        return figures
