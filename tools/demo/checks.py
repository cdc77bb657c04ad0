# SPDX-License-Identifier: MIT
"""What the demo holds against the truth: labels of frames, lit lamps, and every edge of the board."""
import json
import subprocess
import sys
from pathlib import Path

import numpy as np
from session import BIN, ROOT, run_json

KINDS = {"basis": 0, "tracking": 1, "matte": 2, "dark": 3}  # protocol/wire.h, ols_slot_kind


def read_lines(path):
    return [json.loads(line) for line in Path(path).read_text().splitlines()]


def compiled(sequence_file):
    return run_json(BIN / "stagectl", "sequence", sequence_file, "--json")


def labels_and_truth(account, frames):
    """Pairs of what the daemon says of a frame and what the virtual camera knows of it; an unknown frame has None."""
    truth = {(line["frame_id"], line["timestamp_ns"]): line for line in read_lines(frames)}
    return [(label, truth.get((label["frame_id"], label["timestamp_ns"]))) for label in read_lines(account)]


def mislabelled(account, frames, basis):
    """Frames whose slot is not that of the trigger that made them, or whose lit lamps are not that slot's."""
    slots = compiled(f"examples/sequence_{basis}.toml")["slots"]
    pairs = labels_and_truth(account, frames)
    # The take's first trigger is the first one that the stage saw after the takes before it.
    first = min(truth["trigger"] for _, truth in pairs if truth)
    wrong = 0
    for label, truth in pairs:
        right = truth and divmod(truth["trigger"] - first, len(slots)) == (label["cycle"], label["slot"])
        wrong += not (right and truth["lit"] == slots[label["slot"]]["lit"])
    return wrong


def lit_rows(account, frames, basis):
    """The 0/1 matrix of the lamps that the board really lit, a row for each basis slot of cycle 0, sphere lamps only."""
    slots = compiled(f"examples/sequence_{basis}.toml")["slots"]
    rows = []
    for label, truth in labels_and_truth(account, frames):
        if label["cycle"] == 0 and slots[label["slot"]]["kind"] == "basis":
            rows.append(np.isin(np.arange(156), truth["lit"]))
    return np.array(rows)


def trace(out, sequence_files):
    """Every edge of the board's trace against the programs it played, by our own reading and by sigrok-cli."""
    programs = []
    for number, sequence_file in enumerate(sequence_files):
        sequence = compiled(sequence_file)
        slots = [{"kind": KINDS[slot["kind"]], "trigger_mask": slot["trigger_mask"],
                  "exposure_ticks": slot["exposure_ticks"], "period_ticks": slot["period_ticks"],
                  "bits": [int(bit in slot["lit"]) for bit in range(176)]} for slot in sequence["slots"]]
        programs.append(out / f"compare/program_{number}.json")
        programs[-1].parent.mkdir(exist_ok=True)
        programs[-1].write_text(json.dumps({"cycles": sequence["cycles"], "slots": slots}))
    command = [sys.executable, ROOT / "tests/hil/check_trace.py", out / "board.vcd", *programs]
    done = subprocess.run([str(part) for part in command], capture_output=True, text=True)
    if not done.stdout:
        sys.exit(f"demo: the trace could not be checked:\n{done.stderr}")
    return json.loads(done.stdout)
