# SPDX-License-Identifier: MIT
"""The aravis: driver over Debian's Aravis, libusb and the kernel's USB, against a USB3 Vision camera of the tests at a virtual SuperSpeed
port of the guest. No verdict depends on how fast the machine is: each exposure waits for what it is to follow."""
import grp
import itertools
import time

import numpy
import pytest
from conftest import DESCRIBE_CAMERA, settle
from u3v_camera import CHUNK_FEATURES, U3vCamera, description
from u3v_registers import Status

NOBODY = 65534
WIDTH, HEIGHT = 64, 48
DATA_DISCARDED, DATA_OVERRUN = 0xA100, 0xA101  # USB3 Vision 1.0.1, status codes of a trailer
serials = (f"OLS{number}" for number in itertools.count(1))


@pytest.fixture
def plugged(guest, fast_ports):
    """Plugs cameras in, each with a serial number of its own, and pulls their cables at the end."""
    used = []

    def plug(formats=("Mono8",), lacks=CHUNK_FEATURES, **options):
        camera = U3vCamera(description(DESCRIBE_CAMERA, formats, lacks), next(serials), **options)
        camera.port = fast_ports[len(used)]
        used.append(camera.port)
        camera.port.plug(camera)
        settle(guest, camera.serial)
        return camera

    yield plug
    for port in used:
        port.unplug()


@pytest.fixture
def arv_tool(guest):
    def run(*arguments):
        done = guest.run(["arv-tool-0.8", *arguments])
        assert done.returncode == 0, done.stdout + done.stderr
        return done.stdout

    return run


def stage(cfa="none", bits=8, width=WIDTH, height=HEIGHT, **more):
    keys = {"cfa": f'"{cfa}"', "bits": bits, "width": width, "height": height, "trigger_source": '"Line1"',
            "exposure_mode": '"timed"', "exposure_us": 250}
    return keys | more


def expose(program, device, count):
    """Exposures, each after the frame before has come."""
    blocks = []
    for _ in range(count):
        before = len(program.frames())
        wait_until(device.is_asked)
        blocks.append(device.expose())
        program.wait(before + 1)
    return blocks


def expose_blindly(program, device, count=1, **wrong):
    """Exposures of which none need come, each after the one before has been taken from the camera."""
    for _ in range(count):
        wait_until(device.is_asked)
        assert device.expose(**wrong)
        wait_until(device.has_sent_all)
        assert program.process.returncode is None, program.process.output


def wait_until(is_so):
    end = time.monotonic() + 180
    while not is_so():
        assert time.monotonic() < end
        time.sleep(0.001)


def started(program):
    """Once the camera waits for its triggers."""
    program.wait_until(lambda: any("started_ns" in line for line in program.lines()))
    assert program.process.returncode is None, program.process.output + program.process.errors
    return program


# An independent program.


def test_arv_tool_lists_it_reads_what_it_is_and_sets_its_features(plugged, arv_tool):
    device = plugged(("Mono8", "Mono12p"))
    assert f"{device.serial} (USB3)" in arv_tool()
    read = arv_tool("control", "DeviceVendorName", "DeviceSerialNumber", "Width", "PixelFormat", "BlackLevel")
    for line in ("DeviceVendorName = OLS", f"DeviceSerialNumber = {device.serial}", "Width = 64 min:8 max:2048", "PixelFormat = Mono8",
                 "BlackLevel = 64 min:0 max:4095"):
        assert line in read, read
    arv_tool("control", "Width=128", "PixelFormat=Mono12p", "ExposureTime=125.5")
    assert [device.registers[name] for name in ("Width", "PixelFormat", "ExposureTime")] == [128, "Mono12p", 125.5]
    assert "PayloadSize = 9216" in arv_tool("control", "PayloadSize"), "128 x 48 pixels of 12 bits"
    assert device.refused == []


# Set-up and frames.


