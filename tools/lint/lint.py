#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""House rules that a program can check: formatting, licence tags, file length, include directions, unfinished words, clang-tidy.

    lint.py          formatting, tags, lengths, includes (seconds)
    lint.py --tidy   clang-tidy too, over every C++ file of the build (minutes)
"""
import argparse
import json
import re
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
LONGEST_FILE = 500
SOURCE = (".c", ".h", ".cpp", ".hpp", ".py", ".mjs", ".js", ".sh", ".pio", ".S")

# Which rooms of host/ a room may include: what is upstream of it, and nothing beside or below (docs/architecture.md).
UPSTREAM = {
    "image": set(),
    "stage": {"image"},
    "archive": {"image", "stage"},
    "photographs": {"image", "stage", "archive"},
    "device": {"image", "stage"},
    "doctor": {"image", "stage", "device"},
    "record": {"image", "stage", "device"},
    "recordings": {"image", "stage", "record", "photographs"},
    "flow": {"image"},
    "demultiplex": {"stage"},
    "develop": {"image", "stage", "flow", "demultiplex"},
    "take": {"image", "stage", "device", "record", "develop", "archive"},
    "relight": {"image", "stage"},
    "daemon": {"image", "stage", "archive", "device", "record", "take", "relight"},
    "ingest": {"image", "stage", "photographs", "record", "recordings", "take", "stagectl"},
    "stagectl": {"image", "stage", "archive", "device", "doctor", "record", "develop", "take", "daemon"},
}
# Which rooms of host/ a program of tools/ may include.
TOOLS_MAY_INCLUDE = {"rf": {"image", "stage", "archive", "relight"}, "stagesim": {"image", "stage", "flow", "relight"}}
# The virtual stage feeds the ring that the daemon reads; that one header of device/ is its output.
EXTRA = {("stagesim", "device/ring.hpp")}
# The same for the rooms of the virtual stage; its verbs, beside them, see all.
STAGESIM_UPSTREAM = {"scene": set(), "render": {"scene"}, "run": {"scene", "render"}}
UNFINISHED = re.compile(r"\b(TODO|FIXME|XXX|HACK)\b")


def tracked():
    listing = subprocess.run(["git", "ls-files", "-co", "--exclude-standard"], cwd=ROOT, capture_output=True, text=True, check=True)
    return [ROOT / name for name in listing.stdout.split("\n") if name and (ROOT / name).is_file()]


def check_text(path, problems):
    name = path.relative_to(ROOT)
    lines = path.read_text(encoding="utf-8").split("\n")
    if not any("SPDX-License-Identifier: MIT" in line for line in lines[:3]):
        problems.append(f"{name}:1: no `SPDX-License-Identifier: MIT` in the first three lines")
    if len(lines) > LONGEST_FILE + 1:
        problems.append(f"{name}: {len(lines) - 1} lines; split it by {LONGEST_FILE}")
    if name != Path("tools/lint/lint.py"):
        for number, line in enumerate(lines, 1):
            if UNFINISHED.search(line):
                problems.append(f"{name}:{number}: unfinished: {line.strip()}")


def check_includes(path, problems):
    name = path.relative_to(ROOT)
    parts = name.parts
    if parts[0] == "host" and len(parts) >= 3:
        if parts[1] not in UPSTREAM:
            problems.append(f"{name}: host/{parts[1]} is no room that tools/lint/lint.py knows")
            return
        here, allowed, rooms = parts[1], UPSTREAM[parts[1]] | {parts[1]}, UPSTREAM
    elif parts[0] == "tools" and len(parts) >= 3 and parts[1] in TOOLS_MAY_INCLUDE:
        here, allowed, rooms = parts[1], TOOLS_MAY_INCLUDE[parts[1]], dict(UPSTREAM)
        if here == "stagesim" and parts[2] in STAGESIM_UPSTREAM:
            allowed = allowed | STAGESIM_UPSTREAM[parts[2]] | {parts[2]}
            rooms |= STAGESIM_UPSTREAM
    else:
        return
    for number, line in enumerate(path.read_text(encoding="utf-8").split("\n"), 1):
        match = re.match(r'\s*#include\s+"([a-z]+)/([a-z0-9_/]+\.hpp)"', line)
        if match and match[1] in rooms and match[1] not in allowed and (here, f"{match[1]}/{match[2]}") not in EXTRA:
            where = "/".join(parts[1:-1]) if parts[0] == "tools" else here
            problems.append(f"{name}:{number}: {where} includes {match[1]}, which is not upstream of it")


def check_format(paths, problems):
    run = subprocess.run(["clang-format", "--dry-run", "-Werror", *map(str, paths)], cwd=ROOT, capture_output=True, text=True)
    problems += [line.replace(str(ROOT) + "/", "") for line in run.stderr.split("\n") if "error:" in line]


def check_tidy(problems):
    database = ROOT / "build/host/compile_commands.json"
    if not database.exists():
        sys.exit("lint: no build/host/compile_commands.json; run `make host` first")
    files = sorted({entry["file"] for entry in json.loads(database.read_text())})

    def tidy(file):
        run = subprocess.run(["clang-tidy", "-p", str(database.parent), "--quiet", file], cwd=ROOT, capture_output=True, text=True)
        return [line.replace(str(ROOT) + "/", "") for line in run.stdout.split("\n") if " error: " in line or " warning: " in line]

    with ThreadPoolExecutor(2) as pool:
        for done, found in enumerate(pool.map(tidy, files), 1):
            problems += found
            if sys.stderr.isatty():
                print(f"\rclang-tidy {done}/{len(files)}", end="", file=sys.stderr)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--tidy", action="store_true")
    options = parser.parse_args()
    problems = []
    sources = [path for path in tracked() if path.suffix in SOURCE]
    for path in sources:
        check_text(path, problems)
        check_includes(path, problems)
    check_format([path for path in sources if path.suffix in (".c", ".h", ".cpp", ".hpp")], problems)
    if options.tidy:
        check_tidy(problems)
    for problem in sorted(set(problems)):
        print(problem)
    print(f"lint: {len(sources)} files, {len(set(problems))} problems")
    sys.exit(1 if problems else 0)


if __name__ == "__main__":
    main()
