# SPDX-License-Identifier: MIT
"""The plot of docs/accuracy.md: a panel for each knob."""
import functools
import math

import matplotlib

matplotlib.use("Agg")
from matplotlib import pyplot  # noqa: E402
from matplotlib.ticker import LogLocator, NullFormatter  # noqa: E402

import page  # noqa: E402
import pareto  # noqa: E402

COLUMNS = 2
NEAR_X, NEAR_Y = 26, 12  # pixels
BLUE, GREY, RED = "#1f5fa8", "#666666", "#c0392b"


def floor_of(rows):
    """The bottom line: where exact results are drawn, a decade below the least error; else a little below it."""
    errors = [row["error"] for row in rows if row["error"]]
    if not errors:
        return 1.0
    return 10 ** (math.floor(math.log10(min(errors))) - 1) if len(errors) < len(rows) else min(errors) / 2


def clusters(pixels):
    """Numbers of points too near each other for a label each, the leftmost point first."""
    found = []
    for number in sorted(pixels, key=lambda number: pixels[number][0]):
        x, y = pixels[number]
        for cluster in found:
            if any(abs(x - pixels[other][0]) < NEAR_X and abs(y - pixels[other][1]) < NEAR_Y for other in cluster):
                cluster.append(number)
                break
        else:
            found.append([number])
    return found


def draw_panel(axes, title, rows):
    finite = [row for row in rows if row["error"] is not None]
    floor, front = floor_of(finite), pareto.front(finite)
    height = {row["setting"]: row["error"] or floor for row in finite}
    axes.step([row["ms_median"] for row in front], [height[row["setting"]] for row in front], where="post", color=BLUE, linewidth=1.2, zorder=1)
    for number, row in enumerate(rows, 1):
        label = f"{number}  {row['setting']}" + (" (not finite)" if row["error"] is None else "")
        if row["error"] is None:
            axes.plot([], [], " ", label=label)
            continue
        place = row["ms_median"], height[row["setting"]]
        axes.plot(*place, "s" if row["setting"] == row["peer"] else "o", markersize=6, color=BLUE if row in front else GREY, label=label, zorder=2)
        if row["default"]:
            axes.plot(*place, "o", markersize=15, markerfacecolor="none", markeredgecolor=RED, markeredgewidth=1.5, zorder=3)
    frame_panel(axes, title, finite, floor)
    places = {number: (row["ms_median"], height[row["setting"]]) for number, row in enumerate(rows, 1) if row["error"] is not None}
    for numbers in clusters({number: axes.transData.transform(place) for number, place in places.items()}):
        # The front's line comes from above and leaves to the right.
        axes.annotate(", ".join(map(str, numbers)), places[numbers[0]], xytext=(-8, 7), textcoords="offset points", ha="right", fontsize=8)


def draw_table_panel(axes, title, knobs, rows):
    """Figures of many knobs with the same settings: a place a knob, a mark a setting; none where the result is exact."""
    unit = page.rows_of(knobs[0], rows)[0]["error_unit"]
    is_psnr = unit == page.PSNR_UNIT
    for number, setting in enumerate(knobs[0]["settings"]):
        errors = [next(row["error"] for row in page.rows_of(knob, rows) if row["setting"] == setting) for knob in knobs]
        heights = [page.psnr_db(error) for error in errors] if is_psnr else errors
        axes.plot(range(len(knobs)), heights, "osv^D<>P"[number % 8], markersize=5, label=setting, linestyle="none")
    axes.set_title(title, fontsize=10, loc="left")
    axes.set_yscale("linear" if is_psnr else "log")
    axes.set_ylabel("PSNR, dB" if is_psnr else f"figure, {unit}", fontsize=8)
    axes.set_xticks(range(len(knobs)), [knob["knob"] for knob in knobs], rotation=90, fontsize=6)
    axes.tick_params(axis="y", labelsize=8)
    axes.grid(alpha=0.25)
    axes.legend(fontsize=7.5, loc="upper left", bbox_to_anchor=(1.01, 1.02), handlelength=1, frameon=False, borderaxespad=0)


def frame_panel(axes, title, rows, floor):
    axes.set_title(title, fontsize=10, loc="left")
    axes.set_xscale("log")
    axes.set_yscale("log")
    times = [row["ms_median"] for row in rows]
    axes.set_xlim(min(times) / 1.8, max(times) * 1.8)
    highest = max([row["error"] for row in rows] + [10 * floor])
    axes.set_ylim(floor / 2, highest * 4)
    axes.set_xlabel("time, ms", fontsize=8)
    axes.set_ylabel(f"error, {rows[0]['error_unit']}", fontsize=8)
    axes.tick_params(labelsize=8)
    axes.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axes.xaxis.set_major_formatter(lambda value, _: f"{value:g}")
    axes.xaxis.set_minor_formatter(NullFormatter())
    axes.yaxis.set_minor_formatter(NullFormatter())
    axes.grid(alpha=0.25)
    if any(row["error"] == 0 for row in rows):
        ticks = [tick for tick in axes.get_yticks() if floor < tick <= highest * 4]
        axes.set_yticks([floor] + ticks[:: max(1, len(ticks) // 5)])
        axes.yaxis.set_major_formatter(lambda value, _: "exact" if value == floor else f"$10^{{{round(math.log10(value))}}}$")
        axes.set_ylim(floor / 2, highest * 4)
    axes.legend(fontsize=7.5, loc="upper left", bbox_to_anchor=(1.01, 1.02), handlelength=1, frameon=False, borderaxespad=0)


def panels_of(subject, knobs, rows):
    """A function of the axes for each panel: one a knob, one for each table of knobs whose figures share a unit."""
    for knob in knobs:
        if not knob["table"]:
            yield functools.partial(draw_panel, title=f"{subject['subject']}: {knob['knob']}", rows=page.rows_of(knob, rows))
    for title, of_table in page.tables_of(knobs).items():
        if len({page.rows_of(knob, rows)[0]["error_unit"] for knob in of_table}) == 1:
            yield functools.partial(draw_table_panel, title=f"{subject['subject']}: {title}", knobs=of_table, rows=rows)


def draw(registry, results, path):
    panels = [panel for subject, knobs in registry for panel in panels_of(subject, knobs, results[subject["subject"]])]
    lines = math.ceil(len(panels) / COLUMNS)
    figure, grid = pyplot.subplots(lines, COLUMNS, figsize=(13, 3.1 * lines), squeeze=False, layout="constrained")
    for axes, draw_on in zip(grid.flat, panels):
        draw_on(axes)
    for axes in list(grid.flat)[len(panels):]:
        axes.set_visible(False)
    figure.savefig(path, dpi=110, metadata={"Software": None})
    pyplot.close(figure)
