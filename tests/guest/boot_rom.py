# SPDX-License-Identifier: MIT
"""The RP2040 in its boot loader, as a device for the guest's USB port: PICOBOOT over a flash chip (RP2040 datasheet 2.8.5), by packets.

What the host may count on is the datasheet's; it refuses what that says is refused, and stalls. Two things that it does not say are
from the boot ROM's published source (raspberrypi/pico-bootrom-rp2040): the control requests are vendor requests (2.8.5.5 prints the
bits of class requests), and INTERFACE_RESET leaves the data toggles. Where that source does less than the datasheet says (it
acknowledges an erase that it refuses), the datasheet counts.

Left out: the drive (its interface is described, its endpoints answer nothing, so nothing interleaves), memory other than flash, EXEC,
VECTORIZE_FLASH, and time: erasing takes none, and the delay of REBOOT begins when the host has taken the acknowledgement, since the
guest may be held up for longer than any delay. `violations` has what a host does that hangs a real one or is undefined there."""
import collections
import enum
import struct
import threading

from flash_chip import FLASH_BYTES, FLASH_START, PAGE_BYTES, SECTOR_BYTES
from usb_port import CANCELLED

OK, STALL, OVERFLOW = 0, -1, -5
PACKET_BYTES = 64
WINDOW_BYTES = 16 << 20  # of addresses for flash (2.6.3)

# 2.8.5.1 and .2; the drive's interface is 2.8.4's, by USB Mass Storage Bulk-Only 1.0 chapter 4.
DEVICE = struct.pack("<BBHBBBBHHHBBBB", 18, 1, 0x0110, 0, 0, 0, 64, 0x2E8A, 0x0003, 0x0100, 1, 2, 3, 1)
STRINGS = ("", "Raspberry Pi", "RP2 Boot", "E0C9125B0D9B")  # all chips of a stepping say the same serial number
PICOBOOT_INTERFACE, BULK_OUT, BULK_IN = 1, 3, 4


def interface(number, kind, *endpoints):
    return struct.pack("<9B", 9, 4, number, 0, len(endpoints), *kind, 0) + b"".join(
        struct.pack("<BBBBHB", 7, 5, address, 2, PACKET_BYTES, 0) for address in endpoints)


INTERFACES = interface(0, (8, 6, 0x50), 0x81, 0x02) + interface(PICOBOOT_INTERFACE, (0xFF, 0, 0), BULK_OUT, BULK_IN | 0x80)
CONFIGURATION = struct.pack("<BBHBBBBB", 9, 2, 9 + len(INTERFACES), 2, 1, 0, 0x80, 250) + INTERFACES

COMMAND = struct.Struct("<IIBBHI16s")
MAGIC = 0x431FD10B
EXCLUSIVE_ACCESS, REBOOT, FLASH_ERASE, READ, WRITE, EXIT_XIP, ENTER_XIP = 0x01, 0x02, 0x03, 0x84, 0x05, 0x06, 0x07
ARGUMENT_BYTES = {EXCLUSIVE_ACCESS: 1, REBOOT: 12, FLASH_ERASE: 8, READ: 8, WRITE: 8, EXIT_XIP: 0, ENTER_XIP: 0}  # 2.8.5.4


class Refusal(enum.IntEnum):
    """2.8.5.5.2, dStatusCode."""
    UNKNOWN_CMD = 1
    INVALID_CMD_LENGTH = 2
    INVALID_TRANSFER_LENGTH = 3
    INVALID_ADDRESS = 4
    BAD_ALIGNMENT = 5
    REBOOTING = 7


class Phase(enum.Enum):
    COMMAND, DATA_OUT, DATA_IN, ACKNOWLEDGE_OUT, ACKNOWLEDGE_IN = range(5)


TAKES = (Phase.COMMAND, Phase.DATA_OUT, Phase.ACKNOWLEDGE_OUT)


class Transfer:
    def __init__(self, tag, data, capacity):
        self.tag, self.data, self.capacity, self.done = tag, data, capacity, 0


class Pipe:
    """A bulk endpoint with the transfers that the host has begun, and the data toggle of either end (USB 2.0 8.6). The host's end
    is that of Linux on xHCI: a stall begins its toggle anew (drivers/usb/host/xhci-ring.c, a hard reset of the endpoint)."""

    def __init__(self):
        self.transfers = collections.deque()
        self.reset()

    def reset(self):
        """As SET_CONFIGURATION and CLEAR_FEATURE(ENDPOINT_HALT) do on both ends (USB 2.0 9.4.5)."""
        self.is_halted = False
        self.device_toggle = self.host_toggle = 0

    def is_in_step(self):
        return self.device_toggle == self.host_toggle


