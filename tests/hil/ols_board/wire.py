# SPDX-License-Identifier: MIT
# The board's messages and frames, packed by `struct` from protocol/PROTOCOL.md alone: independent of the C code.
import struct
import zlib

SYNC = 0x534C
REPLY = 0x80
HELLO, LOAD_BEGIN, LOAD_CHUNK, LOAD_END, ARM, START, STOP, STATUS, READ_TRIGGER_LOG, CLEAR_FAULT, SWAP = range(1, 12)
REBOOT_TO_BOOTLOADER = 0x0D
ERROR = 0x7F

BASIS, TRACKING, MATTE, DARK = range(4)
NEXT_NONE, NEXT_LOADING, NEXT_READY, NEXT_SWAPPING = range(4)
IDLE, LOADED, ARMED, PLAYING, DONE, FAULT, WAITING = range(7)
FAULTS = ("none", "timeline starved", "shifter starved", "slipped", "host lost", "watchdog", "processor", "bad memory",
          "emergency stop", "over-temperature", "open lamp", "heartbeat", "over-duty", "light stuck")
ERROR_BAD_STATE, ERROR_BAD_OFFSET, ERROR_BAD_CRC, ERROR_FAULT_LATCHED, ERROR_OVER_LIMIT, ERROR_NOT_SAFE = 3, 4, 5, 7, 8, 9

HELLO_REPLY = struct.Struct("<Q24s8sIIIHHIIHHII16s")
ARM_REQUEST = struct.Struct("<IB3xI")
BY_COMMAND, BY_EDGE, EACH_CYCLE_BY_EDGE = range(3)
STATUS_REPLY = struct.Struct("<BBHIQQIIIIB3xII")
SWAP_REPLY = struct.Struct("<IB3x")
READ_LOG = struct.Struct("<IH2x")
LOG_REPLY = struct.Struct("<IIIHH")
LOG_ENTRY = struct.Struct("<QIIHBB")
READ_DIGESTS = 0x0C
DIGESTS_REPLY = struct.Struct("<IIIHH")
DIGEST = struct.Struct("<QQIIIHBB")
DIGEST_INCOMPLETE = 1
SPEAKS_CAN, KEEPS_DIGESTS = 32, 64  # capabilities
ERROR_REPLY = struct.Struct("<HH116s")
LOAD_BEGIN_REQUEST = struct.Struct("<HHIIII")
TRIGGER = struct.Struct("<iIBBH")
SLOT = struct.Struct("<BBBBIIi")


def frame(message_type, request_id, payload=b""):
    """One frame: header with its check, payload, CRC-32 of both."""
    head = struct.pack("<HHHH", SYNC, len(payload), message_type, request_id)
    head += struct.pack("<H", zlib.crc32(head) & 0xFFFF)
    return head + payload + struct.pack("<I", zlib.crc32(head + payload))


def take_frame(stream):
    """Takes the first whole frame off the bytearray `stream`: (type, request id, payload), or None if there is none."""
    if len(stream) < 10:
        return None
    sync, size, message_type, request_id, check = struct.unpack_from("<HHHHH", stream)
    assert sync == SYNC and check == zlib.crc32(stream[:8]) & 0xFFFF, "the stream does not begin with a frame"
    if len(stream) < 14 + size:
        return None
    (crc,) = struct.unpack_from("<I", stream, 10 + size)
    assert crc == zlib.crc32(stream[: 10 + size]), "bad CRC in a frame from the board"
    payload = bytes(stream[10 : 10 + size])
    del stream[: 14 + size]
    return message_type, request_id, payload


def pattern_words(bits):
    """A list of 0 and 1, chain bit 0 first, as 32-bit words, most significant first."""
    padded = list(bits) + [0] * (-len(bits) % 32)
    return [int("".join(map(str, padded[n : n + 32])), 2) for n in range(0, len(padded), 32)]


def patterns(slot):
    """The patterns of a slot as lists of 0 and 1: its "bits", or the planes of its "levels", most significant first."""
    if "levels" not in slot:
        return [slot["bits"]]
    return [[level >> plane & 1 for level in slot["levels"]] for plane in reversed(range(slot["planes"]))]


def load_begin(program, data):
    """The payload that announces `data`, the slots of a program. "triggers" holds up to four dictionaries."""
    triggers = (program.get("triggers", []) + [{}] * 4)[:4]
    return LOAD_BEGIN_REQUEST.pack(
        len(program["slots"]), program["chain_bits"], program["cycles"], len(data), zlib.crc32(data),
        program.get("lead_ticks", 0)) + b"".join(
            TRIGGER.pack(trigger.get("offset_ticks", 0), trigger.get("width_ticks", 0), trigger.get("skip_kinds", 0),
                         trigger.get("active_low", 0), 0) for trigger in triggers)


def program_bytes(program):
    """The slots of a program (see program.py) and then their patterns, as they are loaded."""
    out = bytearray()
    for slot in program["slots"]:
        out += SLOT.pack(slot["kind"], slot["trigger_mask"], slot.get("planes", 0), 0, slot["exposure_ticks"],
                         slot["period_ticks"], slot.get("trigger_offset_ticks", 0))
    for slot in program["slots"]:
        for bits in patterns(slot):
            words = pattern_words(bits)
            out += struct.pack(f"<{len(words)}I", *words)
    return bytes(out)
