# SPDX-License-Identifier: MIT
"""Generated tables inside a written page: what stands between <!-- NAME --> and <!-- end NAME --> is replaced."""
import sys
from pathlib import Path


def replace(page, name, text):
    """Ends the program when the page has no such section, so that a table is never lost in silence."""
    begin, end = f"<!-- {name} -->\n", f"<!-- end {name} -->"
    whole = Path(page).read_text()
    if begin not in whole or end not in whole:
        sys.exit(f"{page}: has no section between '{begin.strip()}' and '{end}'")
    before, rest = whole.split(begin, 1)
    Path(page).write_text(before + begin + text + end + rest.split(end, 1)[1])