def test_set_up_is_in_the_cameras_registers_and_said(plugged, camera):
    device = plugged(("Mono8", "Mono12p"))
    program = started(camera("aravis:", 1, **stage(bits=12, trigger_delay_us=5, controls="{ BlackLevel = 77 }",
                                                   trigger_activation='"falling_edge"')))
    registers = device.registers
    assert [registers["TriggerMode", of] for of in ("FrameStart", "AcquisitionStart", "FrameBurstStart")] == ["On", "Off", "Off"]
    wanted = {"TriggerSource": "Line1", "TriggerActivation": "FallingEdge", "TriggerDelay": 5.0, "TriggerOverlap": "ReadOut",
              "ExposureMode": "Timed", "ExposureTime": 250.0, "ExposureAuto": "Off", "AcquisitionMode": "Continuous",
              "PixelFormat": "Mono12p", "Width": 64, "Height": 48, "OffsetX": 992, "OffsetY": 1000, "BlackLevel": 77}
    assert {name: registers[name] for name in wanted} == wanted
    opened, begun = program.lines()
    assert opened == {"opened": f"OLS Line {device.serial}"}
    assert begun["link"] == "USB3 Vision, Mono12p at 992, 1000, 1024 buffers of 4608 bytes"
    expose(program, device, 1)
    assert program.end()["state"] == "live"
    assert not device.is_acquiring


@pytest.mark.parametrize("pixel_format, cfa, bits", [
    ("Mono8", "none", 8), ("Mono10p", "none", 10), ("Mono12", "none", 12), ("Mono12p", "none", 12), ("Mono16", "none", 16),
    ("BayerGB8", "gbrg", 8), ("BayerRG10", "rggb", 10), ("BayerBG12p", "bggr", 12), ("BayerRG16", "rggb", 16)])
def test_frames_are_bit_for_bit_what_was_exposed_with_the_cameras_ids_and_times(plugged, camera, pixel_format, cfa, bits):
    device = plugged((pixel_format, "RGB8"))
    program = started(camera(f"aravis:{device.serial}", 3, "/tmp/frames", **stage(cfa, bits)))
    blocks = expose(program, device, 3)
    end = program.end()
    assert [(frame["id"], frame["time_ns"]) for frame in program.frames()] == [(block.id, block.time_ns) for block in blocks]
    for number, block in enumerate(blocks):
        assert program.samples(number, WIDTH * HEIGHT) == block.samples.tobytes()
    assert end == {"missing_ids": 0, "dropped": 0, "underrun": 0, "stale": 0, "state": "live", "why": ""}


def test_times_are_those_of_the_chunks_where_the_camera_has_them(plugged, camera):
    device = plugged(("Mono12p",), lacks=())
    program = started(camera("aravis:", 2, "/tmp/frames", **stage(bits=12)))
    assert "times by chunk data" in program.lines()[1]["link"]
    blocks = expose(program, device, 2)
    assert program.end()["state"] == "live"
    assert [frame["time_ns"] for frame in program.frames()] == [block.chunk_time_ns for block in blocks]
    assert program.samples(1, WIDTH * HEIGHT) == blocks[1].samples.tobytes()


def test_a_frame_of_several_transfers_is_bit_for_bit_what_was_exposed(plugged, camera):
    device = plugged()
    width, height = 1280, 960  # a mebibyte, and full packets to the end
    program = started(camera("aravis:", 2, "/tmp/frames", **stage(width=width, height=height)))
    blocks = expose(program, device, 2)
    assert (device.registers["SI_PAYLOAD_COUNT"], device.registers["SI_TRANSFER1"]) == (1, 176 * 1024)
    assert program.end()["underrun"] == 0
    for number, block in enumerate(blocks):
        assert program.samples(number, width * height) == block.samples.tobytes()


def test_a_command_that_takes_long_and_says_so_is_waited_for_and_not_repeated(plugged, camera):
    device = plugged()
    device.pending_ms["AcquisitionStart"] = 3000  # longer than an answer may take
    program = started(camera("aravis:", 1, **stage()))
    expose(program, device, 1)
    assert program.end()["state"] == "live"
    assert device.written.count("AcquisitionStart") == 1


# Refusals.


def test_a_feature_that_the_camera_lacks_is_named(plugged, camera):
    plugged(lacks=(*CHUNK_FEATURES, "ExposureMode"))
    error = camera("aravis:", 1, **stage(exposure_mode='"trigger_width"')).end()["error"]
    assert 'exposure_mode is timed and not trigger_width' in error and "this model lacks: ExposureMode)" in error, error


def test_a_value_that_the_camera_refuses_is_named_with_what_it_has(plugged, camera):
    device = plugged()
    locked = device.registers.ranges["ExposureTime"]
    device.registers["ExposureTime"], locked.access = 1000.0, "RO"
    error = camera("aravis:", 1, **stage()).end()["error"]
    assert "exposure_us is 1000 and not 250" in error, error
    assert set(device.refused) == {(Status.WRITE_PROTECT, locked.address)}


