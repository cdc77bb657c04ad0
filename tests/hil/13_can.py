# SPDX-License-Identifier: MIT
# CAN: the same messages over ISO-TP, spoken here by an independent implementation; telemetry and digests of cycles; and
# what is lost, broken, out of order or too much.
import struct
import subprocess
import time
import zlib

import pytest

from ols_board import can, claims, wire
from ols_board.board import BOARD, ROOT, BoardError
from ols_board.program import paper_program

STAGECTL = ROOT / "build/host/bin/stagectl"
EMULATED = BOARD in ("emulated", "can:emulated")


@pytest.fixture
def board(emulated):
    """A board with a CAN controller."""
    if BOARD.startswith("usb:"):
        pytest.skip("BOARD=can:IFACE is for these")
    return emulated(can=True) if EMULATED else emulated()


def wait_ms(bus, milliseconds):
    """Lets the board's time pass; returns what is heard meanwhile."""
    bus.receive()
    end = bus.tick + milliseconds * 125_000
    begin = len(bus.heard)
    while bus.tick < end:
        bus.receive()
    return bus.heard[begin:]


def from_board(bus, frames=1):
    """The next ISO-TP frames of the board."""
    found = []
    while len(found) < frames:
        got = bus.receive()
        if got and got[0] == can.TO_HOST:
            found.append(got[1])
    return found


def segments(message):
    """A message as first and consecutive frames (ISO 15765-2, 9.6)."""
    first = bytes([0x10 | len(message) >> 8, len(message) & 0xFF]) + message[:6]
    rest = [message[n : n + 7] for n in range(6, len(message), 7)]
    return [first] + [bytes([0x20 | (n + 1) & 15]) + part for n, part in enumerate(rest)]


def health(bus):
    """The last that the board said of its CAN link."""
    frames = [data for _, frame_id, data in bus.heard if frame_id == can.HEALTH]
    names = ("frames_lost", "messages_lost", "bus_offs", "last_error", "controller_flags")
    return dict(zip(names, struct.unpack("<HHHBB", frames[-1])))


def test_hello_says_that_the_board_speaks_can(board):
    link = board.plug_can()
    assert link.hello(0)["capabilities"] & wire.SPEAKS_CAN


def test_a_board_without_a_controller_says_so_and_works_over_usb(emulated):
    link = emulated(can=False).plug_usb()
    assert not link.hello(0)["capabilities"] & wire.SPEAKS_CAN
    assert link.status()["state"] == wire.IDLE


def test_the_feather_image_finds_its_controller_on_its_own_pins(emulated):
    image = ROOT / "build/firmware/feather_can/stage.elf"
    assert emulated(image=image, can=True).plug_can().hello(0)["board"].rstrip(b"\0") == b"feather_can"


def test_the_bit_timing_leaves_a_bus_of_20_metres_its_time(emulated):
    if not EMULATED:
        pytest.skip("needs the emulated controller's registers")
    board = emulated(can=True)
    board.plug_can().hello(0)  # so it has been set
    timing = board.stop()["can"]
    # There and back, each way through one transceiver's loop of 150 ns and 20 m of 5 ns (docs/hardware.md, "CAN").
    assert timing["propagation"] * timing["quantum_ns"] >= 2 * (150 + 20 * 5)
    sample = 1 + timing["propagation"] + timing["phase1"]
    assert sample / (sample + timing["phase2"]) == 0.75
    # Rules of Microchip DS20001801J 5.3
    assert timing["propagation"] + timing["phase1"] >= timing["phase2"] > timing["jump"] <= timing["phase1"]


