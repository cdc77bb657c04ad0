# SPDX-License-Identifier: MIT
"""The pictures of docs/accuracy.md, one a subject: a panel for each knob, error over time, every setting named where it stands."""
import math

import matplotlib

matplotlib.use("Agg")
from matplotlib import pyplot, transforms  # noqa: E402
from matplotlib.lines import Line2D  # noqa: E402
from matplotlib.ticker import FixedLocator, FuncFormatter, NullFormatter, NullLocator  # noqa: E402

import page  # noqa: E402
import pareto  # noqa: E402

WIDTH_IN, PANEL_IN, LINE_IN, DPI = 9.0, 2.9, 0.19, 180  # at the width of a page a letter of 9 points has some 11 pixels
MOST_SIDE_BY_SIDE = 9  # settings of a panel of half the width
BLUE, GREY, RED, PALE = "#1f5fa8", "#777777", "#c0392b", "#d5dde8"


def floor_of(rows):
    """The least error; where there are exact results, the line on which they are drawn, a decade below it."""
    errors = [row["error"] for row in rows if row["error"]]
    if not errors:
        return 1.0
    return 10 ** (math.floor(math.log10(min(errors))) - 1) if len(errors) < len(rows) else min(errors)


def one_two_five(low, high):
    """1, 2 and 5 times powers of ten between two numbers; powers alone, and only some of them, where these are many."""
    powers = range(math.floor(math.log10(low)), math.ceil(math.log10(high)) + 1)
    fine = [m * 10.0**p for p in powers for m in (1, 2, 5) if low <= m * 10.0**p <= high]
    coarse = [10.0**p for p in powers if low <= 10.0**p <= high]
    return fine if len(fine) <= 8 else coarse[:: math.ceil(len(coarse) / 5)]


def tick_text(value):
    if value >= 1e-3:
        return page.significant(value, 3)
    power = math.floor(math.log10(value) + 1e-9)
    factor = round(value / 10**power)
    return f"${'' if factor == 1 else f'{factor}·'}10^{{{power}}}$"


def set_scale(axis, ticks, names=None):
    axis.set_major_locator(FixedLocator(ticks))
    axis.set_major_formatter(FuncFormatter(lambda value, _: (names or {}).get(value) or tick_text(value)))
    axis.set_minor_locator(NullLocator())
    axis.set_minor_formatter(NullFormatter())


def frame_panel(axes, title, rows, floor):
    times, highest = [row["ms_median"] for row in rows], max([row["error"] for row in rows] + [3 * floor])
    is_exact = any(row["error"] == 0 for row in rows)
    axes.set_title(title, fontsize=9, loc="left", fontweight="bold")
    room = (highest / floor) ** 0.17
    axes.set(xscale="log", yscale="log", xlim=(min(times) / 1.9, max(times) * 2.2), ylim=(floor / room, highest * room))
    set_scale(axes.xaxis, one_two_five(*axes.get_xlim()))
    is_all_exact = not any(row["error"] for row in rows)
    ticks = [] if is_all_exact else one_two_five(floor * 3 if is_exact else axes.get_ylim()[0], axes.get_ylim()[1])
    set_scale(axes.yaxis, ([floor] if is_exact else []) + ticks, {floor: "exact"} if is_exact else None)
    axes.set_xlabel("time, ms", fontsize=9)
    axes.set_ylabel(", ".join(filter(None, ("error", rows[0]["error_unit"]))), fontsize=9)
    axes.tick_params(labelsize=8.5, length=2)
    axes.grid(color="#eeeeee")
    axes.set_axisbelow(True)
    axes.spines[["top", "right"]].set_visible(False)


def overlap(a, b):
    return max(0, min(a.x1, b.x1) - max(a.x0, b.x0)) * max(0, min(a.y1, b.y1) - max(a.y0, b.y0))


