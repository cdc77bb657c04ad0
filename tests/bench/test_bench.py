# SPDX-License-Identifier: MIT
"""The machinery of `make bench`: the Pareto front against its definition, a page that follows from its rows, and a registry that the
committed page covers."""
import platform
import random
import re

import bench
import page
import pareto
import pytest

SUBJECT = {"subject": "inversion", "truth": "Exact sums.", "advice": "Take the default."}
KNOB = {"subject": "inversion", "knob": "method", "set_by": "`--method`", "error_unit": "counts", "peer": "plain", "default": "fast",
        "why_off_front": "", "differs_by_machine": False, "table": "", "table_note": "", "settings": ["plain", "fast"]}


def row(setting, ms, error, **other):
    return {"knob": "method", "setting": setting, "default": setting == "fast", "peer": "plain", "error": error, "error_unit": "counts",
            "ms_median": ms, "ratio_to_peer": 20 / ms, "threads": 1, "rounds": 15, "bytes": 2_000_000, "detail": "", **other}


ROWS = [row("plain", 20.0, 0.0), row("fast", 2.0, 0.125), row("wrong", 3.0, None)]


def section(knobs, rows, **subject):
    return page.section({**SUBJECT, **subject}, knobs, {"machine": "a machine", "rows": rows})


def beats(one, other, tolerance):
    error, other_error = pareto.error_of(one), pareto.error_of(other)
    clearly_faster = one["ms_median"] < other["ms_median"] * (1 - tolerance)
    return (error <= other_error and clearly_faster) or (error < other_error and one["ms_median"] <= other["ms_median"])


@pytest.mark.parametrize("tolerance", [0, 0.03, 0.3])
def test_the_front_is_what_no_row_beats(tolerance):
    generator = random.Random(3)
    for _ in range(500):
        rows = [row(str(i), generator.choice([1, 1.02, 2, 2.5, 3, 9]), generator.choice([0, 0, 0.1, 0.2, 4, None])) for i in range(8)]
        expected = {r["setting"] for r in rows if not any(beats(other, r, tolerance) for other in rows)}
        assert {r["setting"] for r in pareto.front(rows, tolerance)} == expected


def test_equal_rows_are_both_on_the_front():
    assert len(pareto.front([row("a", 1, 0), row("b", 1, 0)])) == 2


def test_the_page_has_each_setting_with_its_figures_and_marks():
    text = section([KNOB], ROWS)
    assert "| method | plain | ● | 0 | 20 | 1 | 1 | 2 |\n" in text
    assert "|  | **fast** | ● | 0.12 counts | 2 | 10 | 1 | 2 |\n" in text
    assert "|  | wrong |  | not finite | 3 | 6.67 | 1 | 2 |\n" in text
    assert "The default, fast, is on the Pareto front." in text


def test_a_default_off_the_front_is_explained_by_the_registry_or_reported():
    rows = ROWS + [row("best", 1.0, 0.0)]
    assert "'fast'" in page.unexplained(SUBJECT, [KNOB], rows)[0]
    knob = {**KNOB, "why_off_front": "it needs no table."}
    assert page.unexplained(SUBJECT, [knob], rows) == []
    assert "not on the Pareto front: it needs no table." in section([knob], rows)


def test_a_knob_that_the_page_lacks_and_a_changed_default_are_found():
    text = section([KNOB], ROWS)
    assert page.missing([(SUBJECT, [KNOB])], text) == []
    assert "'threads'" in page.missing([(SUBJECT, [KNOB, {**KNOB, "knob": "threads"}])], text)[0]
    assert "'plain'" in page.missing([(SUBJECT, [{**KNOB, "default": "plain"}])], text)[0]
    assert page.missing([(SUBJECT, [{**KNOB, "default": "avx512", "differs_by_machine": True}])], text) == []
    assert "'method' of masks" in page.missing([({**SUBJECT, "subject": "masks"}, [KNOB])], text)[0]


def test_knobs_of_one_table_are_lines_of_it_and_an_error_relative_to_a_peak_is_a_psnr():
    knobs = [{**KNOB, "knob": name, "table": "dB", "table_note": "How near."} for name in ("turning", "still")]
    rows = [{**row("plain", 1, 10.0), "knob": "turning"}, {**row("fast", 2, 1.0), "knob": "turning"},
            {**row("plain", 1, 0.0), "knob": "still"}, {**row("fast", 2, None), "knob": "still"}]
    rows = [{**one, "error_unit": page.PSNR_UNIT} for one in rows]
    text = section(knobs, rows)
    assert "\nHow near.\n\n| dB | plain | **fast** |\n| --- | --- | --- |\n| turning | 20.0 | 40.0 |\n| still | exact | not finite |\n" in text
    assert page.missing([(SUBJECT, knobs)], text) == []
    assert page.unexplained(SUBJECT, knobs, rows) == []


