# SPDX-License-Identifier: MIT
"""A board's flash chip in memory, filled from UF2 files and written out as one (Microsoft's UF2 file format specification; RP2040
datasheet 2.8.4.2), for the boot ROM to write to and for an emulated board to start from."""
import struct

FLASH_START, FLASH_BYTES = 0x10000000, 2 << 20
SECTOR_BYTES, PAGE_BYTES = 4096, 256
BLOCK = struct.Struct("<8I476sI")
MAGIC, MAGIC_END, RP2040, FAMILY_PRESENT = (0x0A324655, 0x9E5D5157), 0x0AB16F30, 0xE48BFF56, 0x2000


def uf2_pages(path):
    """{address: the page's bytes}"""
    pages = {}
    data = path.read_bytes()
    assert len(data) % BLOCK.size == 0
    for block in BLOCK.iter_unpack(data):
        *magic, _, address, count, _, _, family, payload, end = block
        assert (tuple(magic), end, family, count) == (MAGIC, MAGIC_END, RP2040, PAGE_BYTES)
        pages[address] = payload[:count]
    return pages


class FlashChip:
    """Erases to ones and writes only zeros, as flash does; `stuck` has the bits, by offset, that stay zero."""

    def __init__(self, pages=None):
        self.cells = bytearray(b"\xff" * FLASH_BYTES)
        self.stuck = {}
        for address, page in (pages or {}).items():
            self.program(address - FLASH_START, page)

    # A chip that is smaller than the window it is seen in has only the low bits of an address.
    def erase_sector(self, offset):
        offset %= FLASH_BYTES
        self.cells[offset : offset + SECTOR_BYTES] = b"\xff" * SECTOR_BYTES
        for at, bits in self.stuck.items():
            self.cells[at] &= ~bits

    def program(self, offset, page):
        offset %= FLASH_BYTES
        for n, byte in enumerate(page):
            self.cells[offset + n] &= byte

    def read(self, offset, count):
        return bytes(self.cells[(offset + n) % FLASH_BYTES] for n in range(count))

    def page_is_erased(self, offset):
        return self.cells[offset : offset + PAGE_BYTES] == b"\xff" * PAGE_BYTES

    def holds(self, pages):
        return all(self.read(address - FLASH_START, PAGE_BYTES) == page for address, page in pages.items())

    def write_uf2(self, path):
        """Everything that is not erased."""
        kept = [offset for offset in range(0, FLASH_BYTES, PAGE_BYTES) if not self.page_is_erased(offset)]
        with open(path, "wb") as file:
            for number, offset in enumerate(kept):
                file.write(BLOCK.pack(*MAGIC, FAMILY_PRESENT, FLASH_START + offset, PAGE_BYTES, number, len(kept), RP2040,
                                      self.read(offset, PAGE_BYTES), MAGIC_END))
        return path
