#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Runs the hard cases and makes docs/stability.md of what they record.

    table.py            run them, and write the page
    table.py --check    run them; the page must have a row for each case that was recorded, and each file a case
"""
import argparse
import json
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "docs/stability.md"
HEAD = """# Hard cases

Inputs on which a competent first version fails, often in silence: what it gives, what this project gives, and the bound that the project's
result must keep. Each bound is derived in a comment of its test, not tuned. `make stability` runs the cases; this page is written by
`python3 tests/stability/table.py`.

| case | naive gives | ours gives | bound | test |
| --- | --- | --- | --- | --- |
"""


def case_files():
    return sorted(Path(__file__).parent.glob("*.cpp"))


def rows_of_report(report, file):
    """The rows that one program recorded, from GoogleTest's JSON report."""
    tests = [test for suite in report["testsuites"] for test in suite["testsuite"]]
    return [{**{key: test[key] for key in ("case", "naive", "ours", "bound")}, "file": file} for test in tests if "case" in test]


def run_cases(programs):
    """Rows of all files, in the order of the files; the names of programs that failed."""
    rows, failed = [], []
    with tempfile.TemporaryDirectory() as folder:
        report = Path(folder) / "report.json"
        for file in case_files():
            program = programs / f"stability_{file.stem}"
            run = subprocess.run([program, f"--gtest_output=json:{report}"], cwd=ROOT, capture_output=True, text=True)
            print(f"{'FAILED' if run.returncode else 'passed'} {program.name}", flush=True)
            if run.returncode:
                print(run.stdout + run.stderr)
                failed.append(program.name)
            else:
                rows += rows_of_report(json.loads(report.read_text()), file.name)
    return rows, failed


def cell(text):
    return "| " + text.replace("|", "\\|") + " "


def link(file):
    return f"| [{file}](../tests/stability/{file}) |"


def table_line(row):
    return "".join(cell(row[key]) for key in ("case", "naive", "ours", "bound")) + link(row["file"]) + "\n"


def page(rows):
    return HEAD + "".join(table_line(row) for row in rows)


def missing_rows(rows, files, text):
    """What keeps `text` from being the page of `rows`, the cases of `files`; figures may differ between machines."""
    problems = [f"tests/stability/{file} records no case" for file in files if file not in {row["file"] for row in rows}]
    for row in rows:
        if not any(line.startswith(cell(row["case"])) and line.endswith(link(row["file"])) for line in text.split("\n")):
            problems.append(f"docs/stability.md has no row for '{row['case']}' of {row['file']}: run tests/stability/table.py")
    return problems


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--check", action="store_true", help="write nothing")
    parser.add_argument("--programs", type=Path, default=ROOT / "build/checked/bin", help="where stability_* are")
    options = parser.parse_args()
    rows, failed = run_cases(options.programs)
    if failed:
        sys.exit("failed: " + ", ".join(failed))
    if not options.check:
        PAGE.write_text(page(rows))
    problems = missing_rows(rows, [file.name for file in case_files()], PAGE.read_text())
    for problem in problems:
        print(problem)
    sys.exit(1 if problems else 0)


if __name__ == "__main__":
    main()