@pytest.mark.parametrize("value, text", [(0, "0"), (172.6, "173"), (12345.6, "12346"), (0.02514, "0.0251"), (1.234e-7, "1.23e-07")])
def test_figures_have_three_digits(value, text):
    assert page.significant(value, 3) == text


def test_the_page_says_which_kernel_the_peer_ran():
    rows = [row("plain", 20.0, 0.0, detail="kernel Haswell"), row("fast", 2.0, 0.125)]
    assert "its peer is plain (kernel Haswell). The default" in section([KNOB], rows)


def sgemm_details():
    rows = bench.lines_of("inversion", "--smoke")
    return {one["detail"] for one in rows if one["setting"] == "OpenBLAS sgemm"}


def test_the_sgemm_peer_runs_the_fastest_of_its_kernels(monkeypatch):
    monkeypatch.delenv("OPENBLAS_CORETYPE", raising=False)
    (detail,) = sgemm_details()
    kernel, times = re.fullmatch(r"kernel (\S+), the fastest here: (.*), for 156 x 159 x \d+", detail).groups()
    by_kernel = {name: float(ms) for name, ms in re.findall(r"(\S+) (\S+) ms", times)}
    assert by_kernel[kernel] == min(by_kernel.values())


def test_the_sgemm_peer_runs_the_kernel_that_is_asked_for(monkeypatch):
    if platform.machine() != "x86_64":
        pytest.skip("the kernel's name is x86's")
    monkeypatch.setenv("OPENBLAS_CORETYPE", "Nehalem")
    assert sgemm_details() == {"kernel Nehalem, as OPENBLAS_CORETYPE asks"}


def test_measuring_one_subject_leaves_the_sections_and_machines_of_the_others():
    masks = ({**SUBJECT, "subject": "masks"}, [{**KNOB, "subject": "masks"}])
    registry = [(SUBJECT, [KNOB]), masks]
    before = page.page("", registry, {name: {"machine": "an old one", "rows": ROWS} for name in ("inversion", "masks")})
    after = page.page(before, registry, {"masks": {"machine": "a new one", "rows": [row("plain", 30.0, 0.0), row("fast", 3.0, 0.5)]}})
    parts, parts_before = page.sections_of(after), page.sections_of(before)
    assert parts["inversion"] == parts_before["inversion"] and "an old one" in parts["inversion"]
    assert "| method | plain | ● | 0 | 30 |" in parts["masks"] and "a new one" in parts["masks"]
    assert page.page(after, registry, {}) == after


def test_a_picture_is_the_same_for_the_same_rows(tmp_path):
    import plot

    for name in ("a.png", "b.png"):
        plot.draw([KNOB], ROWS, tmp_path / name)
    assert (tmp_path / "a.png").read_bytes() == (tmp_path / "b.png").read_bytes()


def overlaps(texts):
    boxes = [text.get_window_extent() for text in texts]
    return [(a, b) for i, a in enumerate(boxes) for b in boxes[:i] if a.overlaps(b)]


def test_no_two_names_of_a_picture_overlap_and_each_setting_has_one():
    import plot
    from matplotlib import pyplot

    rows = [row(f"setting {i} of a knob", 10 * 1.02**i, 0.1 + 0.001 * (i % 3)) for i in range(9)]
    figure, axes = pyplot.subplots(figsize=(9, 2.9), dpi=180)
    plot.draw_panel(axes, "near each other", rows)
    names = [text for text in axes.texts]
    assert sorted(text.get_text() for text in names) == sorted(one["setting"] for one in rows)
    assert overlaps(names) == []
    pyplot.close(figure)


def test_every_section_of_the_page_has_its_picture():
    text = (bench.ROOT / "docs/accuracy.md").read_text()
    for name, part in page.sections_of(text).items():
        assert f"(images/accuracy_{name}.png)" in part
        assert (bench.ROOT / f"docs/images/accuracy_{name}.png").exists()


def test_every_registered_knob_has_its_place_in_the_docs():
    registry = bench.list_registry()
    assert registry
    assert page.missing(registry, (bench.ROOT / "docs/accuracy.md").read_text()) == []


def test_every_program_measures_what_it_lists():
    bench.smoke()
