# SPDX-License-Identifier: MIT
# Chooses the board that the tests run against: BOARD=emulated (the default), can:emulated (its CAN bus), usb:SERIAL (or
# usb:, the only one), can:IFACE.
import shutil

import pytest

from ols_board import board

KIND = board.BOARD
EMULATED = ("emulated", "can:emulated")


def pytest_configure():
    if KIND not in EMULATED and not KIND.startswith(("usb:", "can:")):
        raise pytest.UsageError(f"BOARD={KIND}: write emulated, can:emulated, usb:, usb:SERIAL or can:IFACE")
    if KIND not in EMULATED:
        return
    if not board.IMAGE.exists():
        raise pytest.UsageError(f"{board.IMAGE}: no firmware image; build it with `make firmware`")
    if not (board.EMULATOR.parent / "node_modules").exists():
        raise pytest.UsageError(f"{board.EMULATOR.parent}: run `npm ci` there first")
    if shutil.which("sigrok-cli") is None:
        raise pytest.UsageError("sigrok-cli is missing: apt-get install sigrok-cli")


def real_board(arguments, options):
    if arguments or options:
        pytest.skip("needs the emulated board: a real one has no injected faults and no trace")
    if KIND.startswith("can:"):
        return board.CanBoard(KIND.removeprefix("can:"))
    from ols_board.usb_board import UsbBoard  # only here: PyUSB wants libusb
    return UsbBoard(KIND.removeprefix("usb:"))


@pytest.fixture
def emulated():
    """Starts emulated boards, and ends whatever a test leaves running; with BOARD=usb:SERIAL or can:IFACE, the real board."""
    started = []

    def start(*arguments, **options):
        made = board.EmulatedBoard(*arguments, **options) if KIND in EMULATED else real_board(arguments, options)
        started.append(made)
        return made

    yield start
    for one in started:
        one.__exit__()