def place_label(axes, text, place, taken, style):
    """Where it covers least of what is taken (boxes in pixels), near its point; a thin line leads to one farther off."""
    scale = axes.figure.dpi / 72
    x, y = axes.transData.transform(place)
    label = axes.annotate(text, place, xytext=(0, 0), textcoords="offset points", annotation_clip=False, **style)
    own = label.get_window_extent()
    width, height = own.width, own.height
    frame, best = axes.get_window_extent(), None
    for distance in (5, 9, 14, 20, 28, 38, 50):
        for turn in range(16):
            dx, dy = math.cos(turn * math.pi / 8), math.sin(turn * math.pi / 8)
            left = x + distance * scale * dx - width * (1 - dx) / 2
            below = y + distance * scale * dy - height * (1 - dy) / 2
            box = transforms.Bbox.from_bounds(left, below, width, height)
            outside = width * height - overlap(box, frame)
            cost = sum(overlap(box, other) for other in taken) + 4 * outside + distance * scale * 3 + (0 if dx > 0.9 else 2 * scale)
            if best is None or cost < best[0]:
                best = cost, box, distance
    _, box, distance = best
    label.set_position(((box.x0 - x) / scale, (box.y0 - y) / scale))
    taken.append(box)
    if distance > 9:
        end = axes.transData.inverted().transform((min(max(x, box.x0), box.x1), min(max(y, box.y0), box.y1)))
        axes.plot([place[0], end[0]], [place[1], end[1]], color=GREY, linewidth=0.5, zorder=1)


def boxes_along(points, radius):
    """Small boxes along a line through points, in pixels, for labels to keep off."""
    boxes = []
    for (x0, y0), (x1, y1) in zip(points, points[1:]):
        count = max(1, int(math.hypot(x1 - x0, y1 - y0) / (2 * radius)))
        for i in range(count + 1):
            x, y = x0 + (x1 - x0) * i / count, y0 + (y1 - y0) * i / count
            boxes.append(transforms.Bbox.from_extents(x - radius, y - radius, x + radius, y + radius))
    return boxes


def draw_panel(axes, title, rows):
    """What is not finite has no place in it."""
    rows = [row for row in rows if row["error"] is not None]
    floor, front = floor_of(rows), pareto.front(rows)
    place = {row["setting"]: (row["ms_median"], row["error"] or floor) for row in rows}
    frame_panel(axes, title, rows, floor)
    corners = [place[row["setting"]] for row in front]
    steps = [corners[0]] + [point for a, b in zip(corners, corners[1:]) for point in ((b[0], a[1]), b)]
    axes.plot(*zip(*steps), color=BLUE, linewidth=1.4, alpha=0.6, zorder=2)
    axes.figure.canvas.draw()
    scale = axes.figure.dpi / 72
    pixels = {name: axes.transData.transform(point) for name, point in place.items()}
    taken = boxes_along(axes.transData.transform(steps), scale) if len(steps) > 1 else []
    taken += [box for point in pixels.values() for box in boxes_along([point, point], 4.5 * scale)]
    for row in sorted(rows, key=lambda row: (not row["default"], row not in front, row["ms_median"])):
        is_peer = row["setting"] == row["peer"]
        color = RED if row["default"] else BLUE if row in front else GREY
        axes.plot(*place[row["setting"]], "s" if is_peer else "o", color=color, zorder=4,
                  markersize=8 if row["default"] else 6)
        role = (" (default, peer)" if is_peer else " (default)") if row["default"] else " (peer)" if is_peer else ""
        place_label(axes, row["setting"] + role, place[row["setting"]], taken,
                    {"fontsize": 8.5, "color": color, "fontweight": "bold" if row["default"] else "normal", "zorder": 5})


