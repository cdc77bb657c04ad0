# SPDX-License-Identifier: MIT
"""Recordings in a camera's own memory, ingested: bit for bit the targets of the live take of the same frames."""
import json
import os
import subprocess
import sys

import numpy as np
import OpenEXR
import pytest
import tifffile
from PIL import Image

from cine_writer import write_cine
from virtual_take import BIN, HEIGHT, ROOT, WIDTH, VirtualStage, identification, manifest, read_lamps, read_plane, sequence, slots_of

sys.path.append(str(ROOT / "tests/unit"))
from picture_files import write_dng  # noqa: E402

CYCLES, CYCLE = 4, 180
BLACK, WHITE = 64, 4095  # of the stage, as it is by default
CUT = 47  # frames of cycle 0 that were not recorded: 2 groups and 11 slots


class Live:
    def __init__(self, folder):
        self.folder, self.archive = folder, folder / "live.rfa"
        with VirtualStage(folder, "spheres.toml", "--keep-frames") as stage:
            self.stage = stage.stage
            stage.stagectl("run", "--sequence", sequence("s159"), "--cycles", CYCLES, "--nominal", "-o", self.archive)
        kept = np.fromfile(folder / "cam0.frames.bin", dtype=np.dtype([("id", "<u8"), ("ns", "<u8"), ("counts", "<u2", (HEIGHT, WIDTH))]))
        self.counts, self.times = kept["counts"], kept["ns"]
        assert len(kept) == CYCLES * CYCLE

    def command(self, recording, name, *options):
        archive = self.folder / f"{name}.rfa"
        return archive, list(map(str, [BIN / "stagectl", "ingest", recording, "--sequence", sequence("s159"), "--stage", self.stage,
                                       "--nominal", "-o", archive, "--overwrite", "--json", *options]))

    def ingest(self, recording, name, *options, code=0):
        archive, command = self.command(recording, name, *options)
        done = subprocess.run(command, capture_output=True, text=True, timeout=300)
        assert done.returncode == code, (done.returncode, done.stdout, done.stderr)
        return (archive, json.loads(done.stdout)) if code != 1 else done.stderr

    def expect_same(self, archive, first=1, count=CYCLES - 1):
        """Targets of the archive are those of the live take from `first` on."""
        for index in range(count):
            assert np.array_equal(read_lamps(archive, index), read_lamps(self.archive, first + index)), index
            assert np.array_equal(read_plane(archive, index, "mask"), read_plane(self.archive, first + index, "mask"))
            assert np.array_equal(read_plane(archive, index, "variance"), read_plane(self.archive, first + index, "variance"))


@pytest.fixture(scope="module")
def live(tmp_path_factory):
    return Live(tmp_path_factory.mktemp("recordings"))


