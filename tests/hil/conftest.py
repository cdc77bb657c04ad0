# SPDX-License-Identifier: MIT
# Chooses the board that the tests run against: BOARD=emulated (the default), usb: or usb:SERIAL.
import os
import shutil

import pytest

from ols_board import board

KIND = os.environ.get("BOARD", "emulated")


def pytest_configure():
    if KIND != "emulated" and not KIND.startswith("usb:"):
        raise pytest.UsageError(f"BOARD={KIND}: write emulated, usb: or usb:SERIAL")
    if KIND != "emulated":
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
    from ols_board.usb_board import UsbBoard  # only here: PyUSB wants libusb
    return UsbBoard(KIND.removeprefix("usb:"))


@pytest.fixture
def emulated():
    """Starts emulated boards, and ends whatever a test leaves running; with BOARD=usb:SERIAL, the real board."""
    started = []

    def start(*arguments, **options):
        made = board.EmulatedBoard(*arguments, **options) if KIND == "emulated" else real_board(arguments, options)
        started.append(made)
        return made

    yield start
    for one in started:
        one.__exit__()