def draw_table(axes, title, knobs, rows):
    """A line a knob: from its first setting to its last, its default, and the others between; exact results have no place in dB, nor
    on a logarithmic axis."""
    settings, default = knobs[0]["settings"], knobs[0]["default"]
    is_psnr = page.rows_of(knobs[0], rows)[0]["error_unit"] == page.PSNR_UNIT

    def figure(knob, setting):
        error = next(row["error"] for row in page.rows_of(knob, rows) if row["setting"] == setting)
        return page.psnr_db(error) if is_psnr else error

    heights = list(range(len(knobs)))
    first, last = ([figure(knob, setting) for knob in knobs] for setting in (settings[0], settings[-1]))
    axes.hlines(heights, first, last, color=PALE, linewidth=5, zorder=1)
    others = [setting for setting in settings[1:-1] if setting != default]
    for number, setting in enumerate(others):
        axes.plot([figure(knob, setting) for knob in knobs], heights, "|", color=GREY, markersize=7, zorder=2,
                  label=", ".join(others) if number == 0 else None)
    axes.plot(first, heights, "o", color=GREY, label=settings[0], zorder=3)
    axes.plot(last, heights, "D", color=BLUE, markersize=5, label=settings[-1], zorder=3)
    axes.plot([figure(knob, default) for knob in knobs], heights, "o", color=RED, markersize=7, label=f"{default} (default)", zorder=4)
    axes.set_yticks(heights, [knob["knob"] for knob in knobs], fontsize=8.5)
    axes.set_ylim(len(knobs) - 0.4, -0.6)
    axes.set_title(title + (" (better is right)" if is_psnr else " (better is left)"), fontsize=9, loc="left", fontweight="bold")
    if not is_psnr:
        axes.set_xscale("log")
        set_scale(axes.xaxis, one_two_five(*axes.get_xlim()))
    axes.tick_params(axis="x", labelsize=8.5)
    axes.grid(axis="x", color="#eeeeee")
    axes.set_axisbelow(True)
    axes.spines[["top", "right", "left"]].set_visible(False)
    axes.tick_params(axis="y", length=0)
    below = axes.transAxes + transforms.ScaledTranslation(0, -0.25, axes.figure.dpi_scale_trans)
    axes.legend(fontsize=8.5, loc="upper left", bbox_to_anchor=(0, 0), bbox_transform=below, ncol=2, frameon=False, handletextpad=0.3, columnspacing=1.2)


def lines_of_panels(knobs, rows):
    """[[knobs side by side]]: two where neither has many settings."""
    lines = []
    for knob in knobs:
        is_small = len(page.rows_of(knob, rows)) <= MOST_SIDE_BY_SIDE
        if lines and len(lines[-1]) == 1 and is_small and len(page.rows_of(lines[-1][0], rows)) <= MOST_SIDE_BY_SIDE:
            lines[-1].append(knob)
        else:
            lines.append([knob])
    return lines


def drawn_table(knobs, rows):
    """Of a subject's tables of many knobs the first whose figures have one unit; the others are to be read."""
    for title, of_table in page.tables_of(knobs).items():
        if len({page.rows_of(knob, rows)[0]["error_unit"] for knob in of_table}) == 1:
            return title, of_table
    return None


def draw(knobs, rows, path):
    """A subject's knobs and rows as `make bench` has them; the same rows, the same bytes."""
    lines, last = lines_of_panels([knob for knob in knobs if not knob["table"]], rows), drawn_table(knobs, rows)
    heights = [PANEL_IN] * len(lines) + ([LINE_IN * len(last[1]) + 1.1] if last else [])
    figure = pyplot.figure(figsize=(WIDTH_IN, sum(heights)), dpi=DPI, layout="constrained")
    grid = figure.add_gridspec(len(heights), 2, height_ratios=heights, hspace=0.06, wspace=0.04)
    panels = []
    for number, line in enumerate(lines):
        for column, knob in enumerate(line):
            panels.append((figure.add_subplot(grid[number, column if len(line) == 2 else slice(0, 2)]), knob))
    for axes, knob in panels:  # twice: labels are placed when every panel has its place
        frame_panel(axes, knob["knob"], *framed(knob, rows))
    if last:
        draw_table(figure.add_subplot(grid[len(lines), :]), last[0], last[1], rows)
    front = Line2D([], [], color=BLUE, linewidth=1.4, alpha=0.6, marker="o", markersize=6)
    figure.legend([front], ["nothing else is as accurate and faster (Pareto front); better is left and down"],
                  loc="outside lower left", fontsize=8.5, frameon=False)
    figure.canvas.draw()
    figure.set_layout_engine("none")
    for axes, knob in panels:
        draw_panel(axes, knob["knob"], page.rows_of(knob, rows))
    figure.savefig(path, metadata={"Software": None})
    pyplot.close(figure)


def framed(knob, rows):
    finite = [row for row in page.rows_of(knob, rows) if row["error"] is not None]
    return finite, floor_of(finite)
