# SPDX-License-Identifier: MIT
"""stagectl on the kernel's SocketCAN, against the emulated board; candump and PyPI's can-isotp say what was on the bus."""
import json
import signal
import struct

import isotp
import pytest
from can_join import fields
from conftest import ROOT, STAGECTL

from ols_board import can, wire

SEQUENCE = ROOT / "examples/sequence_s159.toml"
WAITING_SEQUENCE = ROOT / "examples/sequence_photo.toml"  # each cycle waits for an edge, which does not come
CONTINUE, WAIT, OVERFLOW = b"\x30\0\0", b"\x31\0\0", b"\x32\0\0"
FIRST, CONSECUTIVE = 1, 2  # ISO 15765-2, 9.6
BUS_OFF, CONTROLLER, NO_ACKNOWLEDGE = 0x20000040, 0x20000004, 0x20000020  # include/uapi/linux/can/error.h
TX_PASSIVE = bytes((0, 0x20, 0, 0, 0, 0, 0, 0))


@pytest.fixture(params=["kernel", "own"])
def either_isotp(request, guest):
    """ISO-TP by the kernel's module, and without it."""
    guest.unload("can-isotp") if request.param == "own" else guest.load("can-isotp")
    return request.param


@pytest.fixture
def kernel_isotp(guest):
    guest.load("can-isotp")


def play_and_wait(guest, lane):
    """Starts to play what waits, until the board says on the bus that it does."""
    playing = guest.start([STAGECTL, "play", WAITING_SEQUENCE, "--board", "can:vcan0"])
    lane.witness.wait_for(f" {can.STATE:X}#{wire.WAITING:02X}")
    return playing


def messages_on(frames, can_id):
    """The ISO-TP messages among the frames with an id, put together by PyPI's can-isotp."""
    waiting = [isotp.CanMessage(arbitration_id=can_id, dlc=len(data), data=data) for one, data in frames if one == can_id]
    address = isotp.Address(isotp.AddressingMode.Normal_11bits, txid=0x7F0, rxid=can_id)
    layer = isotp.TransportLayerLogic(lambda _: waiting.pop(0) if waiting else None, lambda _: None, address,
                                      params={"max_frame_size": 4095, "blocksize": 0})
    messages = []
    while waiting:
        layer.process()
        while (message := layer.recv()) is not None:
            messages.append(bytes(message))
    return messages


def test_a_board_is_asked_over_the_kernels_can_and_candump_agrees(either_isotp, emulated, bus, stagectl):
    lane = bus(emulated())
    asked = stagectl("status", "--json", "--board", "can:vcan0")
    assert asked.returncode == 0, asked.stderr
    assert json.loads(asked.stdout)["state"] == "idle"
    seen = lane.candump()
    requests = [wire.take_frame(bytearray(message))[0] for message in messages_on(seen, can.TO_BOARD)]
    replies = [wire.take_frame(bytearray(message)) for message in messages_on(seen, can.TO_HOST)]
    assert requests == [wire.HELLO, wire.STATUS]
    assert [reply[0] for reply in replies] == [wire.HELLO | wire.REPLY, wire.STATUS | wire.REPLY]
    assert json.loads(asked.stdout)["board"] == wire.HELLO_REPLY.unpack(replies[0][2])[2].hex()


def test_a_sequence_is_played_and_each_cycles_digest_on_the_bus_says_the_same(kernel_isotp, emulated, bus, stagectl):
    lane = bus(emulated())
    played = stagectl("play", SEQUENCE, "--cycles", "1", "--json", "--board", "can:vcan0")
    assert played.returncode == 0, played.stderr
    triggers = [json.loads(line) for line in played.stdout.splitlines()]
    assert [one["counter"] for one in triggers] == list(range(180))
    seen = lane.candump()
    (digest,), (first,), (last,) = ([data for can_id, data in seen if can_id == wanted]
                                    for wanted in (can.CYCLE, can.FIRST_RISE, can.LAST_RISE))
    assert struct.unpack("<IHBB", digest) == (0, 180, 0, 0)
    for frame, trigger in ((first, triggers[0]), (last, triggers[-1])):
        low, high = struct.unpack_from("<IH", frame)
        assert high << 32 | low == trigger["tick"]


def test_a_write_without_flow_control_fails_by_its_name(either_isotp, bus, stagectl):
    lane = bus()
    asked = stagectl("status", "--board", "can:vcan0")
    assert asked.returncode == 1 and "N_TIMEOUT_Bs" in asked.stderr, asked.stderr
    assert [data[0] >> 4 for can_id, data in lane.candump() if can_id == can.TO_BOARD] == [FIRST]


def answering(lane, flow_control):
    """Somebody who answers every first frame so."""
    def answer(record):
        can_id, data = fields(record)
        if can_id == can.TO_BOARD and data[0] >> 4 == FIRST:
            for one in flow_control:
                lane.join.put(can.TO_HOST, one)
        return [record]
    lane.join.to_board = answer


@pytest.mark.parametrize("flow_control, name", [([OVERFLOW], "N_BUFFER_OVFLW"), ([b"\x35\0\0"], "N_INVALID_FS"),
                                                ([WAIT] * 40, "N_WFT_OVRN")])
