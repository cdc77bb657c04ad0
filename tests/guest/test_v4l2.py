# SPDX-License-Identifier: MIT
"""The V4L2 driver on the kernel's own devices: vivid for formats and faults, v4l2loopback for frames of ours; v4l2-ctl is
the witness. No verdict depends on how fast the machine is: what did not come must have been counted."""
import base64
import re
import sys

import pytest
from conftest import INSIDE

VIVID, LOOPBACK = "/dev/video0", "/dev/video10"
WIDTH, HEIGHT = 320, 180  # vivid's smallest


def stage(cfa="none", bits=8, width=WIDTH, height=HEIGHT, **more):
    return {"cfa": f'"{cfa}"', "bits": bits, "width": width, "height": height} | more


@pytest.fixture
def ctl(guest):
    def run(device, *options):
        done = guest.run(["v4l2-ctl", "-d", device, *options])
        assert done.returncode == 0, done.stdout + done.stderr
        return done.stdout

    return run


@pytest.fixture
def vivid(guest, ctl):
    """One capture device that shows a still picture, as a webcam does."""
    guest.load("vivid", "n_devs=1 node_types=0x1 vid_cap_nr=0")
    ctl(VIVID, "-c", "osd_text_mode=2,test_pattern=20")
    yield lambda *options: ctl(VIVID, *options)
    guest.unload("vivid")


@pytest.fixture
def loopback(guest):
    guest.load("v4l2loopback", "devices=1 video_nr=10 max_buffers=8")
    fed = []

    def feed(fourcc, width, height, sample_bytes, *numbered):
        feeder = [sys.executable, INSIDE / "feed_loopback.py"]
        fed.append(guest.start([*feeder, LOOPBACK, fourcc, width, height, sample_bytes, *numbered]))
        fed[-1].wait_for("ready")
        return fed[-1]

    yield feed
    for one in fed:
        one.end()
    guest.unload("v4l2loopback")


def expect_gaps_are_counted(frames, end):
    """Of frames that came in order: whatever ids they leave out. vivid counts by its clock, and two frames of its start may have one id."""
    ids = [frame["id"] for frame in frames]
    assert ids == sorted(ids)
    assert end["missing_ids"] == ids[-1] - ids[0] + 1 - len(set(ids))


FORMATS = [("GREY", "none", 8), ("Y10 ", "none", 10), ("Y12 ", "none", 12), ("Y16 ", "none", 16), ("RGGB", "rggb", 8),
           ("BA81", "bggr", 8), ("GRBG", "grbg", 8), ("GBRG", "gbrg", 8), ("RG10", "rggb", 10), ("BG10", "bggr", 10),
           ("BG12", "bggr", 12), ("BA12", "grbg", 12), ("GB12", "gbrg", 12), ("RG16", "rggb", 16), ("BYR2", "bggr", 16)]


def test_every_format_of_vivid_comes_as_v4l2_ctl_saves_it(guest, vivid, camera):
    for fourcc, cfa, bits in FORMATS:
        program = camera(f"v4l2:{VIVID}", 1, "/tmp/ours", **stage(cfa, bits))
        end = program.end()
        assert end.get("state") == "live", (fourcc, end)
        assert f" {fourcc.strip()}, " in program.lines()[1]["link"]
        vivid(f"--set-fmt-video=width={WIDTH},height={HEIGHT},pixelformat={fourcc}", "--stream-mmap", "--stream-count=1",
              "--stream-to=/tmp/witness")
        raw = base64.b64decode(guest.run(["base64", "-w0", "/tmp/witness"]).stdout)
        wanted = b"".join(bytes((byte, 0)) for byte in raw) if bits == 8 else raw
        assert len(set(raw)) > 8, "a picture of something"
        assert program.samples(0, WIDTH * HEIGHT) == wanted, fourcc


