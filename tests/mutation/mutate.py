#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Mutation test: changes the firmware's deciding files in one place at a time and sees whether the unit tests notice.

usage: mutate.py [--files FILE ...] [--only N ...] [--jobs 2] [--list]

A mutant is one token changed (a comparison, an operator, a constant, a truth value) or one statement left out. It is
noticed when the tests fail, crash, or take five times as long as usual; a mutant that does not compile is not counted.
Survivors are printed with their place and kept in build/mutation/survivors.txt. tests/mutation/equivalent.txt names
those that change nothing that could be seen, each with its reason; they are left out of the share. Exits with 1 when
there are others.
"""
import argparse
import concurrent.futures
import os
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile
import time

ROOT = pathlib.Path(__file__).resolve().parents[2]
BUILD = ROOT / "build/mutation"
EQUIVALENT = ROOT / "tests/mutation/equivalent.txt"
MUTATED = ["firmware/sequence.c", "protocol/frame.c", "firmware/fault.c", "firmware/healthy.c", "firmware/programs.c", "firmware/program_check.c", "firmware/edges.c"]
TESTS = ["frame", "fault", "program_check", "programs", "edges", "wire", "link", "stops", "healthy", "schedule", "trigger_log", "sequence_limits", "grey", "events", "sequence"]  # quick first
COMPILE = ["-O1", "-g0", "-fsanitize=address,undefined", "-fno-sanitize-recover=all", "-I.", "-Iprotocol", "-Ifirmware", "-Ihost", "-Itools", "-Itests/unit", f"-I{BUILD}"]

TOKEN = re.compile(r"""(?P<skip>//[^\n]*|/\*.*?\*/|^[ \t]*\#[^\n]*|_Static_assert[^;]*;|"(?:\\.|[^"\\])*"|'(?:\\.|[^'\\])*')
    |(?P<number>\b(?:0x[0-9a-fA-F]+|\d+)(?:[uU]?[lL]*)\b)|(?P<word>[A-Za-z_]\w*)
    |(?P<operator><<=|>>=|->|\+\+|--|<<|>>|<=|>=|==|!=|&&|\|\||[-+*/%&|^]=|[-+*/%&|^~!<>=?:])|(?P<other>\S)""",
                   re.VERBOSE | re.MULTILINE | re.DOTALL)
OPERATORS = {"<": ["<=", ">"], "<=": ["<", ">="], ">": [">=", "<"], ">=": [">", "<="], "==": ["!="], "!=": ["=="],
             "&&": ["||"], "||": ["&&"], "+": ["-"], "-": ["+"], "*": ["/"], "/": ["*"], "%": ["/"], "<<": [">>"],
             ">>": ["<<"], "&": ["|"], "|": ["&"], "^": ["|"], "+=": ["-=", "="], "-=": ["+=", "="], "|=": ["&="],
             "&=": ["|="], "^=": ["|="], "++": ["--"], "--": ["++"], "!": [""], "~": [""]}
WORDS = {"true": "false", "false": "true", "break": "", "continue": ""}
# A whole simple statement on a line: a call, an assignment, a step; not a declaration.
STATEMENT = re.compile(r"^[ \t]+(?:if \([^;{}]*\) )?((?:\*?[a-z_][\w.\->\[\]()*& %]*\s*(?:[-+|&^*/]|<<|>>)?= |[a-z_]\w*\()"
                       r"[^;{}]*;|[\w.\->\[\]]+(?:\+\+|--);)[ \t]*$", re.MULTILINE)


def mutants_of(path):
    """(offset, end, replacement) of every mutant of a file, in order."""
    text = (ROOT / path).read_text()
    found = []
    before = ""
    for token in TOKEN.finditer(text):
        kind, value = token.lastgroup, token.group()
        if kind == "skip":
            continue
        if kind == "number":
            digits = value.rstrip("uUlL")
            found.append((*token.span(), f"({int(digits, 0) + 1}{value[len(digits):]})"))
        elif kind == "word" and value in WORDS:
            found.append((*token.span(), WORDS[value]))
        elif kind == "operator":
            unary = before in ("", "(", ",", "=", "return", "?", ":", "{", ";", "&&", "||", "!", "<", ">", "==") or \
                before.endswith("=") or before in OPERATORS
            pointer = value in ("*", "&") and (unary or re.match(r"[a-z_]\w*[ ,)]", text[token.end():]) is None and
                                               text[token.end()] in " )" and before in ("char", "uint8_t", "void"))
            declared = value == "*" and text[token.end()] == " " and text[token.start() - 1] != " "
            if not (pointer or declared or (unary and value in ("-", "+"))):
                found += [(*token.span(), other) for other in OPERATORS.get(value, [])]
        before = value
    for statement in STATEMENT.finditer(text):
        if not statement.group(1).startswith(("return", "const ", "static ", "struct ", "uint", "int", "bool ", "size_t")):
            found.append((*statement.span(1), ";"))
    return text, sorted(found)


def name_of(path, text, mutant):
    begin, end, replacement = mutant
    line = text[:begin].count("\n") + 1
    before = text[text.rfind("\n", 0, begin) + 1 : text.find("\n", begin)].strip()
    column = begin - text.rfind("\n", 0, begin) - 1
    return f"{path}:{line}:{column}", f"{text[begin:end]!r} -> {replacement!r}", before


def run(command, **options):
    return subprocess.run(list(map(str, command)), cwd=ROOT, capture_output=True, text=True, **options)


def must(command):
    done = run(command)
    if done.returncode != 0:
        raise SystemExit(f"{' '.join(map(str, command))}\n{done.stdout}{done.stderr}")


def sources():
    """The C files of the host's board: the portable firmware and the protocol."""
    listed = re.search(r"add_library\(ols_firmware STATIC (.*?) \$", (ROOT / "firmware/CMakeLists.txt").read_text(), re.S)
    protocol = re.search(r"add_library\(ols_protocol STATIC (.*?)\)", (ROOT / "protocol/CMakeLists.txt").read_text(), re.S)
    return [f"firmware/{name}" for name in listed.group(1).split()] + \
        [f"protocol/{name}" for name in protocol.group(1).split() if name.endswith(".c")]


def object_of(path):
    return BUILD / (path.replace("/", "_") + ".o")


def build():
    """Objects of all C files and of the tests, as they are."""
    shutil.rmtree(BUILD, ignore_errors=True)
    BUILD.mkdir(parents=True)
    (BUILD / "pulse.h").write_text(run([sys.executable, "firmware/tools/pioasm.py", "firmware/pulse.pio"], check=True).stdout)
    (BUILD / "board_pins.h").write_text(run([sys.executable, "firmware/tools/board_pins.py", "header",
                                             "firmware/boards/pico.toml"], check=True).stdout)
    (BUILD / "layout_hash.h").write_text(run([sys.executable, "protocol/layout_hash.py", "protocol/wire.h"], check=True).stdout)
    for path in sources():
        must(["gcc", "-std=c11", *COMPILE, "-c", path, "-o", object_of(path)])
    with concurrent.futures.ThreadPoolExecutor(os.cpu_count()) as pool:
        list(pool.map(lambda test: must(["g++", "-std=c++20", *COMPILE, "-c", f"tests/unit/test_{test}.cpp", "-o",
                                         BUILD / f"test_{test}.o"]), TESTS))


def link_and_run(objects, folder, seconds_max):
    """Seconds by test when all pass, else None. `seconds_max` by test. A library, so that a test may stand in for a part
    of it."""
    library, seconds = folder / "libmutant.a", {}
    must(["ar", "rcs", library, *objects])
    for test in TESTS:
        program = folder / test
        must(["g++", "-fsanitize=address,undefined", BUILD / f"test_{test}.o", library, "-lgtest", "-lgtest_main", "-o", program])
        begin = time.monotonic()
        try:
            if run([program, "--gtest_fail_fast", "--gtest_brief=1"], timeout=seconds_max[test]).returncode != 0:
                return None
        except subprocess.TimeoutExpired:
            return None
        seconds[test] = time.monotonic() - begin
    return seconds


def verdict(path, text, mutant, seconds_max):
    """'noticed', 'survived', or 'invalid' when it does not compile or is the same code."""
    begin, end, replacement = mutant
    with tempfile.TemporaryDirectory(dir=BUILD) as name:
        folder = pathlib.Path(name)
        changed, made = folder / pathlib.Path(path).name, folder / "mutant.o"
        changed.write_text(text[:begin] + replacement + text[end:])
        include = f"-I{(ROOT / path).parent}"
        if run(["gcc", "-std=c11", *COMPILE, include, "-c", changed, "-o", made]).returncode != 0:
            return "invalid"
        if code_of(made) == code_of(object_of(path)):
            return "invalid"
        objects = [made if other == path else object_of(other) for other in sources()]
        return "survived" if link_and_run(objects, folder, seconds_max) else "noticed"


def code_of(path):
    return run(["objdump", "-d", "-s", "--no-addresses", path]).stdout.split("\n", 3)[3]


def equivalents():
    """File, line's text and change, between tabs, of each mutant known to change nothing."""
    lines = EQUIVALENT.read_text().splitlines() if EQUIVALENT.exists() else []
    return {tuple(part.strip() for part in line.split("\t")[:3]) for line in lines if line and not line.startswith("#")}


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--files", nargs="+", default=MUTATED)
    parser.add_argument("--only", nargs="+", type=int, help="numbers of --list")
    parser.add_argument("--jobs", type=int, default=os.cpu_count())
    parser.add_argument("--list", action="store_true", help="print the mutants and end")
    options = parser.parse_args()
    work = []
    for path in options.files:
        text, mutants = mutants_of(path)
        work += [(path, text, mutant) for mutant in mutants]
    if options.list:
        for n, item in enumerate(work):
            print(n, *name_of(*item), sep="  ")
        return
    chosen = options.only if options.only is not None else range(len(work))
    build()
    usual = link_and_run([object_of(path) for path in sources()], BUILD, dict.fromkeys(TESTS, 600))
    if usual is None:
        raise SystemExit("the tests fail without any mutant: mend that first")
    seconds_max = {test: 5 * seconds + 3 for test, seconds in usual.items()}
    known, counts, survivors = equivalents(), {"noticed": 0, "survived": 0, "invalid": 0, "equivalent": 0}, []
    with concurrent.futures.ThreadPoolExecutor(options.jobs) as pool:
        verdicts = pool.map(lambda n: verdict(*work[n], seconds_max), chosen)
        for n, found in zip(chosen, verdicts):
            place, change, line = name_of(*work[n])
            if found == "survived" and (work[n][0], line, change) in known:
                found = "equivalent"
            counts[found] += 1
            if found == "survived":
                survivors.append(f"{work[n][0]}\t{line}\t{change}")
                print(f"survived  {n}  {place}  {change}  in  {line}", flush=True)
            if sum(counts.values()) % 50 == 0:
                print(f"{sum(counts.values())} of {len(chosen)}", file=sys.stderr, flush=True)
    (BUILD / "survivors.txt").write_text("\n".join(survivors) + "\n")
    told = counts["noticed"] + counts["survived"]
    print(f"{counts['noticed']} of {told} mutants noticed ({100 * counts['noticed'] / max(told, 1):.1f} %), "
          f"{counts['equivalent']} known to be equivalent, {counts['invalid']} not programs or the same code")
    sys.exit(1 if survivors else 0)


if __name__ == "__main__":
    main()
