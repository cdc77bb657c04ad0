# SPDX-License-Identifier: MIT
# Says what must be built before the capture tests can run.
import pytest

from virtual_take import BIN, BOARD, IMAGE


def pytest_configure():
    for program in ("stagectl", "stagesim", "rf", "gige_bridge"):
        if not (BIN / program).exists():
            raise pytest.UsageError(f"{BIN / program} is missing: run `make host`")
    if not IMAGE.exists():
        raise pytest.UsageError(f"{IMAGE} is missing: run `make firmware`")
    if not (BOARD / "node_modules").exists():
        raise pytest.UsageError(f"{BOARD} has no node_modules: run `npm ci` there")