def test_a_format_that_is_not_to_be_had_is_refused_with_those_that_v4l2_ctl_lists(guest, vivid, camera):
    error = camera("v4l2:0", 1, **stage("rggb", 14)).end()["error"]
    assert "bits is 8 and not 14" in error, error
    listed = re.findall(r"'(....)' \((.*?), csc", vivid("--list-formats"))
    ours = [(fourcc.strip(), name) for fourcc, name in listed if fourcc in [known for known, *_ in FORMATS]]
    assert len(ours) == len(FORMATS)
    for fourcc, name in ours:
        assert f"{fourcc} ({name})" in error


def test_a_size_that_the_driver_changes_is_refused_by_name(guest, vivid, camera):
    error = camera("v4l2:0", 1, **stage(width=333, height=111)).end()["error"]
    assert "width is 320 and not 333; height is 180 and not 111" in error, error


def test_controls_are_set_by_name_as_v4l2_ctl_reads_them(guest, vivid, camera):
    controls = ('{ Contrast = 90, gain_automatic = false, gain = 77, "Menu" = "Menu Item 4", String = "abc", '
                '"Integer 64 Bits" = -5000000000, "Integer Menu" = "13" }')
    end = camera("v4l2:0", 1, **stage(), controls=controls).end()
    assert end.get("state") == "live", end
    read = vivid("-C", "contrast,gain_automatic,gain,menu,integer_64_bits,string,integer_menu")
    for line in ("contrast: 90", "gain_automatic: 0", "gain: 77", "menu: 4", "integer_64_bits: -5000000000",
                 "string: 'abc", "integer_menu: 6"):
        assert line in read, read
    error = camera("v4l2:0", 1, **stage(), controls='{ Contrast = 300, "Trigger Mode" = 1 }').end()["error"]
    assert 'control "Contrast" takes 0 to 255 in steps of 1, not 300' in error
    assert 'it has no control "Trigger Mode" (it has: "Brightness"' in error


@pytest.mark.parametrize("source, words", [("0", "stamps at the end of the frame"),
                                           ("1", "stamps at the begin of the exposure")])
def test_the_source_of_the_stamps_is_said(guest, vivid, camera, source, words):
    vivid("-c", f"timestamp_source={source}")
    program = camera("v4l2:0", 2, **stage())
    end = program.end()
    assert words in program.lines()[1]["link"] and end["state"] == "live", (program.lines(), end)


def test_buffers_that_vivid_drops_are_counted_and_ids_step_as_times_do(guest, vivid, camera):
    vivid("-c", "percentage_of_dropped_buffers=30")
    program = camera("v4l2:0", 60, **stage())
    end = program.end()
    frames = program.frames()
    expect_gaps_are_counted(frames, end)
    assert end["missing_ids"] > 0
    period_ns = min((b["time_ns"] - a["time_ns"]) / (b["id"] - a["id"]) for a, b in zip(frames, frames[1:]))
    assert period_ns > 0 and frames[0]["time_ns"] >= program.lines()[1]["started_ns"]


def test_a_count_that_wraps_goes_on(guest, vivid, camera):
    vivid("-c", "wrap_sequence_number=1")
    program = camera("v4l2:0", 200, **stage())
    end = program.end()
    expect_gaps_are_counted(program.frames(), end)
    ids = [frame["id"] for frame in program.frames()]
    assert ids[0] < 1 << 32 <= ids[-1], ids


def test_a_buffer_that_the_driver_marks_is_an_underrun(guest, vivid, camera):
    program = camera("v4l2:0", 60, **stage()).wait(5)
    vivid("-c", "inject_v4l2_buf_flag_error=1")
    end = program.end()
    expect_gaps_are_counted(program.frames(), end)
    assert end["underrun"] >= 1 and end["missing_ids"] >= end["underrun"], end


