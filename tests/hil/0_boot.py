# SPDX-License-Identifier: MIT
# From reset to the first answer: boot ROM, boot2, the copy to SRAM, clocks, USB; and what never gets so far stays dark. Prints
# the times of docs/firmware.md, "Start" (pytest -s).
import os
import signal
import subprocess
import sys
import time

import pytest

import check_trace
from ols_board import claims, wire
from ols_board.board import BOARD, IMAGE, ROOT, EmulatedBoard, Link
from ols_board.program import paper_program
from ols_board.usb import Usb

pytestmark = pytest.mark.skipif(BOARD != "emulated", reason="needs the emulated board: nobody sees a real one boot")

TICKS_PER_S = 125_000_000
FLASH = 0x10000000
UF2_BLOCK = 512
IMAGES = ("pico", "feather_can") if "IMAGE" not in os.environ else (None,)


def image_of(board):
    return IMAGE if board is None else ROOT / f"build/firmware/{board}/stage.elf"


def uf2_of(board):
    return bytearray(image_of(board).with_suffix(".uf2").read_bytes())


def first_turn_us(board):
    """When the main loop has ended its first turn, by HEALTHY's first rise: from then on whoever asks is answered."""
    changes = check_trace.read_vcd(board.trace, healthy=True)
    return next(tick for tick, name, level in changes if name == "HEALTHY" and level) * 1e6 / TICKS_PER_S


def booted(emulated, *arguments, can=False, **options):
    """A board that has answered its first message: its statistics, and its log."""
    board = emulated(*arguments, trace=True, can=can, **options)
    link = board.plug_can() if can else board.plug_usb()
    assert link.hello(0)["tick_hz"] == TICKS_PER_S
    statistics = board.stop()
    return board, statistics


@pytest.mark.parametrize("rosc_mhz", [1.8, 6.5, 12])
@pytest.mark.parametrize("name", IMAGES)
def test_power_on_leads_through_rom_boot2_and_clocks_to_the_first_answer_in_the_dark(emulated, name, rosc_mhz):
    board, statistics = booted(emulated, "--rosc-mhz", str(rosc_mhz), image=image_of(name))
    boot = statistics["boot"]
    claims.counted(f"boot of {name}, ring oscillator {rosc_mhz} MHz: outputs driven after {boot['driven_us'] / 1000:.1f} ms, "
                   f"on USB after {boot['attached_us'] / 1000:.1f} ms, the first turn of the main loop, which answers, "
                   f"is over after {first_turn_us(board) / 1000:.1f} ms")
    # Three parts: the ROM (some 28 000 cycles) and boot2 from the ring oscillator, the crystal's 64 ms, the copy.
    assert 64_000 < boot["driven_us"] < 64_000 + 40_000 / rosc_mhz + 25_000
    assert boot["driven_us"] <= boot["attached_us"] < boot["driven_us"] + 2_000
    assert boot["driven_us"] < first_turn_us(board) < boot["driven_us"] + 5_000
    assert [change for change in check_trace.read_vcd(board.trace) if change[2]] == []  # no output ever rises


@pytest.mark.parametrize("name", IMAGES)
def test_the_same_boot_ends_in_an_answer_over_can(emulated, name):
    booted(emulated, can=True, image=image_of(name))


def test_a_watchdog_reset_boots_without_waiting_for_the_crystal_again(emulated):
    board = emulated("--inject", "watchdog@50000000")
    link = board.plug()
    with pytest.raises((ConnectionError, OSError)):
        while True:
            link.status()
            link.usb.read(timeout_us=10_000)
    link = board.plug()
    assert link.hello(0)
    assert wire.FAULTS[link.status()["fault"]] == "watchdog"
    boot = board.stop()["boot"]
    assert boot["cause"] == "watchdog" and boot["driven_us"] < 30_000
    claims.counted(f"boot after a watchdog reset: outputs driven after {boot['driven_us'] / 1000:.1f} ms")


def run_until(emulated, seconds, *arguments, **options):
    """A board that runs for so long by itself: its statistics, and its log."""
    board = emulated("--cycles-limit", str(int(seconds * TICKS_PER_S)), *arguments, trace=True, **options)
    board.process.wait(timeout=120)
    statistics = board.stop()
    assert [change for change in check_trace.read_vcd(board.trace) if change[2]] == []
    return board, statistics


