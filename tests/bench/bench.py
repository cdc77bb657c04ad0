#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Measures what accuracy costs: runs the benchmark programs, keeps their rows in out/bench/<subject>.json, and writes their sections of
docs/accuracy.md and their pictures.

    bench.py                        all subjects; `align` renders its scenes into out/bench/motion the first time, for minutes
    bench.py --subject inversion    one; the others' sections stay as they are
    bench.py --smoke                every program at tiny sizes; writes nothing
    bench.py --docs                 measures nothing; writes the sections of the rows there are
"""
import argparse
import json
import subprocess
import sys
from pathlib import Path

import page

ROOT = Path(__file__).resolve().parents[2]
PROGRAMS = ROOT / "build/host/bin"
RESULTS = ROOT / "out/bench"
ROW_KEYS = ("knob", "setting", "default", "peer", "error", "error_unit", "ms_median", "ratio_to_peer", "threads", "rounds", "bytes",
            "detail")


def subjects():
    """By the program sources, so that a program that was not built is noticed."""
    return sorted(path.stem.removeprefix("bench_") for path in Path(__file__).parent.glob("bench_*.cpp"))


def lines_of(subject, *options):
    program = PROGRAMS / f"bench_{subject}"
    if not program.exists():
        sys.exit(f"bench: {program.relative_to(ROOT)} is not built: run `make bench`")
    run = subprocess.run([program, *options], cwd=ROOT, stdout=subprocess.PIPE, text=True)
    if run.returncode:
        sys.exit(f"bench: {program.name} failed with status {run.returncode}")
    return [json.loads(line) for line in run.stdout.splitlines()]


def list_registry():
    """[(subject, knobs)] of all programs."""
    registry = []
    for name in subjects():
        head, *knobs = lines_of(name, "--list")
        if head["subject"] != name:
            sys.exit(f"bench: bench_{name}.cpp registers the subject '{head['subject']}': they must have one name")
        registry.append((head, knobs))
    return registry


def machine():
    model = next(line.partition(":")[2].strip() for line in Path("/proc/cpuinfo").read_text().splitlines() if line.startswith("model name"))
    return f"one machine with {len(set(Path('/sys/devices/system/cpu').glob('cpu[0-9]*')))} cores of {model}"


def measure(subject, rounds):
    rows = [{key: line[key] for key in ROW_KEYS} for line in lines_of(subject, "--rounds", str(rounds))]
    RESULTS.mkdir(parents=True, exist_ok=True)
    lines = ",\n".join(json.dumps(row) for row in rows)
    (RESULTS / f"{subject}.json").write_text(f'{{"machine": {json.dumps(machine())}, "rows": [\n{lines}\n]}}\n')


def write_docs(registry, subjects_to_write):
    """1 if a default is off the front without a reason."""
    import plot  # matplotlib takes a second to load

    results = {name: json.loads((RESULTS / f"{name}.json").read_text()) for name in subjects_to_write}
    path = ROOT / "docs/accuracy.md"
    path.write_text(page.page(path.read_text(), registry, results))
    problems = []
    for subject, knobs in registry:
        name = subject["subject"]
        if name in results:
            plot.draw(knobs, results[name]["rows"], ROOT / f"docs/images/accuracy_{name}.png")
            problems += page.unexplained(subject, knobs, results[name]["rows"])
    for problem in problems:
        print(f"bench: {problem}", file=sys.stderr)
    return 1 if problems else 0


def smoke():
    for subject, knobs in list_registry():
        rows = lines_of(subject["subject"], "--smoke")
        expected = [(knob["knob"], setting) for knob in knobs for setting in knob["settings"]]
        if [(row["knob"], row["setting"]) for row in rows] != expected:
            sys.exit(f"bench: bench_{subject['subject']} measured other settings than it lists")
    print("bench: every program runs")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--subject", choices=subjects())
    parser.add_argument("--rounds", type=int, default=15, metavar="N", help="times that each setting runs (default: %(default)s)")
    parser.add_argument("--smoke", action="store_true")
    parser.add_argument("--docs", action="store_true")
    options = parser.parse_args()
    if options.smoke:
        return smoke()
    registry = list_registry()
    asked = [subject["subject"] for subject, _ in registry if options.subject in (None, subject["subject"])]
    if options.docs:
        sys.exit(write_docs(registry, [name for name in asked if (RESULTS / f"{name}.json").exists()]))
    for name in asked:
        print(f"bench: {name}", flush=True)
        measure(name, options.rounds)
    problems = write_docs(registry, asked)
    sections = page.sections_of((ROOT / "docs/accuracy.md").read_text())
    print("".join(sections[name] for name in asked))
    sys.exit(problems)


if __name__ == "__main__":
    main()