def test_a_camera_that_does_not_say_how_large_its_frames_are_is_refused(plugged, camera):
    device = plugged()
    device.requires_payload = False
    error = camera("aravis:", 1, **stage()).end()["error"]
    assert "does not say how large its frames are" in error and not device.is_acquiring, error


def test_a_second_program_is_told_that_the_camera_is_in_use_and_the_first_goes_on(plugged, camera):
    device = plugged()
    first = started(camera("aravis:", 2, **stage()))
    expose(first, device, 1)
    for name in ("", device.serial):
        error = camera("aravis:" + name, 1, **stage()).end()["error"]
        assert f"the camera aravis:{name} is in use: another program controls it" in error, error
    expose(first, device, 1)
    assert first.end()["missing_ids"] == 0


def test_of_two_cameras_the_one_that_is_named_is_used(plugged, camera):
    devices = [plugged(), plugged()]
    error = camera("aravis:", 1, **stage()).end()["error"]
    assert "there are several cameras" in error and all(f"aravis:{device.serial} (OLS Line)" in error for device in devices), error
    programs = [started(camera("aravis:" + device.serial, 2, f"/tmp/frames{device.serial}", **stage())) for device in devices]
    assert [device.is_acquiring for device in devices] == [True, True]
    for program, device in zip(programs, devices):
        device.lose(10 * (1 + devices.index(device)))
        blocks = expose(program, device, 2)
        assert [frame["id"] for frame in program.frames()] == [block.id for block in blocks]
        assert program.end()["state"] == "live"


def test_without_permission_the_udev_rule_is_named_and_with_it_the_group_may(plugged, camera, udev_rules):
    plugdev = {"user": NOBODY, "groups": [grp.getgrnam("plugdev").gr_gid]}
    device = plugged()
    for name in ("", device.serial):
        error = camera("aravis:" + name, 1, **plugdev, **stage()).end()["error"]
        assert "no permission for the USB3 Vision camera at bus" in error, error
        assert "install the udev rule 60-open-light-stage.rules" in error, error
    assert device.written == []
    udev_rules.install()
    device.port.unplug()
    allowed = plugged()
    program = started(camera("aravis:", 1, **plugdev, **stage()))
    expose(program, allowed, 1)
    assert program.end()["state"] == "live"
    error = camera("aravis:", 1, user=NOBODY, **stage()).end()["error"]
    assert "60-open-light-stage.rules is installed" in error, error


# Losses.

PICTURE_LIKE_A_LEADER = numpy.frombuffer(b"U3VL" + bytes(WIDTH * HEIGHT - 4), "u1").astype("u2")


@pytest.mark.parametrize("wrong, ids, underrun", [
    ({"sent_bytes": 2048, "status": DATA_OVERRUN}, [0, 1, 3, 4], 1),
    ({"sent_bytes": 1000}, [0, 1, 3, 4], 1),
    ({"sent_bytes": 0, "status": DATA_DISCARDED}, [0, 1, 3, 4], 1),
    ({"status": DATA_DISCARDED}, [0, 1, 3, 4], 1),
    ({"has_leader": False}, [0, 1, 3, 4], 0),
    # Aravis asks for no more than a trailer when that is due: the frame behind it is passed over up to its own.
    ({"has_trailer": False}, [0, 1, 2, 4], 0),
    # Aravis tells a leader from a picture by its first bytes: the frame is lost, and counted once more as what it seemed to begin.
    ({"samples": PICTURE_LIKE_A_LEADER}, [0, 1, 3, 4], 2)], ids=lambda value: "+".join(value) if isinstance(value, dict) else None)
def test_a_frame_that_does_not_leave_the_camera_whole_is_not_handed_on_and_counted(plugged, camera, wrong, ids, underrun):
    device = plugged()
    program = started(camera("aravis:", "@4", "/tmp/frames", **stage()))
    expose(program, device, 2)
    expose_blindly(program, device, **wrong)
    expose_blindly(program, device, 2)
    end = program.end()
    assert [frame["id"] for frame in program.frames()] == ids
    assert end == {"missing_ids": 1, "dropped": 0, "underrun": underrun, "stale": 0, "state": "live", "why": ""}
    for number, frame in enumerate(ids):
        assert program.samples(number, WIDTH * HEIGHT) == device.picture(frame, WIDTH * HEIGHT, "Mono8").tobytes()