def test_a_program_of_180_slots_is_uploaded_at_the_buss_pace(board):
    link = board.plug_can()
    link.hello(0)
    program = paper_program(cycles=1)
    data = wire.program_bytes(program)
    begin = link.usb.bus.tick
    link.load(program)
    whole_ms = (link.usb.bus.tick - begin) / 125_000
    assert link.status()["program_crc32"] == zlib.crc32(data)
    # Another node sees what bus and board alone take: from the first consecutive frame to the reply.
    message = wire.frame(wire.LOAD_CHUNK, 1, bytes(range(256)) * 4)
    bus, listener = link.usb.bus, board.bus()
    first, *rest = segments(message)
    bus.send(can.TO_BOARD, first)
    from_board(bus)
    bus.send_all(can.TO_BOARD, rest)
    from_board(listener, 2)
    consecutive = [tick for tick, frame_id, data in listener.heard if frame_id == can.TO_BOARD and data[0] >> 4 == 2]
    bus_ms = (listener.tick - consecutive[0]) / 125_000
    rate = len(message) / bus_ms
    claims.counted(f"CAN: {len(data)} bytes of program in {whole_ms:.0f} ms of board time, {len(data) / whole_ms:.1f} kB/s "
                   f"with this host's answering times; one message {rate:.1f} kB/s")
    assert len(consecutive) == len(rest)
    assert 50 < rate < 63  # 7 bytes a frame of 111 to 135 bits at 1 Mbit/s are 52 to 63, less the reply's begin


def test_the_digest_of_every_cycle_is_what_its_entries_give(board):
    link = board.plug_can()
    link.play(paper_program(cycles=4, slots=18))
    assert link.wait_until([wire.DONE, wire.FAULT])["fault"] == 0
    entries, lost = link.trigger_log()
    digests, digests_lost = link.digests()
    assert (lost, digests_lost, len(digests)) == (0, 0, 4)
    for cycle, digest in enumerate(digests):
        own = [entry for entry in entries if entry[2] == cycle]
        packed = b"".join(wire.LOG_ENTRY.pack(*entry) for entry in own)
        assert digest == {"first_rise_ticks": own[0][0], "last_rise_ticks": own[-1][0], "first_counter": own[0][1],
                          "cycle": cycle, "entries_crc32": zlib.crc32(packed), "trigger_count": 18, "program": 0,
                          "flags": 0}
    told = [(frame_id, data) for _, frame_id, data in link.usb.bus.heard if can.CYCLE <= frame_id <= can.CYCLE_CRC]
    assert [frame_id for frame_id, _ in told] == [can.CYCLE, can.FIRST_RISE, can.LAST_RISE, can.CYCLE_CRC] * 4
    for digest, (cycle, first, last, crc) in zip(digests, (told[n : n + 4] for n in range(0, 16, 4))):
        assert struct.unpack("<IHBB", cycle[1]) == (digest["cycle"], 18, 0, 0)
        assert struct.unpack("<IHH", first[1])[0] == digest["first_rise_ticks"]
        assert struct.unpack("<IHH", last[1])[::2] == (digest["last_rise_ticks"], digest["cycle"])
        assert struct.unpack("<II", crc[1]) == (digest["cycle"], digest["entries_crc32"])


def test_at_twenty_thousand_triggers_a_second_every_digest_is_complete(board):
    link = board.plug()
    program = paper_program(cycles=10, slots=180)
    for slot in program["slots"]:
        slot.update(exposure_ticks=3000, period_ticks=6250)
    link.play(program)
    assert link.wait_until([wire.DONE, wire.FAULT])["fault"] == 0
    digests, lost = link.digests()
    assert lost == 0 and [(one["cycle"], one["trigger_count"], one["flags"]) for one in digests] == [
        (cycle, 180, 0) for cycle in range(10)]


def test_a_stop_marks_the_cycle_that_it_cuts_short(board):
    link = board.plug_can()
    link.play(paper_program(cycles=0, slots=18))
    while link.status()["triggers_fired"] < 40:
        pass
    link.ask(wire.STOP)
    digests, _ = link.digests()
    assert [digest["flags"] for digest in digests] == [0] * (len(digests) - 1) + [wire.DIGEST_INCOMPLETE]
    assert digests[-1]["trigger_count"] < 18
    assert sum(digest["trigger_count"] for digest in digests) == link.status()["triggers_fired"]