class BootRom:
    def __init__(self, flash):
        self.flash = flash
        self.commands = []  # (id, address, bytes) of those that were carried out
        self.violations = []
        self.before_page = lambda address: None  # a test's own, before a page is written
        self.timer = None

    def start(self, answer, gone):
        self.answer, self.gone, self.is_plugged = answer, gone, True
        self.out, self.into = Pipe(), Pipe()
        self.configuration, self.rebooting, self.listens = 0, False, False  # the flash chip does, after EXIT_XIP
        self._forget()

    def close(self):
        self.is_plugged = False
        if self.timer:
            self.timer.cancel()

    def submit(self, tag, endpoint, _direction, setup, data, capacity):
        if endpoint == 0:
            reply = self._control(*struct.unpack("<BBHHH", setup))
            self.answer(tag, STALL if reply is None else OK, (reply or b"")[:capacity])
        elif endpoint in (BULK_OUT, BULK_IN):
            (self.out if endpoint == BULK_OUT else self.into).transfers.append(Transfer(tag, data, capacity))
        else:
            self.answer(tag, STALL, b"")
        while self.is_plugged and (self._refuse_halted() or self._take_packet() or self._give_packet()):
            pass

    def cancel(self, tag):
        for pipe in (self.out, self.into):
            for transfer in list(pipe.transfers):
                if transfer.tag == tag:
                    pipe.transfers.remove(transfer)
                    self.answer(tag, CANCELLED, b"")

    # ---- Control requests: USB 2.0 9.4 and datasheet 2.8.5.5; None stalls.

    def _control(self, kind, request, value, index, length):
        if (kind, request, index) == (0x41, 0x41, PICOBOOT_INTERFACE):
            return self._reset_interface()
        if (kind, request, index, length) == (0xC1, 0x42, PICOBOOT_INTERFACE, 16):
            return struct.pack("<IIBB6x", *self.status)
        if (kind, request) == (0x80, 6):
            return self._descriptor(value >> 8, value & 0xFF)
        if (kind, request) == (0x80, 8):
            return bytes([self.configuration])
        if (kind, request) == (0x00, 9):
            self.configuration = value
            self.out.reset(), self.into.reset()
            self._forget()
            return b""
        return self._endpoint_request(kind, request, {BULK_OUT: self.out, BULK_IN | 0x80: self.into}.get(index))

    def _endpoint_request(self, kind, request, pipe):
        if (kind, request) in ((0x80, 0), (0x81, 0)):
            return bytes(2)
        if (kind, request) == (0x82, 0) and pipe:
            return bytes([pipe.is_halted, 0])
        if (kind, request) == (0x02, 1) and pipe:  # ENDPOINT_HALT, an endpoint's only feature
            pipe.reset()
            return b""
        return None

    def _descriptor(self, kind, index):
        if kind == 3 and index == 0:
            return struct.pack("<BBH", 4, 3, 0x0409)
        if kind == 3 and index < len(STRINGS):
            text = STRINGS[index].encode("utf-16-le")
            return bytes([2 + len(text), 3]) + text
        return {1: DEVICE, 2: CONFIGURATION}.get(kind)

    def _reset_interface(self):
        """2.8.5.5.1."""
        self.out.is_halted = self.into.is_halted = False
        self._forget()
        return b""

    def _forget(self):
        self.phase, self.status, self.exclusive = Phase.COMMAND, [0, 0, 0, 0], 0
        self.given = self.taken = b""

    # ---- Packets; each of these says whether it has brought anything forward.

    def _refuse_halted(self):
        for pipe in (self.out, self.into):
            if pipe.is_halted and pipe.transfers:
                pipe.host_toggle = 0
                self.answer(pipe.transfers.popleft().tag, STALL, b"")
                return True
        return False

    def _take_packet(self):
        if self.phase not in TAKES or not self.out.transfers:
            return False
        transfer = self.out.transfers[0]
        packet = transfer.data[transfer.done : transfer.done + PACKET_BYTES]
        transfer.done += len(packet)
        is_new = self.out.is_in_step()  # otherwise taken for one that came before: acknowledged, and dropped
        self.out.host_toggle ^= 1
        if transfer.done == len(transfer.data):
            self.answer(self.out.transfers.popleft().tag, OK, b"")
        if is_new:
            self.out.device_toggle ^= 1
            self._packet(packet)
        return True

    def _give_packet(self):
        if self.phase not in (Phase.DATA_IN, Phase.ACKNOWLEDGE_IN) or not self.into.transfers:
            return False
        transfer = self.into.transfers[0]
        packet, self.given = self.given[:PACKET_BYTES], self.given[PACKET_BYTES:]
        if self.into.is_in_step():
            transfer.data += packet
            self.into.host_toggle ^= 1
            if len(transfer.data) > transfer.capacity:
                self.answer(self.into.transfers.popleft().tag, OVERFLOW, b"")
            elif len(packet) < PACKET_BYTES or len(transfer.data) == transfer.capacity:
                self.answer(self.into.transfers.popleft().tag, OK, transfer.data)
        self.into.device_toggle ^= 1
        if not self.given:
            self._given()
        return True

    def _given(self):
        if self.phase == Phase.DATA_IN:
            self.phase = Phase.ACKNOWLEDGE_OUT
            return
        self.phase = Phase.COMMAND
        if self.rebooting:
            self.timer = threading.Timer(self.delay_ms / 1000, self._restart)
            self.timer.start()

    def _restart(self):
        if self.is_plugged:
            self.is_plugged = False
            self.gone()

    # ---- Commands: 2.8.5.4.

    def _packet(self, packet):
        if self.phase == Phase.COMMAND:
            self._command(packet)
        elif self.phase == Phase.DATA_OUT:
            self._data(packet)
        else:
            if packet:
                self.violations.append(f"an acknowledgement of {len(packet)} bytes")
            self._acknowledged()

    def _halt(self):
        self.out.is_halted = self.into.is_halted = True

    def _command(self, packet):
        if len(packet) != COMMAND.size or struct.unpack_from("<I", packet)[0] != MAGIC:
            self._halt()
            return
        _, token, self.id, argument_bytes, _, transfer_bytes, arguments = COMMAND.unpack(packet)
        self.status = [token, 0, self.id, 0]
        self.address, self.count, self.delay_ms = struct.unpack_from("<III", arguments)
        refusal = self._refusal(argument_bytes, transfer_bytes)
        if refusal:
            self.status[1] = refusal
            self._halt()
            return
        if self.id not in (EXCLUSIVE_ACCESS, EXIT_XIP, ENTER_XIP, REBOOT) and not self.listens:
            self.violations.append(f"command {self.id:#04x} before EXIT_XIP")
        self._begin(arguments)

    def _refusal(self, argument_bytes, transfer_bytes):
        if self.rebooting:
            return Refusal.REBOOTING
        if self.id not in ARGUMENT_BYTES:
            return Refusal.UNKNOWN_CMD
        if argument_bytes != ARGUMENT_BYTES[self.id]:
            return Refusal.INVALID_CMD_LENGTH
        if transfer_bytes != (self.count if self.id in (READ, WRITE) else 0):
            return Refusal.INVALID_TRANSFER_LENGTH
        if self.id in (FLASH_ERASE, READ, WRITE):
            unit = SECTOR_BYTES if self.id == FLASH_ERASE else PAGE_BYTES
            if not FLASH_START <= self.address <= self.address + self.count <= FLASH_START + WINDOW_BYTES:
                return Refusal.INVALID_ADDRESS
            if self.address % unit or self.id == FLASH_ERASE and self.count % unit:
                return Refusal.BAD_ALIGNMENT
        return None

    def _begin(self, arguments):
        offset = self.address - FLASH_START
        if self.id == READ and self.count:
            self.given, self.phase = self.flash.read(offset, self.count), Phase.DATA_IN
        elif self.id == WRITE and self.count:
            self.taken, self.phase = b"", Phase.DATA_OUT
        else:
            self.phase = Phase.ACKNOWLEDGE_IN
        self.status[3] = int(self.phase != Phase.ACKNOWLEDGE_IN)
        if self.id == EXCLUSIVE_ACCESS:
            self.exclusive = arguments[0]
        elif self.id == REBOOT:
            self.rebooting = True
            if self.address:
                self.violations.append("a reboot into memory")
        elif self.id in (EXIT_XIP, ENTER_XIP):
            self.listens = self.id == EXIT_XIP
        elif self.id == FLASH_ERASE and self.listens:
            for at in range(offset, offset + self.count, SECTOR_BYTES):
                self.flash.erase_sector(at)
        if self.phase == Phase.ACKNOWLEDGE_IN:
            self._carried_out()

    def _data(self, packet):
        """2.8.5.4.5: by pages, the last filled with zeros."""
        self.taken += packet
        if len(self.taken) > self.count or len(packet) < PACKET_BYTES and len(self.taken) < self.count:
            self.violations.append(f"a packet of {len(packet)} bytes among the data")
        is_last = len(self.taken) >= self.count
        if len(self.taken) % PAGE_BYTES == 0 or is_last:
            at = (len(self.taken) - 1) // PAGE_BYTES * PAGE_BYTES
            self.before_page(self.address + at)
            if self.is_plugged and self.listens:
                self.flash.program(self.address + at - FLASH_START, self.taken[at : at + PAGE_BYTES].ljust(PAGE_BYTES, b"\0"))
        if is_last and self.is_plugged:
            self.phase, self.status[3] = Phase.ACKNOWLEDGE_IN, 0
            self._carried_out()

    def _acknowledged(self):
        self.phase, self.status[3] = Phase.COMMAND, 0
        self._carried_out()

    def _carried_out(self):
        self.commands.append((self.id, self.address, self.count))
