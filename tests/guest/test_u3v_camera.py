# SPDX-License-Identifier: MIT
"""The USB3 Vision camera that the guest's tests plug in, asked by its packets, without a guest: that it refuses, answers and sends as the
standard says."""
import struct

import pytest
from conftest import DESCRIBE_CAMERA
from u3v_camera import CHUNK_FEATURES, HEADER, MAGIC, READ_MEMORY, WRITE_MEMORY, U3vCamera, description
from u3v_descriptors import CONTROL, STREAM
from u3v_registers import MANIFEST, SBRM, SIRM, Status
from u3v_stream import OK, OVERFLOW, STALL
from usb_port import CANCELLED, IN, OUT

WAITS = None
PAYLOAD_BYTES = 64 * 48


class Host:
    """The other end: each transfer's (status, data), or WAITS while there is nothing."""

    def __init__(self):
        self.camera, self.tag, self.answers = U3vCamera(description(DESCRIBE_CAMERA, ["Mono8"], CHUNK_FEATURES)), 0, {}
        self.camera.start(lambda tag, status, data: self.answers.update({tag: (status, data)}), lambda: None)

    def submit(self, endpoint, direction, data=b"", capacity=0, setup=bytes(8)):
        self.tag += 1
        self.camera.submit(self.tag, endpoint, direction, setup, data, capacity)
        return self.answers.get(self.tag, WAITS)

    def control(self, kind, request, value=0, index=0):
        return self.submit(0, kind >> 7, capacity=255, setup=struct.pack("<BBHHH", kind, request, value, index, 255))

    def command(self, number, body, flags=1 << 14, magic=MAGIC):
        assert self.submit(CONTROL, OUT, HEADER.pack(magic, flags, number, len(body), 7) + body) == (OK, b"")
        answer = self.submit(CONTROL, IN, capacity=1024)
        if answer is WAITS:
            return WAITS
        head = HEADER.unpack_from(answer[1])
        assert head[0] == MAGIC and head[3] == len(answer[1]) - HEADER.size and head[4] == 7
        assert head[2] == number + 1
        return head[1], answer[1][HEADER.size :]

    def read(self, address, count):
        return self.command(READ_MEMORY, struct.pack("<QHH", address, 0, count))

    def write(self, address, data):
        return self.command(WRITE_MEMORY, struct.pack("<Q", address) + data)

    def stream(self, capacity):
        return self.submit(STREAM, IN, capacity=capacity)

    def begin(self):
        """As a host does: transfers as large as a frame's parts, and frames on Line1."""
        for address, value in ((0x18, 52), (0x1C, PAYLOAD_BYTES), (0x20, 1), (0x2C, 36), (0x04, 1)):
            assert self.write(SIRM + address, struct.pack("<I", value))[0] == Status.SUCCESS
        registers = self.camera.registers
        registers["TriggerMode", "AcquisitionStart"], registers["TriggerMode", "FrameStart"] = "Off", "On"
        registers["TriggerSource"] = "Line1"
        assert self.write(registers.ranges["AcquisitionStart"].address, struct.pack(">I", 1))[0] == Status.SUCCESS


@pytest.fixture
def host():
    return Host()


def test_bootstrap_registers_lead_to_the_description(host):
    assert host.read(0x1D8, 8) == (Status.SUCCESS, struct.pack("<Q", SBRM))
    assert host.read(SBRM + 0x20, 8) == (Status.SUCCESS, struct.pack("<Q", SIRM))
    assert host.read(SIRM + 0x08, 8) == (Status.SUCCESS, struct.pack("<Q", PAYLOAD_BYTES))
    address, size = struct.unpack_from("<QQ", host.read(MANIFEST + 8, 64)[1], 8)
    assert host.read(address, 5) == (Status.SUCCESS, b"<?xml")
    assert host.read(address + size - 1, 1) == (Status.SUCCESS, b">")


def test_what_is_not_there_or_may_not_be_done_is_refused_and_changes_nothing(host):
    ranges = host.camera.registers.ranges
    assert host.read(0xFFFF0000, 4) == (Status.INVALID_ADDRESS, b"")
    assert host.write(0x1D8, bytes(8)) == (Status.WRITE_PROTECT, b"")
    assert host.read(ranges["AcquisitionStart"].address, 4) == (Status.ACCESS_DENIED, b"")
    assert host.write(ranges["Width"].address, struct.pack(">I", 5000)) == (Status.INVALID_PARAMETER, b"")
    assert host.camera.registers["Width"] == 64
    assert host.command(0x0900, bytes(12)) == (Status.NOT_IMPLEMENTED, b"")
    assert host.command(READ_MEMORY, b"") == (Status.INVALID_PARAMETER, b"")


def test_a_command_that_is_none_or_wants_no_answer_gets_none(host):
    assert host.command(READ_MEMORY, struct.pack("<QHH", 0, 0, 4), magic=b"U3VX") is WAITS
    host = Host()
    width = host.camera.registers.ranges["Width"].address
    assert host.command(WRITE_MEMORY, struct.pack("<Q", width) + struct.pack(">I", 128), flags=0) is WAITS
    assert host.camera.registers["Width"] == 128


def test_an_image_comes_as_leader_payload_and_trailer(host):
    assert host.camera.expose() is None, "nobody has asked for it"
    host.begin()
    block = host.camera.expose()
    status, leader = host.stream(1 << 20)
    assert status == OK and leader[:4] == b"U3VL" and struct.unpack_from("<QHHQIII", leader, 8) == (0, 0, 1, block.time_ns, 0x01080001, 64, 48)
    assert host.stream(PAYLOAD_BYTES) == (OK, block.samples.astype("u1").tobytes())
    status, trailer = host.stream(36)
    assert status == OK and trailer == struct.pack("<4sHHQHHQI", b"U3VT", 0, 32, 0, 0, 0, PAYLOAD_BYTES, 48)
    assert host.stream(1 << 20) is WAITS
    host.camera.cancel(host.tag)
    assert host.answers[host.tag] == (CANCELLED, b"")


@pytest.mark.parametrize("sent", [0, 1000, 2048])
def test_a_payload_that_is_cut_short_ends_its_transfer(host, sent):
    host.begin()
    host.camera.expose(sent_bytes=sent, status=0xA101)
    host.stream(52)
    assert len(host.stream(PAYLOAD_BYTES)[1]) == sent
    assert struct.unpack_from("<HHQ", host.stream(36)[1], 16) == (0xA101, 0, sent)


def test_a_packet_that_finds_no_room_is_lost_with_its_transfer(host):
    host.begin()
    block = host.camera.expose(has_trailer=False)
    assert host.stream(36)[0] == OVERFLOW
    assert host.stream(PAYLOAD_BYTES) == (OK, block.payload)


def test_a_halted_stream_stalls_until_the_halt_is_cleared(host):
    host.begin()
    assert host.control(0x02, 3, 0, STREAM | 0x80) == (OK, b"")
    assert host.stream(52) == (STALL, b"")
    assert host.control(0x02, 1, 0, STREAM | 0x80) == (OK, b"")
    host.camera.expose()
    assert host.stream(52)[0] == OK
