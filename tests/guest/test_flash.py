# SPDX-License-Identifier: MIT
"""stagectl flashes a board by libusb and the kernel's USB: from the emulated board to the boot ROM at the other end of the port, and to
an emulated board that runs what the boot ROM has in its flash."""
import grp
import json
import sys

import pytest
from boot_rom import EXCLUSIVE_ACCESS, EXIT_XIP, FLASH_ERASE, READ, REBOOT, WRITE, BootRom
from conftest import INSIDE, STAGECTL, UF2, settle
from flash_chip import FLASH_BYTES, FLASH_START, PAGE_BYTES, SECTOR_BYTES, FlashChip, uf2_pages
from usb_port import BoardCable

SERIAL = "00f1e2d3c4b5a697"
NOBODY = 65534
NOTE = FLASH_START + FLASH_BYTES - SECTOR_BYTES  # which board the image is for, while its label is not there

NEW = uf2_pages(UF2)
# The label's fields (protocol/image_label.h), which hello has, too.
BOARD_AT, VERSION_AT, BOARD_BYTES, VERSION_BYTES = FLASH_START + 0x118, FLASH_START + 0x128, 16, 24


def field(pages, at, count):
    page = at - at % PAGE_BYTES
    return pages[page][at - page : at - page + count]


def changed(at, count, text):
    """The new image with another text in that field, wherever it stands."""
    image = b"".join(NEW[address] for address in sorted(NEW))
    image = image.replace(field(NEW, at, count), text.encode().ljust(count, b"\0"))
    return {FLASH_START + n: image[n : n + PAGE_BYTES] for n in range(0, len(image), PAGE_BYTES)}


VERSION = field(NEW, VERSION_AT, VERSION_BYTES).rstrip(b"\0").decode()
OLD_VERSION = "9" * len(VERSION)  # hello has room for as much as the firmware was built with
OLD = changed(VERSION_AT, VERSION_BYTES, OLD_VERSION)


class Bench:
    """A board at the guest's USB port, in each of its two shapes; both have the same flash chip."""

    def __init__(self, guest, port, emulated, flash, folder):
        self.guest, self.port, self.emulated, self.flash, self.folder = guest, port, emulated, flash, folder

    def plug_firmware(self):
        """What the boot ROM would start. Nobody in the guest waits for it while this machine gets it up."""
        self.guest.pause()
        try:
            board = self.emulated("--board-id", SERIAL, image=self.flash.write_uf2(self.folder / "flash.uf2"))
            cable = BoardCable(board)
        finally:
            self.guest.resume()
        self.port.plug(cable)
        return board

    def plug_loader(self):
        rom = BootRom(self.flash)
        self.port.plug(rom)
        return rom

    def finish(self, flashing):
        """The loader at the port is to write the image and to start it; what it holds then is started."""
        rom = self.port.device
        self.port.wait_until_empty(flashing)
        self.plug_firmware()
        assert flashing.wait() == 0, flashing.errors
        assert flashing.output == f"board usb:{SERIAL} runs pico {VERSION}\n"
        assert self.flash.holds(NEW) and self.flash.page_is_erased(NOTE - FLASH_START)
        assert rom.violations == [] and rom.exclusive
        return rom.commands


@pytest.fixture
def bench(guest, port, emulated, tmp_path):
    made = Bench(guest, port, emulated, FlashChip(OLD), tmp_path)
    yield made
    port.unplug()


def flash(guest, *arguments):
    return guest.start([STAGECTL, "flash", UF2, *arguments])


