# SPDX-License-Identifier: MIT
# Chooses the board that the tests run against: BOARD=emulated (the default), can:emulated, usb:, usb:SERIAL or can:IFACE.
import shutil

import pytest

from ols_board import board, claims

KIND, _, NAME = board.BOARD.partition(":")
IS_EMULATED = board.BOARD in ("emulated", "can:emulated")


def pytest_configure():
    if not IS_EMULATED and KIND not in ("usb", "can"):
        raise pytest.UsageError(f"BOARD={board.BOARD}: write emulated, can:emulated, usb:, usb:SERIAL or can:IFACE")
    if not IS_EMULATED:
        return
    if not board.IMAGE.exists():
        raise pytest.UsageError(f"{board.IMAGE}: no firmware image; build it with `make firmware`")
    if not (board.EMULATOR.parent / "node_modules").exists():
        raise pytest.UsageError(f"{board.EMULATOR.parent}: run `npm ci` there first")
    if shutil.which("sigrok-cli") is None:
        raise pytest.UsageError("sigrok-cli is missing: apt-get install sigrok-cli")


def pytest_terminal_summary(terminalreporter):
    for line in claims.summary():
        terminalreporter.write_line(line)


def real_board(arguments, options):
    if arguments or options:
        pytest.skip("needs the emulated board: a real one has no injected faults and no trace")
    if KIND == "can":
        return board.CanBoard(NAME)
    from ols_board.usb_board import UsbBoard  # only here: PyUSB wants libusb
    return UsbBoard(NAME)


@pytest.fixture
def emulated():
    """Starts emulated boards, and ends whatever a test leaves running; with BOARD=usb: or can:IFACE, the real board."""
    started = []

    def start(*arguments, **options):
        made = board.EmulatedBoard(*arguments, **options) if IS_EMULATED else real_board(arguments, options)
        started.append(made)
        return made

    yield start
    for one in started:
        one.__exit__()