def test_state_is_told_at_once_when_it_changes_and_otherwise_every_fifty_milliseconds(board):
    link = board.plug_can()
    link.hello(0)
    told = [tick for tick, frame_id, _ in wait_ms(link.usb.bus, 500) if frame_id == can.STATE]
    assert 8 <= len(told) <= 11
    before = len(link.usb.bus.heard)
    link.load(paper_program(cycles=1, slots=18))
    states = [data[0] for _, frame_id, data in link.usb.bus.heard[before:] if frame_id == can.STATE]
    assert wire.LOADED in states


def test_usb_and_can_are_served_at_the_same_time_and_the_host_that_armed_keeps_the_board(board):
    if not EMULATED:
        pytest.skip("this host has one cable to a real board")
    over_can, over_usb = board.plug_can(), board.plug_usb()
    over_can.load(paper_program(cycles=0, slots=18))
    over_can.arm()
    with pytest.raises(BoardError, match="another host"):
        over_usb.ask(wire.START)
    over_can.ask(wire.START)
    assert over_usb.status()["state"] == over_can.status()["state"] == wire.PLAYING
    over_usb.usb.close()  # not the cable of the host that armed
    assert over_can.status()["state"] == wire.PLAYING
    over_can.usb.bus.close()  # nobody is left who would acknowledge
    link = board.plug_usb()
    status = link.wait_until([wire.FAULT])
    assert wire.FAULTS[status["fault"]] == "host lost"


@pytest.mark.parametrize("damage", ["lost", "twice", "swapped"])
def test_frames_that_are_lost_repeated_or_swapped_cost_the_message_and_no_other(board, damage):
    link = board.plug_can()
    bus = link.usb.bus
    link.hello(0)
    first, *rest = segments(wire.frame(wire.HELLO, 77, bytes(100)))
    bus.send(can.TO_BOARD, first)
    from_board(bus)
    if damage == "lost":
        del rest[3]
    elif damage == "twice":
        rest.insert(3, rest[3])
    else:
        rest[3], rest[4] = rest[4], rest[3]
    for frame in rest:
        bus.send(can.TO_BOARD, frame)
    heard = wait_ms(bus, 30)
    assert not [data for _, frame_id, data in heard if frame_id == can.TO_HOST], "a damaged message was answered"
    assert health(bus)["messages_lost"] == 1 and health(bus)["last_error"] == 4  # N_WRONG_SN
    assert link.status()["state"] == wire.IDLE


def test_a_host_that_stops_amid_a_message_is_forgotten_after_a_second(board):
    link = board.plug_can()
    bus = link.usb.bus
    link.hello(0)
    first, second, *_ = segments(wire.frame(wire.HELLO, 77, bytes(100)))
    bus.send(can.TO_BOARD, first)
    bus.send(can.TO_BOARD, second)
    wait_ms(bus, 900)
    assert health(bus)["messages_lost"] == 0
    wait_ms(bus, 200)
    assert health(bus)["messages_lost"] == 1 and health(bus)["last_error"] == 3  # N_TIMEOUT_Cr
    assert link.status()["state"] == wire.IDLE


def test_a_reply_without_flow_control_is_given_up_after_a_second(board):
    link = board.plug_can()
    bus = link.usb.bus
    link.hello(0)
    first, *rest = segments(wire.frame(wire.STATUS, 77))
    bus.send(can.TO_BOARD, first)
    from_board(bus)
    for frame in rest:
        bus.send(can.TO_BOARD, frame)
    assert from_board(bus)[0][0] >> 4 == 1  # the reply's first frame
    wait_ms(bus, 1100)
    assert health(bus)["last_error"] == 2  # N_TIMEOUT_Bs
    assert link.status()["state"] == wire.IDLE