def test_a_board_that_does_not_take_a_message_is_named(either_isotp, bus, stagectl, flow_control, name):
    lane = bus()
    answering(lane, flow_control)
    asked = stagectl("status", "--board", "can:vcan0")
    assert asked.returncode == 1 and name in asked.stderr, asked.stderr


def losing(can_id, kind, number):
    """Loses the n-th frame of that kind, once."""
    seen = 0

    def pass_on(record):
        nonlocal seen
        one, data = fields(record)
        if one == can_id and data[0] >> 4 == kind:
            seen += 1
            if seen == number:
                return []
        return [record]
    return pass_on


def test_a_frame_of_a_reply_that_is_lost_costs_that_reply_by_its_name_and_no_later_one(either_isotp, emulated, bus, stagectl):
    lane = bus(emulated())
    lane.join.from_board = losing(can.TO_HOST, CONSECUTIVE, 2)
    asked = stagectl("status", "--board", "can:vcan0")
    assert asked.returncode == 1 and "N_WRONG_SN" in asked.stderr, asked.stderr
    assert stagectl("status", "--board", "can:vcan0").returncode == 0


def test_the_last_frame_of_a_reply_that_is_lost_is_a_time_out_by_its_name(kernel_isotp, emulated, bus, stagectl):
    lane = bus(emulated())
    hello_frames = 1 + -(-(14 + wire.HELLO_REPLY.size - 6) // 7)
    lane.join.from_board = losing(can.TO_HOST, CONSECUTIVE, hello_frames - 1)
    asked = stagectl("status", "--board", "can:vcan0")
    assert asked.returncode == 1 and "N_TIMEOUT_Cr" in asked.stderr, asked.stderr
    assert stagectl("status", "--board", "can:vcan0").returncode == 0


def test_a_second_program_on_the_same_board_is_refused_with_the_first_ones_process(kernel_isotp, guest, emulated, bus, stagectl):
    first = play_and_wait(guest, bus(emulated()))
    second = stagectl("status", "--board", "can:vcan0")
    assert second.returncode == 1 and "is used by another program (process " in second.stderr
    process = int(second.stderr.split("process ")[1].split(")")[0])
    assert b"play" in guest.run(["cat", f"/proc/{process}/cmdline"]).stdout.encode()
    other = stagectl("status", "--board", "can:vcan0#3")  # another board may be asked meanwhile
    assert "N_TIMEOUT_Bs" in other.stderr
    first.signal(signal.SIGINT)
    assert first.wait() == 0, first.errors
    assert stagectl("status", "--board", "can:vcan0").returncode == 0


def test_a_program_that_was_killed_leaves_the_board_to_the_next(kernel_isotp, guest, emulated, bus, stagectl):
    first = play_and_wait(guest, bus(emulated()))
    first.end()
    asked = stagectl("status", "--json", "--board", "can:vcan0")
    assert asked.returncode == 0 and json.loads(asked.stdout)["state"] == "waiting", asked.stderr


@pytest.mark.parametrize("error, data, explanation", [
    (BUS_OFF, bytes(8), "the controller went bus-off"), (CONTROLLER, TX_PASSIVE, "error-passive"),
    (NO_ACKNOWLEDGE, bytes(8), "no other node acknowledges")])
def test_what_the_controller_says_of_the_bus_explains_the_failure(either_isotp, bus, stagectl, error, data, explanation):
    lane = bus()

    def break_down(record):
        if fields(record)[0] == can.TO_BOARD:
            lane.join.put(error, data)
        return [record]

    lane.join.to_board = break_down
    asked = stagectl("status", "--board", "can:vcan0")
    assert asked.returncode == 1 and explanation in asked.stderr, asked.stderr


def test_another_host_on_the_bus_that_uses_the_boards_identifier_is_named(either_isotp, bus, stagectl):
    lane = bus(ends=("can0", "can0far"))  # a cable: what comes from the far end is another machine's

    def speak_as_well(record):
        lane.join.put(can.TO_BOARD, b"\x02\x3e\x00")
        return [record]

    lane.join.to_board = speak_as_well
    asked = stagectl("status", "--board", "can:can0")
    assert asked.returncode == 1 and "another node sends with the identifier 0x600" in asked.stderr, asked.stderr


def test_an_interface_that_is_down_or_not_there_is_named(either_isotp, guest, bus, stagectl):
    lane = bus()
    guest.run(["ip", "link", "set", lane.name, "down"])
    asked = stagectl("status", "--board", "can:vcan0")
    assert asked.returncode == 1 and "is down" in asked.stderr and "ip link set vcan0 up" in asked.stderr
    asked = stagectl("status", "--board", "can:vcan9")
    assert asked.returncode == 1 and "no CAN interface 'vcan9'" in asked.stderr


def test_an_interface_that_goes_down_in_play_ends_it_by_its_name(either_isotp, guest, emulated, bus):
    lane = bus(emulated())
    playing = play_and_wait(guest, lane)
    guest.run(["ip", "link", "set", lane.name, "down"])
    assert playing.wait() == 1
    assert "is down" in playing.errors, playing.errors
