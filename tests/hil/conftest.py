# SPDX-License-Identifier: MIT
# Chooses the board that the tests run against: BOARD=emulated (the default), can:emulated, can:IFACE.
import shutil

import pytest

from ols_board import board


EMULATED = ("emulated", "can:emulated")


def pytest_configure():
    if board.BOARD not in EMULATED and not board.BOARD.startswith("can:"):
        raise pytest.UsageError(f"BOARD={board.BOARD}: write emulated, can:emulated or can:IFACE")
    if not board.IMAGE.exists():
        raise pytest.UsageError(f"{board.IMAGE}: no firmware image; build it with `make firmware`")
    if not (board.EMULATOR.parent / "node_modules").exists():
        raise pytest.UsageError(f"{board.EMULATOR.parent}: run `npm ci` there first")
    if shutil.which("sigrok-cli") is None:
        raise pytest.UsageError("sigrok-cli is missing: apt-get install sigrok-cli")


@pytest.fixture
def emulated():
    """Starts emulated boards, and ends whatever a test leaves running."""
    started = []

    def start(*arguments, **options):
        if board.BOARD not in EMULATED:
            if arguments or options:
                pytest.skip("a real board has no injections and no traces")
            return board.RealBoard()
        started.append(board.EmulatedBoard(*arguments, **options))
        return started[-1]

    yield start
    for one in started:
        one.__exit__()