def test_ids_that_are_passed_over_are_missing_and_ids_that_begin_anew_are_not(plugged, camera):
    device = plugged()
    program = started(camera("aravis:", 7, **stage()))
    expose(program, device, 2)
    device.lose(3)
    expose(program, device, 2)
    device.next_id = 0
    expose(program, device, 2)
    device.next_id = 1 << 32 | 5
    expose(program, device, 1)
    end = program.end()
    assert [frame["id"] for frame in program.frames()] == [0, 1, 5, 6, 0, 1, 1 << 32 | 5]
    assert end["missing_ids"] == 3 + (1 << 32 | 5) - 2 and end["dropped"] == end["underrun"] == 0


def test_frames_that_find_no_buffer_are_counted_as_ours(plugged, camera):
    device = plugged()
    program = started(camera("aravis:", "@1032", pause=2, **stage(width=8, height=8)))
    expose(program, device, 2)
    expose_blindly(program, device, 1024 + 6)
    program.process.input.sendall(b"go\n")
    program.wait(2 + 1024)
    expose(program, device, 1)
    end = program.end()
    assert [frame["id"] for frame in program.frames()] == [*range(2 + 1024), 1032]
    assert (end["missing_ids"], end["dropped"], end["underrun"]) == (6, 6, 0)


# Ends.


def test_a_camera_that_answers_nothing_more_is_gone_after_a_minute(plugged, camera):
    device = plugged()
    program = started(camera("aravis:", 100, **stage()))
    expose(program, device, 2)
    device.hang()
    end = program.end()
    assert len(program.frames()) == 2
    assert end["state"] == "gone" and "it gave no sign of life for 60 s" in end["why"], end


def test_a_camera_that_ends_its_acquisition_has_ended(plugged, camera):
    device = plugged()
    program = started(camera("aravis:", 100, **stage()))
    expose(program, device, 2)
    device.is_acquiring = False
    end = program.end()
    assert end["state"] == "ended" and "has ended its acquisition by itself" in end["why"], end


def unplug(guest, device):
    device.port.unplug()
    wait_until(lambda: device.serial not in guest.run(["sh", "-c", "cat /sys/bus/usb/devices/*/serial"]).stdout)


@pytest.mark.parametrize("pause", ["0", "start"], ids=["before_set_up", "set_up"])
def test_unplugged_while_idle_it_is_gone(guest, plugged, camera, pause):
    device = plugged()
    program = camera("aravis:", 1, pause=pause, **stage())
    program.process.wait_for("opened")
    if pause == "start":
        wait_until(lambda: device.registers["TriggerMode", "FrameStart"] == "On" and "ExposureTime" in device.written)
    unplug(guest, device)
    program.process.input.sendall(b"go\n")
    assert f"the camera OLS Line {device.serial} is gone: it was unplugged" in program.end()["error"]
    assert program.process.returncode == 1


@pytest.mark.parametrize("frames", [0, 2])
def test_unplugged_while_it_waits_for_triggers_it_is_gone_and_nothing_asks_for_it_any_more(guest, plugged, camera, frames):
    device = plugged()
    program = started(camera("aravis:", 100, pause="end", **stage()))
    expose(program, device, frames)
    assert "arv_uv_stream" in threads(guest)
    unplug(guest, device)
    wait_until(lambda: "arv_uv_stream" not in threads(guest))
    program.process.input.sendall(b"go\n")
    end = program.end()
    assert end["state"] == "gone" and "is gone: it was unplugged" in end["why"], end
    assert len(program.frames()) == frames and program.process.errors == ""


def threads(guest):
    return guest.run(["sh", "-c", "cat /proc/[0-9]*/task/*/comm"]).stdout.split()


def test_unplugged_in_the_middle_of_a_frame_what_came_before_is_kept(guest, plugged, camera):
    device = plugged()
    program = started(camera("aravis:", 100, "/tmp/frames", pause=2, **stage()))
    expose(program, device, 2)
    expose_blindly(program, device, 2)
    expose_blindly(program, device, has_trailer=False, sent_bytes=1000)
    unplug(guest, device)
    program.process.input.sendall(b"go\n")
    end = program.end()
    assert [frame["id"] for frame in program.frames()] == [0, 1, 2, 3]
    assert program.samples(3, WIDTH * HEIGHT) == device.picture(3, WIDTH * HEIGHT, "Mono8").tobytes()
    assert end["state"] == "gone" and "is gone: it was unplugged" in end["why"], end