def test_a_running_board_leaves_is_written_and_runs_what_was_written(guest, emulated, bench, stagectl):
    board = bench.plug_firmware()
    settle(guest)
    assert json.loads(stagectl("status", "--json", "--board", "usb:").stdout)["firmware"] == OLD_VERSION
    flashing = flash(guest, "--board", "usb:" + SERIAL)
    bench.port.wait_until_empty(flashing)
    emulated.end(board)
    assert "in the USB boot loader" in board.log
    bench.plug_loader()
    commands = bench.finish(flashing)
    assert [command for command, *_ in commands[:2]] == [EXCLUSIVE_ACCESS, EXIT_XIP]
    assert commands[-1][0] == REBOOT
    changes = [(command, address) for command, address, _ in commands if command in (FLASH_ERASE, WRITE)]
    assert changes[:3] == [(FLASH_ERASE, NOTE), (WRITE, NOTE), (FLASH_ERASE, FLASH_START)]
    assert changes[-2:] == [(WRITE, FLASH_START), (FLASH_ERASE, NOTE)]
    for n, (command, *what) in enumerate(commands):
        assert command != WRITE or commands[n + 1] == (READ, *what), "read back before anything else"


def test_after_a_cable_pulled_in_the_middle_of_writing_the_same_command_completes(guest, bench):
    rom = bench.plug_loader()
    settle(guest, "RP2 Boot")
    rom.before_page = lambda address: address == FLASH_START + 0x4300 and bench.port.unplug()
    flashing = flash(guest)
    assert flashing.wait() == 1
    assert "unplugged" in flashing.errors and "run the same command again" in flashing.errors, flashing.errors
    assert [address for command, address, _ in rom.commands if command == WRITE][-1] == FLASH_START + 0x3000
    assert bench.flash.holds({FLASH_START + 0x4200: NEW[FLASH_START + 0x4200]}) and bench.flash.page_is_erased(0x4300)
    assert bench.flash.page_is_erased(0), "nothing that the boot ROM would start"
    bench.plug_loader()
    settle(guest, "RP2 Boot")
    bench.finish(flash(guest))


def test_without_permission_the_udev_rule_is_named_and_with_it_the_boot_loader_answers(guest, bench, stagectl, udev_rules):
    plugdev = grp.getgrnam("plugdev").gr_gid
    bench.flash = FlashChip(changed(BOARD_AT, BOARD_BYTES, "feather_can"))
    before = bytes(bench.flash.cells)
    rom = bench.plug_loader()
    settle(guest, "RP2 Boot")
    refused = stagectl("flash", UF2, user=NOBODY, groups=[plugdev])
    assert refused.returncode == 1 and "install the udev rule 60-open-light-stage.rules" in refused.stderr, refused.stderr
    assert rom.commands == []
    udev_rules.install()
    bench.port.unplug()
    rom = bench.plug_loader()
    settle(guest, "RP2 Boot")
    other = stagectl("flash", UF2, user=NOBODY, groups=[plugdev])
    assert other.returncode == 1 and "for the board 'pico' and this is a 'feather_can'" in other.stderr, other.stderr
    assert [command for command, *_ in rom.commands] == [EXCLUSIVE_ACCESS, EXIT_XIP, READ]
    assert bench.flash.cells == before


def test_a_flash_chip_that_does_not_take_a_bit_is_named_and_nothing_is_started(guest, bench, stagectl):
    page = FLASH_START + 0x2100
    at = page - FLASH_START + next(n for n, byte in enumerate(NEW[page]) if byte & 1)
    bench.flash.stuck = {at: 1}
    rom = bench.plug_loader()
    settle(guest, "RP2 Boot")
    done = stagectl("flash", UF2)
    assert done.returncode == 1 and f"flash at {FLASH_START + at:08x} does not keep what is written" in done.stderr, done.stderr
    assert rom.commands[-1] == (READ, FLASH_START + 0x2000, SECTOR_BYTES)
    assert bench.flash.page_is_erased(0) and rom.is_plugged


def test_a_boot_loader_that_an_earlier_program_left_stalled_is_taken_over(guest, bench):
    bench.plug_loader()
    settle(guest, "RP2 Boot")
    earlier = guest.run([sys.executable, INSIDE / "refused_host.py"])
    assert earlier.returncode == 0, earlier.stderr
    bench.finish(flash(guest))
