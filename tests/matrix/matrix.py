# SPDX-License-Identifier: MIT
"""The fault matrix: plays scenarios (scenarios/*.toml) over camera links with fault_matrix, and holds what the recorder's account says
of each trigger against what was done to it (verdicts.py).

usage: matrix.py [--page docs/faults.md] [SCENARIO...]
Prints the table of all takes; the exit code is 1 if one trigger's account is wrong. --page puts it into the page's section `matrix`.
"""
import argparse
import collections
import json
import pathlib
import subprocess
import sys
import tempfile
import tomllib

from verdicts import DONE, Verdicts

HERE = pathlib.Path(__file__).resolve().parent
ROOT = HERE.parents[1]
PROGRAM = ROOT / "build/host/bin/fault_matrix"
SCENARIOS = HERE / "scenarios"
LINKS = {"ring": "ring", "gige": "GigE Vision", "v4l2": "V4L2"}
HANG_S = 300  # not a measure of speed


def scenarios():
    return sorted(SCENARIOS.glob("*.toml"))


def links_of(path):
    return tomllib.loads(path.read_text())["links"]


def play(path, link):
    """The verdicts of a scenario's takes over a link."""
    with tempfile.TemporaryDirectory(prefix="matrix") as work:
        done = subprocess.run([PROGRAM, path, link, work], capture_output=True, text=True, timeout=HANG_S)
    if done.returncode != 0:
        raise RuntimeError(f"{path} over {link}: {done.stderr}")
    return [Verdicts(json.loads(line), link) for line in done.stdout.splitlines()]


class Matrix:
    """Sums over takes, by what was done and by link."""

    def __init__(self):
        self.cells = collections.defaultdict(collections.Counter)  # (done, link): injected, right, exception, wrong
        self.exceptions = collections.Counter()  # (done, link, reason)
        self.triggers = self.takes = 0

    def add(self, link, verdicts):
        self.takes += 1
        self.triggers += verdicts.triggers
        for done, counts in verdicts.tally.items():
            self.cells[done, link] += counts
        for (done, reason), count in verdicts.exceptions.items():
            self.exceptions[done, link, reason] += count

    def table(self):
        lines = ["| what was done to the trigger | the account must say | " + " | ".join(LINKS.values()) + " |",
                 "| --- | --- |" + " ---: |" * len(LINKS)]
        for done, (words, cause) in DONE.items():
            cells = [self._cell(done, link) for link in LINKS]
            if any(cell != "-" for cell in cells):
                lines.append(f"| {words} | {cause or 'its frame'} | " + " | ".join(cells) + " |")
        wrong = sum(counts["wrong"] for counts in self.cells.values())
        lines += ["", f"{self.takes} takes, {self.triggers} triggers; accounts that are wrong: {wrong}. A cell: injected / named right / by an "
                      "exception of the list below. Exceptions, and frames that nothing was done to and that are missing:", ""]
        for (done, link, reason), count in sorted(self.exceptions.items(), key=lambda item: (item[0][2], item[0])):
            lines.append(f"- {reason}: {count} ({DONE[done][0]}, {LINKS[link]})")
        return "\n".join(lines) + "\n"

    def _cell(self, done, link):
        counts = self.cells.get((done, link))
        if not counts or not counts["injected"]:
            return "-"
        wrong = f", **{counts['wrong']} wrong**" if counts["wrong"] else ""
        return f"{counts['injected']} / {counts['right']} / {counts['exception']}{wrong}"


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--page", help="page whose section `matrix` gets the table, docs/faults.md")
    parser.add_argument("scenarios", nargs="*", type=pathlib.Path)
    options = parser.parse_args()
    matrix, wrong = Matrix(), []
    for path in options.scenarios or scenarios():
        for link in links_of(path):
            for verdicts in play(path, link):
                matrix.add(link, verdicts)
                wrong += [f"{path.stem} over {link}, {line}" for line in verdicts.wrong]
    print(matrix.table())
    for line in wrong[:50]:
        print(f"WRONG {line}")
    if options.page:
        sys.path.append(str(ROOT / "tests/bench"))
        import marked_section

        marked_section.replace(options.page, "matrix", matrix.table())
    return bool(wrong)


if __name__ == "__main__":
    sys.exit(main())
