# SPDX-License-Identifier: MIT
"""docs/accuracy.md: made of the registry of knobs and of what `make bench` measured, by nothing else."""
import math

import pareto

HEAD = """# What accuracy costs

Every approximation has a knob. For each setting: its error against truth, its time beside a named peer's in the same run, its memory. This
page, its tables and its pictures are written by `make bench`, which also leaves the figures in `out/bench/<subject>.json`
(`make bench SUBJECT=inversion` measures one subject, and leaves the others as they are).

- **error** is against a truth that the measured code did not make; each subject says which. 0 is exact.
- **time** is the median over the rounds. All settings of a knob run in every round, so that a disturbance of the machine meets all of them.
  With one thread it is processor time, with more the clock's.
- **speed** is the peer's time over the setting's own, the median over the rounds: above 1 is faster than the peer.
- **memory** is what a run makes resident at its peak beyond its inputs and outputs.
- **Bold** is the default; a ● marks the Pareto front: no other setting of the knob is as accurate and faster, or more accurate and no slower (times
  within 3 % count as equal).

In the pictures both axes are logarithmic, and exact results stand on the bottom line. Times of subjects that were measured on different
machines are not to be compared.
"""
COLUMNS = "| knob | setting | | error | time, ms | speed | threads | memory, MB |\n| --- | --- | --- | --- | --- | --- | --- | --- |\n"


def significant(value, digits):
    """A number without exponent as long as it has at most six digits before the point: 0.0251, 12.3, 173, 1.2e-07."""
    if value == 0:
        return "0"
    text = f"{value:.{digits}g}"
    return f"{value:.0f}" if "e+" in text and abs(value) < 1e6 else text


def rows_of(knob, rows):
    return [row for row in rows if row["knob"] == knob["knob"]]


PSNR_UNIT = "% of peak rms"


def psnr_db(percent_of_peak):
    """NaN of an exact result and of one that is not finite."""
    return -20 * math.log10(percent_of_peak / 100) if percent_of_peak else math.nan


def figure_text(row):
    """A figure for a table of many knobs: without its unit, an rms error in percent of a peak as PSNR."""
    if row["error"] is None:
        return "not finite"
    if row["error_unit"] == PSNR_UNIT:
        return f"{psnr_db(row['error']):.1f}" if row["error"] > 0 else "exact"
    return significant(row["error"], 3)


def tables_of(knobs):
    """{title: knobs} of the tables that hold many knobs, in the order of their first ones."""
    tables = {}
    for knob in knobs:
        if knob["table"]:
            tables.setdefault(knob["table"], []).append(knob)
    return tables


def table(title, knobs, rows):
    """A line a knob, a column a setting."""
    default, settings = knobs[0]["default"], knobs[0]["settings"]
    head = [f"**{setting}**" if setting == default else setting for setting in settings]
    note = knobs[0]["table_note"]
    text = (f"\n{note}\n" if note else "") + f"\n| {title} | " + " | ".join(head) + " |\n| --- |" + " --- |" * len(head) + "\n"
    for knob in knobs:
        by_setting = {row["setting"]: row for row in rows_of(knob, rows)}
        text += f"| {knob['knob']} | " + " | ".join(figure_text(by_setting[setting]) for setting in settings) + " |\n"
    return text


def table_line(row, is_first, on_front):
    name = f"**{row['setting']}**" if row["default"] else row["setting"]
    error = "not finite" if row["error"] is None else "0" if row["error"] == 0 else f"{significant(row['error'], 2)} {row['error_unit']}"
    memory = "not known" if row["bytes"] is None else significant(row["bytes"] / 1e6, 2)
    cells = [row["knob"] if is_first else "", name, "●" if on_front else "", error, significant(row["ms_median"], 3),
             significant(row["ratio_to_peer"], 3), str(row["threads"]), memory]
    return "| " + " | ".join(cells) + " |\n"


def default_on_front(knob, rows):
    return any(row["default"] for row in pareto.front(rows_of(knob, rows)))


def knob_sentence(knob, rows):
    """Where the knob is set, its peer, and how the default stands."""
    peer = next(row for row in rows_of(knob, rows) if row["setting"] == knob["peer"])
    detail = f" ({peer['detail']})" if peer["detail"] else ""
    text = f"- `{knob['knob']}` is set by {knob['set_by']}; its peer is {knob['peer']}{detail}. The default, {knob['default']}, is "
    if default_on_front(knob, rows):
        return text + "on the Pareto front.\n"
    return text + f"not on the Pareto front: {knob['why_off_front']}\n"


def unexplained(subject, knobs, rows):
    """Knobs whose default is off the front, without a reason in the registry."""
    return [f"{subject['subject']}, {knob['knob']}: the default '{knob['default']}' is not on the Pareto front, and why_off_front is empty"
            for knob in knobs if not knob["table"] and not default_on_front(knob, rows) and not knob["why_off_front"]]


def head_of(subject):
    return f"\n## {subject['subject'].capitalize()}\n"


def section(subject, knobs, result):
    """result: {"machine", "rows"} as `make bench` keeps it."""
    rows = result["rows"]
    rounds = " or ".join(map(str, sorted({row["rounds"] for row in rows})))
    name = subject["subject"]
    text = f"{head_of(subject)}\n{subject['truth']}\n\n{subject['advice']}\n\n"
    text += f"![{name.capitalize()}: error over time](images/accuracy_{name}.png)\n\n"
    alone = [knob for knob in knobs if not knob["table"]]
    text += COLUMNS if alone else ""
    for knob in alone:
        own = rows_of(knob, rows)
        on_front = [row["setting"] for row in pareto.front(own)]
        text += "".join(table_line(row, i == 0, row["setting"] in on_front) for i, row in enumerate(own))
    text += "\n" + "".join(knob_sentence(knob, rows) for knob in alone)
    text += f"- Measured on {result['machine']}, {rounds} rounds.\n"
    return text + "".join(table(title, of_table, rows) for title, of_table in tables_of(knobs).items())


def sections_of(text):
    """{subject's name: its section} of a page, in its order."""
    return {part.partition("\n")[0].lower(): "\n## " + part for part in text.split("\n## ")[1:]}


def page(text, registry, results):
    """The page with a section for each subject of the registry, [(subject, knobs)] as programs list them: made of `results`, by subject
    name, or as it stands in `text`, the page so far."""
    kept = sections_of(text)
    parts = [section(subject, knobs, results[subject["subject"]]) if subject["subject"] in results else kept.get(subject["subject"], "")
             for subject, knobs in registry]
    return HEAD + "".join(part.rstrip("\n") + "\n" for part in parts if part)


def missing(registry, text):
    """Knobs and defaults of the registry that the page does not name."""
    problems = []
    for subject, knobs in registry:
        part = sections_of(text).get(subject["subject"], "")
        for knob in knobs:
            if f"\n| {knob['knob']} | " not in part:
                problems.append(f"docs/accuracy.md does not have the knob '{knob['knob']}' of {subject['subject']}: run `make bench`")
            elif not knob["differs_by_machine"] and f" **{knob['default']}** |" not in part:
                problems.append(f"docs/accuracy.md has another default than '{knob['default']}' for {knob['knob']}: run `make bench`")
    return problems
