# SPDX-License-Identifier: MIT
# The board says who it is, to friend and stranger.
import re
import subprocess
import sys

import pytest

from ols_board import wire
from ols_board.board import ROOT, BoardError

sys.path.insert(0, str(ROOT / "firmware/tools"))
import shift_rates  # noqa: E402

HASH_TOOL = ROOT / "protocol/layout_hash.py"
WIRE_H = ROOT / "protocol/wire.h"


def layout_hash(header):
    text = subprocess.run([sys.executable, HASH_TOOL, header], check=True, capture_output=True, text=True).stdout
    return int(re.search(r"0x([0-9a-f]{16})", text).group(1), 16)


def test_hello_tells_layout_chain_and_clock(emulated):
    hello = emulated().plug().hello(layout_hash(WIRE_H))
    assert hello["layout_hash"] == layout_hash(WIRE_H)
    assert (hello["chain_bits"], hello["slots_max"], hello["tick_hz"]) == (176, 1024, 125_000_000)


def test_the_board_id_is_the_flash_chips_unique_number(emulated):
    hello = emulated("--board-id", "0123456789abcdef").plug().hello(0)
    assert hello["board_id"].hex() == "0123456789abcdef"


def test_the_manuals_shift_rates_are_what_the_board_reckons_with(emulated):
    hello = emulated().plug().hello(0)
    assert hello["shift_ticks"] == shift_rates.shift_ticks(hello["chain_bits"], 1)
    assert hello["slot_gap_ticks"] == shift_rates.GAP_TICKS
    manual = (ROOT / "docs/hardware.md").read_text()
    assert manual == shift_rates.with_table(manual, 176), "run: firmware/tools/shift_rates.py --write docs/hardware.md"


@pytest.mark.parametrize("name", ("pico", "feather_can"))
def test_hello_names_the_board_whose_pins_the_image_drives(emulated, name):
    hello = emulated(image=ROOT / "build/firmware" / name / "stage.elf").plug().hello(0)
    assert hello["board"].rstrip(b"\0").decode() == name


def test_a_host_of_another_layout_still_learns_the_boards_hash_and_can_refuse(emulated, tmp_path):
    changed = tmp_path / "wire.h"
    changed.write_text(WIRE_H.read_text().replace("uint32_t exposure_ticks;", "uint64_t exposure_ticks;"))
    theirs = layout_hash(changed)
    hello = emulated().plug().hello(theirs)
    assert hello["layout_hash"] == layout_hash(WIRE_H) != theirs


def test_the_boot_nonce_differs_after_a_reset(emulated):
    board = emulated("--inject", "reset@40000000")
    link = board.plug()
    before = link.hello(0)["boot_nonce"]
    with pytest.raises(ConnectionError):
        while True:
            link.status()
    after = board.plug().hello(0)["boot_nonce"]
    assert before != after


def test_an_unknown_message_is_refused_by_name(emulated):
    with pytest.raises(BoardError, match="unknown message"):
        emulated().plug().ask(0x55)


def test_a_damaged_frame_is_skipped_and_the_next_one_answered(emulated):
    link = emulated().plug()
    damaged = bytearray(wire.frame(wire.STATUS, 7))
    damaged[-1] ^= 1
    assert link.usb.write(bytes(damaged)) == 0
    assert link.status()["state"] == wire.IDLE
