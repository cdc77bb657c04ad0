# SPDX-License-Identifier: MIT
"""The plot of docs/accuracy.md: a panel for each knob."""
import math

import matplotlib

matplotlib.use("Agg")
from matplotlib import pyplot  # noqa: E402
from matplotlib.ticker import LogLocator, NullFormatter  # noqa: E402

import page  # noqa: E402
import pareto  # noqa: E402

COLUMNS = 2
BLUE, GREY, RED = "#1f5fa8", "#666666", "#c0392b"


def floor_of(rows):
    """Where exact results are drawn, and from where on the axis is logarithmic: a decade below the least error."""
    errors = [row["error"] for row in rows if row["error"]]
    return 10 ** (math.floor(math.log10(min(errors))) - 1) if errors else 1.0


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
        # Numbers of neighbours in time stand at different heights.
        order = sorted(finite, key=lambda other: other["ms_median"]).index(row)
        axes.annotate(str(number), place, xytext=(0, 10 + 9 * (order % 2)), textcoords="offset points", ha="center", fontsize=8)
    frame_panel(axes, title, finite, floor)


def frame_panel(axes, title, rows, floor):
    axes.set_title(title, fontsize=10, loc="left")
    axes.set_xscale("log")
    axes.set_yscale("log")
    times = [row["ms_median"] for row in rows]
    axes.set_xlim(min(times) / 1.8, max(times) * 1.8)
    highest = max([row["error"] for row in rows] + [floor])
    axes.set_ylim(floor / 2, highest * (10 if highest > floor else 1000))
    axes.set_xlabel("time, ms", fontsize=8)
    axes.set_ylabel(f"error, {rows[0]['error_unit']}", fontsize=8)
    axes.tick_params(labelsize=8)
    axes.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axes.xaxis.set_major_formatter(lambda value, _: f"{value:g}")
    axes.xaxis.set_minor_formatter(NullFormatter())
    axes.grid(alpha=0.25)
    if any(row["error"] == 0 for row in rows):
        ticks = [tick for tick in axes.get_yticks() if floor < tick <= highest * 10]
        axes.set_yticks([floor] + ticks[:: max(1, len(ticks) // 5)])
        axes.yaxis.set_major_formatter(lambda value, _: "exact" if value == floor else f"$10^{{{round(math.log10(value))}}}$")
        axes.yaxis.set_minor_formatter(NullFormatter())
        axes.set_ylim(floor / 2, highest * (10 if highest > floor else 1000))
    axes.legend(fontsize=7.5, loc="upper left", bbox_to_anchor=(1.01, 1.02), handlelength=1, frameon=False, borderaxespad=0)


def draw(registry, results, path):
    panels = [(f"{subject['subject']}: {knob['knob']}", page.rows_of(knob, results[subject["subject"]])) for subject, knobs in registry for knob in knobs]
    lines = math.ceil(len(panels) / COLUMNS)
    figure, grid = pyplot.subplots(lines, COLUMNS, figsize=(13, 3.1 * lines), squeeze=False, layout="constrained")
    for axes, panel in zip(grid.flat, panels):
        draw_panel(axes, *panel)
    for axes in list(grid.flat)[len(panels):]:
        axes.set_visible(False)
    figure.savefig(path, dpi=110, metadata={"Software": None})
    pyplot.close(figure)