def test_a_fatal_error_of_the_driver_ends_the_camera(guest, vivid, camera):
    program = camera("v4l2:0", 100000, **stage()).wait(5)
    vivid("-c", "inject_fatal_streaming_error=1")
    end = program.end()
    assert end["state"] == "gone" and "its driver gave up" in end["why"], end


def test_a_driver_that_does_not_start_is_told_of(guest, vivid, camera):
    vivid("-c", "inject_vidioc_streamon_error=1")
    error = camera("v4l2:0", 1, **stage()).end()["error"]
    assert "does not stream (VIDIOC_STREAMON" in error, error


def test_another_program_that_streams_is_named(guest, vivid, camera):
    other = guest.start(["v4l2-ctl", "-d", VIVID, "--stream-mmap", "--verbose"])
    other.wait_for("seq:")
    error = camera("v4l2:0", 1, **stage()).end()["error"]
    other.end()
    assert "another program streams from it" in error, error


def test_unplugged_while_idle_or_recording_it_is_gone(guest, vivid, camera):
    idle = camera("v4l2:0", 1, pause=0, **stage())
    idle.process.wait_for("opened")
    recording = camera("v4l2:0", 100000, **stage()).wait(5)
    vivid("-c", "disconnect=1")
    end = recording.end()
    assert end["state"] == "gone" and "it was unplugged" in end["why"], end
    idle.process.input.sendall(b"go\n")
    assert "is gone: it was unplugged" in idle.end()["error"]


# Frames of ours.


@pytest.mark.parametrize("fourcc, cfa, bits, width, height, count, rate_hz", [
    ("GREY", "none", 8, 128, 128, 600, 200),
    ("GREY", "none", 8, 640, 480, 300, 100),
    ("RG12", "rggb", 12, 640, 480, 300, 60)])
def test_every_frame_that_was_written_comes_or_is_counted(guest, loopback, camera, fourcc, cfa, bits, width, height, count,
                                                         rate_hz):
    feeder = loopback(fourcc, width, height, (bits + 7) // 8, count, rate_hz)
    program = camera(f"v4l2:{LOOPBACK}", f"@{count}", **stage(cfa, bits, width, height))
    program.process.wait_for("started_ns")
    feeder.input.sendall(b"go\n")
    feeder.wait_for(f"written {count + 1}", 600)
    end, frames = program.end(), program.frames()
    for frame in frames:  # the frame before the numbered ones has id 0
        assert frame["first"] == frame["last"] == (frame["id"] - 1) % (1 << 8 if bits == 8 else 1 << 16), frame
    expect_gaps_are_counted(frames, end)
    assert end["dropped"] == end["missing_ids"]
    print(f"{fourcc} {width} x {height} at {rate_hz}/s: {end['missing_ids']} of {count} lost")


def test_a_reader_that_is_late_loses_frames_that_are_counted_and_blamed_on_it(guest, loopback, camera):
    feeder = loopback("GREY", 128, 128, 1, 200, 50)
    program = camera(f"v4l2:{LOOPBACK}", "@200", pause=10, **stage("none", 8, 128, 128))
    program.process.wait_for("started_ns")
    feeder.input.sendall(b"go\n")
    feeder.wait_for("written 201", 600)
    program.process.input.sendall(b"go\n")
    end, frames = program.end(), program.frames()
    assert frames[10]["id"] == 200, "v4l2loopback moves a reader that is late on to the last frame"
    expect_gaps_are_counted(frames, end)
    for frame in frames:
        assert frame["first"] == frame["last"] == (frame["id"] - 1) % 256
    assert end["dropped"] == end["missing_ids"] == 200 - frames[0]["id"] - 10, end


def test_a_device_that_nobody_feeds_is_told_to_be_fed_first(guest, camera):
    guest.load("v4l2loopback", "devices=1 video_nr=10 exclusive_caps=1")
    try:
        error = camera(f"v4l2:{LOOPBACK}", 1, **stage()).end()["error"]
    finally:
        guest.unload("v4l2loopback")
    assert "start that one first" in error, error
