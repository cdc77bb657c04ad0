# SPDX-License-Identifier: MIT
"""The machinery of `make bench`: the Pareto front against its definition, a page that follows from its rows, and a registry that the
committed page covers."""
import random

import bench
import page
import pareto
import pytest

SUBJECT = {"subject": "inversion", "truth": "Exact sums.", "advice": "Take the default."}
KNOB = {"subject": "inversion", "knob": "method", "set_by": "`--method`", "error_unit": "counts", "peer": "plain", "default": "fast",
        "why_off_front": "", "differs_by_machine": False, "table": "", "table_note": "", "settings": ["plain", "fast"]}


def row(setting, ms, error, **other):
    return {"knob": "method", "setting": setting, "default": setting == "fast", "peer": "plain", "error": error, "error_unit": "counts",
            "ms_median": ms, "ratio_to_peer": 20 / ms, "threads": 1, "rounds": 15, "bytes": 2_000_000, **other}


ROWS = [row("plain", 20.0, 0.0), row("fast", 2.0, 0.125), row("wrong", 3.0, None)]


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
    text = page.page([(SUBJECT, [KNOB])], {"inversion": ROWS}, "a machine")
    assert "| method | plain | ● | 0 | 20 | 1 | 1 | 2 |\n" in text
    assert "|  | **fast** | ● | 0.12 counts | 2 | 10 | 1 | 2 |\n" in text
    assert "|  | wrong |  | not finite | 3 | 6.67 | 1 | 2 |\n" in text
    assert "The default, fast, is on the Pareto front." in text


def test_a_default_off_the_front_is_explained_by_the_registry_or_reported():
    rows = ROWS + [row("best", 1.0, 0.0)]
    assert "'fast'" in page.unexplained(SUBJECT, [KNOB], rows)[0]
    knob = {**KNOB, "why_off_front": "it needs no table."}
    assert page.unexplained(SUBJECT, [knob], rows) == []
    assert "not on the Pareto front: it needs no table." in page.page([(SUBJECT, [knob])], {"inversion": rows}, "a machine")


def test_a_knob_that_the_page_lacks_and_a_changed_default_are_found():
    text = page.page([(SUBJECT, [KNOB])], {"inversion": ROWS}, "a machine")
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
    text = page.page([(SUBJECT, knobs)], {"inversion": rows}, "a machine")
    assert "\nHow near.\n\n| dB | plain | **fast** |\n| --- | --- | --- |\n| turning | 20.0 | 40.0 |\n| still | exact | not finite |\n" in text
    assert page.missing([(SUBJECT, knobs)], text) == []
    assert page.unexplained(SUBJECT, knobs, rows) == []


@pytest.mark.parametrize("value, text", [(0, "0"), (172.6, "173"), (12345.6, "12346"), (0.02514, "0.0251"), (1.234e-7, "1.23e-07")])
def test_figures_have_three_digits(value, text):
    assert page.significant(value, 3) == text


def test_the_plot_is_the_same_for_the_same_rows(tmp_path):
    import plot

    for name in ("a.png", "b.png"):
        plot.draw([(SUBJECT, [KNOB])], {"inversion": ROWS}, tmp_path / name)
    assert (tmp_path / "a.png").read_bytes() == (tmp_path / "b.png").read_bytes()


def test_every_registered_knob_has_its_place_in_the_docs():
    registry = bench.list_registry()
    assert registry
    assert page.missing(registry, (bench.ROOT / "docs/accuracy.md").read_text()) == []


def test_every_program_measures_what_it_lists():
    bench.smoke()
