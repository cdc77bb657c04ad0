# SPDX-License-Identifier: MIT
"""The memory of a USB3 Vision camera: bootstrap registers (GenCP 1.1, "Technology agnostic bootstrap register map"; USB3 Vision 1.0.1,
"Technology specific bootstrap registers", "Streaming interface register map"), which are little-endian, the manifest, the GenICam
description, and the features' registers where that has them, with the byte order that it says.

What is not there, or may not be read or written, is refused as GenCP 1.1 table "status codes" says."""
import dataclasses
import enum
import struct
from xml.etree import ElementTree


class Status(enum.IntEnum):
    SUCCESS = 0x0000
    NOT_IMPLEMENTED = 0x8001
    INVALID_PARAMETER = 0x8002
    INVALID_ADDRESS = 0x8003
    WRITE_PROTECT = 0x8004
    ACCESS_DENIED = 0x8006


class Refused(Exception):
    def __init__(self, status):
        super().__init__(status)
        self.status = status


@dataclasses.dataclass
class Range:
    name: str
    address: int
    data: bytearray
    access: str = "RO"


SBRM, SIRM, MANIFEST, DESCRIPTION = 0x0400, 0x0600, 0x0800, 0x20000
TRANSFER_BYTES = 1024  # at most, of a command or its acknowledgement

# Address, layout, first value; the names that the standard gives them.
ABRM_FIELDS = {
    "GENCP_VERSION": (0x000, "<I", 0x00010001), "DEVICE_CAPABILITY": (0x1C4, "<Q", 1 << 3 | 1 << 9 | 1 << 11),
    "MAXIMUM_DEVICE_RESPONSE_TIME": (0x1CC, "<I", 0), "MANIFEST_TABLE_ADDRESS": (0x1D0, "<Q", MANIFEST),
    "SBRM_ADDRESS": (0x1D8, "<Q", SBRM), "DEVICE_CONFIGURATION": (0x1E0, "<Q", 0), "TIMESTAMP": (0x1F0, "<Q", 0),
    "TIMESTAMP_LATCH": (0x1F8, "<I", 0), "TIMESTAMP_INCREMENT": (0x1FC, "<Q", 1)}
ABRM_TEXTS = {"MANUFACTURER_NAME": 0x004, "MODEL_NAME": 0x044, "DEVICE_VERSION": 0x0C4, "MANUFACTURER_INFO": 0x104, "SERIAL_NUMBER": 0x144}
SBRM_FIELDS = {
    "U3V_VERSION": (0x00, "<I", 0x00010000), "U3VCP_CAPABILITY": (0x04, "<Q", 1), "U3VCP_CONFIGURATION": (0x0C, "<Q", 0),
    "MAXIMUM_COMMAND_TRANSFER": (0x14, "<I", TRANSFER_BYTES), "MAXIMUM_ACKNOWLEDGE_TRANSFER": (0x18, "<I", TRANSFER_BYTES),
    "STREAM_CHANNELS": (0x1C, "<I", 1), "SIRM_ADDRESS": (0x20, "<Q", SIRM), "SIRM_LENGTH": (0x28, "<I", 0x30),
    "CURRENT_SPEED": (0x40, "<I", 1 << 3)}
SIRM_FIELDS = {
    "SI_INFO": (0x00, "<I", 0), "SI_CONTROL": (0x04, "<I", 0), "SI_REQUIRED_PAYLOAD": (0x08, "<Q", 0),
    "SI_REQUIRED_LEADER": (0x10, "<I", 52), "SI_REQUIRED_TRAILER": (0x14, "<I", 36), "SI_MAXIMUM_LEADER": (0x18, "<I", 0),
    "SI_PAYLOAD_SIZE": (0x1C, "<I", 0), "SI_PAYLOAD_COUNT": (0x20, "<I", 0), "SI_TRANSFER1": (0x24, "<I", 0),
    "SI_TRANSFER2": (0x28, "<I", 0), "SI_MAXIMUM_TRAILER": (0x2C, "<I", 0)}
WRITABLE = {"DEVICE_CONFIGURATION", "TIMESTAMP_LATCH", "SI_CONTROL", "SI_MAXIMUM_LEADER", "SI_PAYLOAD_SIZE", "SI_PAYLOAD_COUNT",
            "SI_TRANSFER1", "SI_TRANSFER2", "SI_MAXIMUM_TRAILER"}
RAW = 0  # a manifest entry's file type: a description that is not zipped


