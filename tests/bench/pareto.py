# SPDX-License-Identifier: MIT
"""The Pareto front of error and time."""
import math

# Times that differ by less than this share are taken as equal: medians of one run repeat to about a hundredth.
TIME_TOLERANCE = 0.03


def error_of(row):
    """A number to compare: an error that was not finite (null) is worse than any."""
    return math.inf if row["error"] is None else row["error"]


def front(rows, tolerance=TIME_TOLERANCE):
    """The rows that no other beats, in order of time. Another row beats one when it is as accurate and faster by more than
    the tolerance, or more accurate and no slower."""
    rows = sorted(rows, key=lambda row: (row["ms_median"], error_of(row)))
    kept, best, best_clearly_faster, clearly_faster = [], math.inf, math.inf, 0
    for row in rows:
        while rows[clearly_faster]["ms_median"] < row["ms_median"] * (1 - tolerance):
            best_clearly_faster = min(best_clearly_faster, error_of(rows[clearly_faster]))
            clearly_faster += 1
        # Rows of the same time come in order of error, so that `best` covers every row that is no slower.
        best = min(best, error_of(row))
        beaten_in_time = clearly_faster > 0 and best_clearly_faster <= error_of(row)
        if error_of(row) <= best and not beaten_in_time:
            kept.append(row)
    return kept
