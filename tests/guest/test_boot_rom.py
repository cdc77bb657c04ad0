# SPDX-License-Identifier: MIT
"""The boot ROM that the tests of flashing plug in, asked by its packets, without a guest: that it refuses, stalls and writes as the
RP2040 datasheet says."""
import struct

import pytest
from boot_rom import BULK_IN, BULK_OUT, EXIT_XIP, FLASH_ERASE, MAGIC, OK, READ, REBOOT, STALL, WRITE, BootRom, Refusal
from flash_chip import FLASH_START, FlashChip
from usb_port import IN, OUT

WAITS = None


class Host:
    """The other end: each transfer's (status, data), or WAITS while the device does not take or give."""

    def __init__(self, flash):
        self.rom, self.tag, self.token, self.answers = BootRom(flash), 0, 100, {}
        self.rom.start(lambda tag, status, data: self.answers.update({tag: (status, data)}), lambda: None)
        self.control(0x00, 9, 1)

    def _submit(self, *transfer):
        self.tag += 1
        self.rom.submit(self.tag, *transfer)
        return self.answers.get(self.tag, WAITS)

    def control(self, kind, request, value=0, index=0, length=0):
        return self._submit(0, kind >> 7, struct.pack("<BBHHH", kind, request, value, index, length), b"", length)

    def write(self, data):
        return self._submit(BULK_OUT, OUT, bytes(8), data, len(data))

    def read(self, capacity=64):
        return self._submit(BULK_IN, IN, bytes(8), b"", capacity)

    def command(self, number, address=0, count=0, argument_bytes=8, transfer_bytes=0):
        self.token += 1
        return self.write(struct.pack("<IIBBHIII8x", MAGIC, self.token, number, argument_bytes, 0, transfer_bytes, address, count))

    def status(self):
        return struct.unpack("<IIBB6x", self.control(0xC1, 0x42, index=1, length=16)[1])

    def reset(self):
        return self.control(0x41, 0x41, index=1)

    def clear_halts(self):
        assert [self.control(0x02, 1, index=endpoint)[0] for endpoint in (BULK_OUT, BULK_IN | 0x80)] == [OK, OK]


@pytest.fixture
def flash():
    return FlashChip({FLASH_START + n: bytes(range(256)) for n in range(0, 8192, 256)})


@pytest.fixture
def host(flash):
    made = Host(flash)
    assert made.command(EXIT_XIP, argument_bytes=0)[0] == OK and made.read() == (OK, b"")
    return made


@pytest.mark.parametrize("refusal, asked", (
    (Refusal.UNKNOWN_CMD, dict(number=0x7F)),
    (Refusal.INVALID_CMD_LENGTH, dict(number=FLASH_ERASE, address=FLASH_START, count=4096, argument_bytes=4)),
    (Refusal.INVALID_TRANSFER_LENGTH, dict(number=WRITE, address=FLASH_START, count=256, transfer_bytes=255)),
    (Refusal.INVALID_TRANSFER_LENGTH, dict(number=FLASH_ERASE, address=FLASH_START, count=4096, transfer_bytes=4096)),
    (Refusal.INVALID_ADDRESS, dict(number=FLASH_ERASE, address=FLASH_START - 4096, count=4096)),
    (Refusal.INVALID_ADDRESS, dict(number=READ, address=FLASH_START + (16 << 20), count=256, transfer_bytes=256)),
    (Refusal.BAD_ALIGNMENT, dict(number=FLASH_ERASE, address=FLASH_START + 256, count=4096)),
    (Refusal.BAD_ALIGNMENT, dict(number=FLASH_ERASE, address=FLASH_START, count=256)),
    (Refusal.BAD_ALIGNMENT, dict(number=WRITE, address=FLASH_START + 16, count=256, transfer_bytes=256))), ids=str)
def test_what_the_datasheet_forbids_stalls_both_endpoints_says_why_and_changes_nothing(host, flash, refusal, asked):
    before = bytes(flash.cells)
    assert host.command(**asked)[0] == OK, "the packet itself is taken"
    assert host.status() == (host.token, refusal, asked["number"], 0)
    assert [host.write(bytes(256))[0], host.read()[0]] == [STALL, STALL]
    host.clear_halts()
    assert host.reset() == (OK, b"") and host.status() == (0, 0, 0, 0)
    assert host.command(READ, FLASH_START, 256, transfer_bytes=256)[0] == OK
    assert host.read(256) == (OK, bytes(range(256))) and host.write(b"") == (OK, b"")
    assert flash.cells == before


def test_after_a_stall_the_interfaces_reset_alone_leaves_the_toggles_apart_and_a_command_is_lost(host):
    assert host.command(EXIT_XIP, argument_bytes=0)[0] == OK and host.read() == (OK, b"")
    host.command(0x7F)  # the third packet: the device's toggle is 1, and the stall makes the host's 0
    assert host.write(bytes(32))[0] == STALL
    host.reset()
    assert host.command(EXIT_XIP, argument_bytes=0)[0] == OK and host.read() is WAITS
    assert host.status() == (0, 0, 0, 0)
    host.clear_halts()
    host.reset()
    assert host.command(EXIT_XIP, argument_bytes=0)[0] == OK and host.status() == (host.token, 0, EXIT_XIP, 0)


def test_flash_erases_to_ones_takes_only_zeros_and_fills_its_last_page(host, flash):
    assert host.command(FLASH_ERASE, FLASH_START, 4096)[0] == OK and host.read() == (OK, b"")
    assert flash.cells[:4096] == b"\xff" * 4096 and flash.cells[4096:4352] == bytes(range(256))
    for data in (b"\x3c" * 300, b"\xf0" * 300):
        assert host.command(WRITE, FLASH_START, 300, transfer_bytes=300)[0] == OK
        assert host.write(data)[0] == OK and host.read() == (OK, b"")
    assert flash.cells[:512] == b"\x30" * 300 + bytes(212)
    assert host.rom.violations == []


def test_what_is_not_its_turn_waits_and_after_reboot_nothing_is_done(host, flash):
    assert host.read() is WAITS
    waiting = host.tag
    assert host.command(FLASH_ERASE, FLASH_START, 4096)[0] == OK
    assert host.answers[waiting] == (OK, b"")
    assert host.command(REBOOT, argument_bytes=12)[0] == OK
    before = bytes(flash.cells)
    assert host.command(FLASH_ERASE, FLASH_START + 4096, 4096) is WAITS
    host.rom.delay_ms = 1_000_000
    assert host.read() == (OK, b"")
    assert host.status()[1:3] == (Refusal.REBOOTING, FLASH_ERASE) and flash.cells == before
    host.rom.close()