def write_pictures(folder, counts, kind, first=1):
    folder.mkdir()
    for number, frame in enumerate(counts, first):
        if kind == "png":
            Image.fromarray(frame.astype(np.uint16)).save(folder / f"take_{number:06}.png")
        elif kind == "tif":
            tifffile.imwrite(folder / f"take_{number:06}.tif", frame)
        elif kind in ("exr", "exr of fractions"):
            values = frame.astype(np.float32) / np.float32(1 if kind == "exr" else WHITE)
            OpenEXR.File({"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage},
                         {"Y": values}).write(str(folder / f"take_{number:06}.exr"))
        elif kind == "pgm":  # pgm(5): two bytes a sample, the most significant first
            (folder / f"take_{number:06}.pgm").write_bytes(b"P5\n%d %d\n%d\n" % (WIDTH, HEIGHT, WHITE) + frame.astype(">u2").tobytes())
        elif kind == "dng":
            write_dng(folder / f"take_{number:06}.dng", frame.astype(np.uint16), black=BLACK, white=WHITE)
        elif kind == "12p":  # PFNC: the lowest bits first
            bits = (frame.ravel()[:, None] >> np.arange(12)) & 1
            (folder / f"take_{number:06}.raw").write_bytes(np.packbits(bits.astype(np.uint8), bitorder="little").tobytes())


@pytest.mark.parametrize("packing", ["16", "12"])
def test_a_cine_that_began_mid_cycle_gives_the_live_takes_targets(live, packing):
    path = live.folder / f"take{packing}.cine"
    write_cine(path, live.counts[CUT:], live.times[CUT:], packing=packing)
    archive, report = live.ingest(path, f"cine{packing}")
    assert report["targets_written"] == CYCLES - 1 and report["slots_missing"] == 0
    live.expect_same(archive)
    recording = manifest(archive)["extra"]["recording"]
    assert recording["first_slot"] == CUT and recording["first_number"] == -100 and recording["times"] == "the camera's"


def test_a_cine_without_times_does_as_well(live):
    path = live.folder / "untimed.cine"
    write_cine(path, live.counts[CUT:], None, packing="12", annotation=b"shot 7, held")
    archive, report = live.ingest(path, "untimed")
    assert report["targets_written"] == CYCLES - 1
    live.expect_same(archive)
    assert manifest(archive)["extra"]["recording"]["times"] == "number times period"


def test_tens_of_gigabytes_take_no_more_memory_than_a_small_file(live):
    """Frames so far apart that the file is 40 GiB long, most of it holes."""
    sizes, memory = {}, {}
    for name, apart in (("small", 0), ("large", 64 << 20)):
        path = live.folder / f"{name}.cine"
        write_cine(path, live.counts[CUT:], live.times[CUT:], apart=apart)
        sizes[name] = path.stat().st_size
        process = subprocess.Popen(live.command(path, name)[1], stdout=subprocess.DEVNULL)
        _, status, used = os.wait4(process.pid, 0)
        assert status == 0
        memory[name] = used.ru_maxrss
        live.expect_same(live.folder / f"{name}.rfa")
        path.unlink()
    assert sizes["large"] > 40 << 30
    assert memory["large"] < memory["small"] * 1.2, memory


@pytest.mark.parametrize("kind", ["png", "tif", "pgm", "dng", "exr", "exr of fractions", "12p"])
def test_a_numbered_folder_that_began_mid_cycle_gives_the_live_takes_targets(live, kind):
    folder = live.folder / kind
    write_pictures(folder, live.counts[CUT:], kind)
    options = {"12p": ["--raw", f"{WIDTH}x{HEIGHT}:12p"], "exr of fractions": ["--full-scale", 1]}.get(kind, [])
    archive, report = live.ingest(folder, f"folder_{kind}", *options)
    assert report["targets_written"] == CYCLES - 1 and report["slots_missing"] == 0
    live.expect_same(archive)


def test_frames_behind_one_another_in_one_file_and_scaled_pictures(live):
    stream = live.folder / "all.raw"
    stream.write_bytes(live.counts[CUT:].astype("<u2").tobytes())
    live.expect_same(live.ingest(stream, "stream", "--raw", f"{WIDTH}x{HEIGHT}:16")[0])
    write_pictures(live.folder / "high", live.counts[CUT:].astype(np.uint16) * 16, "tif")
    live.expect_same(live.ingest(live.folder / "high", "high", "--full-scale", 65520)[0])
    refusal = live.ingest(live.folder / "high", "unscaled", code=1)
    assert "--full-scale" in refusal


@pytest.mark.parametrize("timed", [True, False])
def test_a_lost_frame_masks_its_group_and_nothing_else(live, timed):
    """A frame of cycle 1 that the camera did not keep: its time is missing, or its number."""
    lost = CYCLE + 5 * 18 + 9
    kept = np.delete(np.arange(CUT, CYCLES * CYCLE), lost - CUT)
    if timed:
        path = live.folder / "lost.cine"
        write_cine(path, live.counts[kept], live.times[kept])
    else:
        path = live.folder / "lost"
        path.mkdir()
        for n in kept:
            tifffile.imwrite(path / f"f{n}.tif", live.counts[n])
    archive, report = live.ingest(path, f"lost{timed}", code=2)
    missing = identification(archive)["cameras"][0]["missing"]
    triggers = {t for r in missing for t in range(r["first_trigger"], r["first_trigger"] + r["count"])}
    assert triggers == set(range(5 * 18, 6 * 18)) and report["causes"] == {"no_frame": 1, "not_proved": 17}
    for index in (1, 2):
        assert np.array_equal(read_lamps(archive, index), read_lamps(live.archive, index + 1))


def test_a_loss_that_no_number_tells_of_is_found_by_the_code_and_costs_up_to_the_next_landmark(live):
    """Renumbered files: frame by frame contiguous, one is not there."""
    lost = CYCLE + 5 * 18 + 9
    kept = np.delete(np.arange(CUT, CYCLES * CYCLE), lost - CUT)
    write_pictures(live.folder / "renumbered", live.counts[kept], "tif")
    archive, _ = live.ingest(live.folder / "renumbered", "renumbered", "--frames", live.folder / "account.jsonl", code=2)
    account = [json.loads(line) for line in (live.folder / "account.jsonl").read_text().splitlines()]
    for frame in account:  # no frame is mislabelled
        assert kept[frame["frame_id"]] - CYCLE == frame["cycle"] * CYCLE + frame["slot"], frame
    # All but what lies between the landmarks around the loss; a new lock costs nothing more.
    placed = {frame["cycle"] * CYCLE + frame["slot"] for frame in account}
    # (The files end with the last cycle, which by their count is one frame short, and so no whole one.)
    missing = set(range((CYCLES - 2) * CYCLE)) - placed
    assert lost - CYCLE in missing and min(missing) >= 5 * 18 and max(missing) < 7 * 18, sorted(missing)
    assert np.array_equal(read_lamps(archive, 1), read_lamps(live.archive, 2))


def test_a_range_is_taken_by_the_cameras_numbers(live):
    path = live.folder / "ranged.cine"
    write_cine(path, live.counts, live.times, first=-CYCLE)
    archive, report = live.ingest(path, "ranged", "--range", f"{CUT - CYCLE}:{3 * CYCLE - 1}")
    assert report["targets_written"] == CYCLES - 1
    live.expect_same(archive)
    assert "frames are" in live.ingest(path, "beyond", "--range", "5000:6000", code=1)


def test_what_does_not_lock_says_what_was_tried(live):
    dark = live.folder / "dark.cine"
    write_cine(dark, np.full((400, HEIGHT, WIDTH), 64, np.uint16), np.arange(400) * 462963)
    assert "all of them are dark" in live.ingest(dark, "no", code=1)
    slow = live.folder / "slow.cine"
    write_cine(slow, live.counts[:400], live.times[0] + np.arange(400) * 1_000_000)
    refusal = live.ingest(slow, "no", code=1)
    assert "1000.000 us apart" in refusal and "462.96" in refusal, refusal
    short = live.folder / "short.cine"
    write_cine(short, live.counts[:100], live.times[:100])
    assert "whole cycle" in live.ingest(short, "no", code=1)
    shuffled = live.folder / "shuffled.cine"
    order = np.random.default_rng(3).permutation(500)
    write_cine(shuffled, live.counts[order], live.times[:500])
    assert "none fits" in live.ingest(shuffled, "no", code=1)
    assert not (live.folder / "no.rfa").exists()


def test_another_camera_and_damage_are_named(live):
    path = live.folder / "gbrg.cine"
    write_cine(path, live.counts[:200], live.times[:200], cfa=3)
    assert 'cfa = "gbrg"' in live.ingest(path, "no", code=1)
    whole = path.read_bytes()
    path.write_bytes(whole[: len(whole) // 2])
    assert "cut short" in live.ingest(path, "no", code=1)
    folder = live.folder / "mixed"
    write_pictures(folder, live.counts[:10], "tif")
    write_pictures(live.folder / "mixed2", live.counts[:10], "png")
    (live.folder / "mixed2/take_000003.png").rename(folder / "other_000003.png")
    assert "several series" in live.ingest(folder, "no", code=1)