def blank(_):
    blocks = uf2_of(IMAGES[0])[:UF2_BLOCK]
    blocks[32 : 32 + 256] = b"\xff" * 256
    return blocks


def corrupt(byte):
    blocks = uf2_of(IMAGES[0])
    blocks[32 + byte] ^= 0x10
    return blocks


@pytest.mark.parametrize("make, byte", [(blank, 0), (corrupt, 0), (corrupt, 131), (corrupt, 255)])
def test_an_empty_flash_or_a_damaged_first_page_ends_in_the_boot_loader_with_no_output_driven(emulated, tmp_path, make, byte):
    path = tmp_path / "flash.uf2"
    path.write_bytes(make(byte))
    board, statistics = run_until(emulated, 1, "--flash-as-is", "--board", "pico", image=path)
    assert "in the USB boot loader" in board.log and "after 128 attempts" in board.log
    assert statistics["boot"]["driven_us"] is None and statistics["boot"]["attached_us"] is None


def test_an_image_that_the_boot_rom_would_refuse_is_refused_with_its_name(tmp_path):
    path = tmp_path / "flash.uf2"
    path.write_bytes(corrupt(7))
    run = subprocess.run(["node", ROOT / "tools/stagesim/board/board.mjs", "--image", path], capture_output=True, text=True)
    assert run.returncode == 1 and str(path) in run.stderr and "boot ROM would refuse" in run.stderr


def test_a_crystal_that_swings_late_is_waited_for(emulated):
    _, statistics = booted(emulated, "--crystal-ms", "50")
    assert statistics["boot"]["boots"] == 1


def test_a_crystal_that_swings_later_than_any_wait_gets_its_time_from_watchdog_resets(emulated):
    board, statistics = run_until(emulated, 3, "--crystal-ms", "1500", may_violate=True)
    boots = statistics["boot"]["boots"]
    assert 2 <= boots <= 4 and board.log.count(": watchdog") == boots - 1
    assert statistics["boot"]["driven_us"] is not None
    # Which is what the strict board says of it, and nothing else.
    assert all("crystal oscillator that is not stable yet" in text for text in statistics["violations"])


def test_without_a_crystal_the_board_starts_again_and_again_in_the_dark(emulated):
    board, statistics = run_until(emulated, 8, "--crystal-ms", "1000000", may_violate=True)
    assert 5 <= statistics["boot"]["boots"] <= 20
    assert statistics["boot"]["driven_us"] is None


# Starts a board, takes its exposures, and dies as one that was killed: at once, or when told to.
PARENT = """
import os, signal, socket, subprocess, sys
listener = socket.socket(socket.AF_UNIX)
listener.bind("stage.sock")
listener.listen(1)
command = ["node", sys.argv[1], "--image", sys.argv[2], "--usb", "board.sock", "--exposures", "stage.sock"]
print(subprocess.Popen(command).pid, flush=True)
stage, _ = listener.accept()
if sys.argv[3] == "later":
    sys.stdin.readline()
os.kill(os.getpid(), signal.SIGKILL)
"""


@pytest.mark.parametrize("when", ["at once", "later"])
def test_a_board_whose_parent_was_killed_ends_by_itself_also_while_it_starts_and_while_it_plays(when, tmp_path):
    parent = subprocess.Popen([sys.executable, "-c", PARENT, ROOT / "tools/stagesim/board/board.mjs", IMAGE, when], cwd=tmp_path,
                              stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    board = int(parent.stdout.readline())
    try:
        if when == "later":
            while not (tmp_path / "board.sock").exists():
                time.sleep(0.05)
            link = Link(Usb(tmp_path / "board.sock"))
            link.play(paper_program(cycles=0))  # whose exposures nobody reads: it is held back
        _, log = parent.communicate("\n", timeout=60)  # ends when the board, too, has closed its stderr
        assert "whoever started this board has gone" in log
    except subprocess.TimeoutExpired:
        os.kill(board, signal.SIGKILL)
        raise
