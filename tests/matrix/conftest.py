# SPDX-License-Identifier: MIT
# Says what must be built before the fault matrix can run.
import pytest

from matrix import PROGRAM


def pytest_configure():
    if not PROGRAM.exists():
        raise pytest.UsageError(f"{PROGRAM} is missing: run `make host`")