class Registers:
    """`before_read` and `after_write` are called with a range's name."""

    def __init__(self, description, texts, before_read, after_write):
        self.before_read, self.after_write = before_read, after_write
        self.ranges, self.layouts, self.choices, self.selectors = {}, {}, {}, {}
        for base, fields in ((0, ABRM_FIELDS), (SBRM, SBRM_FIELDS), (SIRM, SIRM_FIELDS)):
            for name, (address, layout, value) in fields.items():
                self._field(name, base + address, layout, "RW" if name in WRITABLE else "RO")
                self[name] = value
        for name, address in ABRM_TEXTS.items():
            self._add(Range(name, address, bytearray(texts[name].encode().ljust(64, b"\0"))))
        entry = struct.pack("<HBBIQQ32x", 0, 0, 1, 1 << 16 | RAW << 10, DESCRIPTION, len(description))
        self._add(Range("MANIFEST", MANIFEST, bytearray(struct.pack("<Q", 1) + entry.ljust(64, b"\0"))))
        self._add(Range("DESCRIPTION", DESCRIPTION, bytearray(description)))
        self._take_features(ElementTree.fromstring(description))

    def _add(self, added):
        self.ranges[added.name] = added

    def _field(self, name, address, layout, access):
        self.layouts[name] = layout
        self._add(Range(name, address, bytearray(struct.calcsize(layout)), access))

    def _take_features(self, root):
        """Of GenApi's nodes those that say where a feature's value lies: registers, named FEATUREReg, and enumerations' entries."""
        space = "{" + root.tag.partition("}")[0].strip("{") + "}"
        for node in root.iter(space + "Enumeration"):
            self.choices[node.get("Name")] = {entry.get("Name"): int(entry.findtext(space + "Value"))
                                              for entry in node.iter(space + "EnumEntry")}
        for kind in ("IntReg", "FloatReg"):
            for node in root.iter(space + kind):
                if not node.get("Name").endswith("Reg"):
                    continue  # a chunk's
                name = node.get("Name")[:-3]
                order = ">" if node.findtext(space + "Endianess") == "BigEndian" else "<"
                layout = order + ("d" if kind == "FloatReg" else {"4": "I", "8": "Q"}[node.findtext(space + "Length")])
                self._field(name, int(node.findtext(space + "Address"), 16), layout, node.findtext(space + "AccessMode"))
                index = node.find(space + "pIndex")
                if index is not None:  # a register for each value of a selector
                    self.selectors[name] = index.text
                    self.ranges[name].data *= 1 + max(self.choices[index.text].values())

    def _offset(self, name, of):
        return self.choices[self.selectors[name]][of] * struct.calcsize(self.layouts[name]) if of else 0

    def __getitem__(self, key):
        """A register's value, an entry's name of an enumeration; of (name, entry) that of a selector's entry."""
        name, of = key if isinstance(key, tuple) else (key, None)
        (value,) = struct.unpack_from(self.layouts[name], self.ranges[name].data, self._offset(name, of))
        entries = [entry for entry, number in self.choices.get(name, {}).items() if number == value]
        return entries[0] if entries else value

    def __setitem__(self, key, value):
        name, of = key if isinstance(key, tuple) else (key, None)
        value = self.choices.get(name, {}).get(value, value)
        struct.pack_into(self.layouts[name], self.ranges[name].data, self._offset(name, of), value)

    def __contains__(self, name):
        return name in self.ranges

    def _parts(self, address, count):
        """The ranges that so many bytes are in, without a hole: (range, first byte in it, how many)."""
        while count > 0:
            found = [one for one in self.ranges.values() if one.address <= address < one.address + len(one.data)]
            if not found:
                raise Refused(Status.INVALID_ADDRESS)
            at = address - found[0].address
            here = min(count, len(found[0].data) - at)
            yield found[0], at, here
            address, count = address + here, count - here

    def read(self, address, count):
        parts = list(self._parts(address, count))
        if any(part.access == "WO" for part, _, _ in parts):
            raise Refused(Status.ACCESS_DENIED)
        for part, _, _ in parts:
            self.before_read(part.name)
        return b"".join(bytes(part.data[at : at + here]) for part, at, here in parts)

    def write(self, address, data):
        """All of it, or nothing. A value that `after_write` refuses is taken back."""
        parts = list(self._parts(address, len(data)))
        if any(part.access == "RO" for part, _, _ in parts):
            raise Refused(Status.WRITE_PROTECT)
        done = 0
        for part, at, here in parts:
            before = bytes(part.data)
            part.data[at : at + here] = data[done : done + here]
            done += here
            try:
                self.after_write(part.name)
            except Refused:
                part.data[:] = before
                raise