def test_a_message_longer_than_any_frame_is_refused_by_flow_control(board):
    link = board.plug_can()
    bus = link.usb.bus
    link.hello(0)
    bus.send(can.TO_BOARD, bytes([0x14, 0x0F]) + bytes(6))  # 1039 bytes
    assert from_board(bus)[0][0] == 0x32  # overflow
    assert link.status()["state"] == wire.IDLE


def test_bus_off_ends_play_in_the_dark_by_its_name_and_the_link_recovers(board):
    if not EMULATED:
        pytest.skip("this host cannot break frames on a real bus")
    link = board.plug_can()
    bus = link.usb.bus
    link.play(paper_program(cycles=0, slots=18))
    bus.receive()
    for _ in range(40):  # 32 broken frames of the board are enough: 8 errors each (CAN 2.0, 8.)
        bus.break_next_frame()
    wait_ms(bus, 300)
    status = link.status()
    assert status["state"] == wire.FAULT and wire.FAULTS[status["fault"]] == "host lost"
    wait_ms(bus, 1100)
    assert health(bus)["bus_offs"] == 1 and health(bus)["controller_flags"] & 0x30 == 0
    link.ask(wire.CLEAR_FAULT)
    assert link.status()["state"] == wire.IDLE


def test_a_flood_of_other_traffic_delays_but_mislabels_nothing(board):
    link = board.plug_can()
    link.load(paper_program(cycles=2, slots=18))
    link.arm()
    others = board.bus()
    for n in range(2000):  # 0.25 s of a full bus, of higher priority than any reply
        others.send(0x300, struct.pack("<Q", n))
    link.ask(wire.START)
    assert link.wait_until([wire.DONE, wire.FAULT])["fault"] == 0
    entries, lost = link.trigger_log()
    assert lost == 0 and [(entry[1], entry[2], entry[3]) for entry in entries] == [
        (n, n // 18, n % 18) for n in range(36)]


def test_frames_for_the_board_that_come_too_fast_are_counted_not_confused(board):
    link = board.plug_can()
    bus = link.usb.bus
    link.hello(0)
    requests = [segments(wire.frame(wire.HELLO, n, bytes(64))) for n in range(1, 9)]
    for frames in requests:  # a host that does not wait for flow control, nor for replies
        for frame in frames:
            bus.send(can.TO_BOARD, frame)
    wait_ms(bus, 1500)
    assert health(bus)["messages_lost"] > 0
    assert link.status()["state"] == wire.IDLE
    assert link.hello(0)["capabilities"] & wire.SPEAKS_CAN


def test_a_bus_of_another_bit_rate_is_no_bus(emulated):
    board = emulated("--can-kbit-s", "500", can=True)
    bus = board.bus()
    bus.send(can.TO_BOARD, wire.frame(wire.STATUS, 1)[:8])
    assert not [one for one in wait_ms(bus, 100) if one[1] in (can.STATE, can.TO_HOST)]
    assert board.plug_usb().status()["state"] == wire.IDLE


def test_a_reset_board_is_a_new_board_on_the_same_bus(emulated):
    board = emulated("--inject", "reset@40000000", can=True)
    link = board.plug_can()
    before = link.hello(0)["boot_nonce"]
    wait_ms(link.usb.bus, 400)
    assert link.hello(0)["boot_nonce"] != before


def test_stagectl_asks_over_the_emulated_bus(board):
    if not EMULATED:
        pytest.skip("stagectl's link to a real bus is can:IFACE, used by hand")
    board.bus().close()  # it is up
    command = [STAGECTL, "status", "--json", "--board"]
    asked = subprocess.run([*command, f"can-socket:{board.path}/can.sock"], capture_output=True, text=True, timeout=60)
    assert asked.returncode == 0 and '"state": "idle"' in asked.stdout, asked.stderr
    other = subprocess.run([*command, f"can-socket:{board.path}/can.sock#3"], capture_output=True, text=True, timeout=60)
    assert other.returncode != 0 and "N_TIMEOUT_Bs" in other.stderr
