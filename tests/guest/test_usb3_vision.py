# SPDX-License-Identifier: MIT
"""The aravis: driver over Debian's Aravis, libusb and the kernel's USB, against a USB3 Vision camera of the tests at a virtual SuperSpeed
port of the guest. No verdict depends on how fast the machine is: each exposure waits for what it is to follow."""
import itertools

import pytest
from conftest import ROOT, settle
from u3v_camera import CHUNK_FEATURES, U3vCamera, description

DESCRIBE_CAMERA = ROOT / "build/host/bin/describe_camera"
WIDTH, HEIGHT = 64, 48
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


def expose(program, device, count, **wrong):
    """Exposures, each after the frame before has come."""
    blocks = []
    for _ in range(count):
        before = len(program.frames())
        blocks.append(device.expose(**wrong))
        program.wait(before + 1)
    return blocks


def started(program):
    """Once the camera waits for its triggers."""
    return program.wait_until(lambda: any("started_ns" in line for line in program.lines()))


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
    device.expose()
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
