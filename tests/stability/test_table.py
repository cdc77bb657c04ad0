# SPDX-License-Identifier: MIT
"""The page of hard cases: made of what tests record, and every file has a row in it."""
import table

ROW = {"case": "a lamp | two", "naive": "Inf", "ours": "0", "bound": "0", "file": "half.cpp"}
REPORT = {"testsuites": [{"testsuite": [{**{k: v for k, v in ROW.items() if k != "file"}, "file": "x/half.cpp", "line": 3},
                                        {"name": "a test without a row", "file": "x/half.cpp"}]}]}


def test_recorded_properties_become_a_row():
    assert table.rows_of_report(REPORT, "half.cpp") == [ROW]


def test_a_row_is_one_line_of_the_table_whatever_it_says():
    line = table.table_line(ROW)
    assert line == "| a lamp \\| two | Inf | 0 | 0 | [half.cpp](../tests/stability/half.cpp) |\n"


def test_a_page_of_its_rows_misses_nothing():
    assert table.missing_rows([ROW], ["half.cpp"], table.page([ROW])) == []


def test_a_file_that_records_nothing_is_a_problem():
    assert "lost.cpp records no case" in table.missing_rows([ROW], ["half.cpp", "lost.cpp"], table.page([ROW]))[0]


def test_a_case_that_is_not_in_the_page_is_a_problem():
    assert "'another'" in table.missing_rows([ROW, {**ROW, "case": "another"}], ["half.cpp"], table.page([ROW]))[0]


def test_every_file_of_the_folder_has_a_row_in_the_docs():
    page = table.PAGE.read_text()
    for file in table.case_files():
        assert f"(../tests/stability/{file.name}) |" in page, file.name
