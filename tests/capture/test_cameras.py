# SPDX-License-Identifier: MIT
"""Several cameras in one take: each comes out as it does alone, and what one loses the others do not."""
import json
import subprocess

import numpy as np
import pytest

from virtual_take import BIN, SMALL_STAGE, VirtualStage, missing_slots, missing_triggers, read_lamps, sequence

CYCLE, CYCLES = 180, 2
# Without noise, whose generator is keyed by the camera's number; from the side, of another size, on a trigger line of its own.
SIDE = """[[camera]]
width = 40
height = 56
cfa = "none"
position_m = [1.2, 0.3, 1.1]
noise_read_counts = 0
noise_shot = 0
"""
BOTH = SMALL_STAGE + SIDE + "trigger = 1\n"


def take(running, archive, sources, *options, code=0, cycles=CYCLES):
    cameras = [word for source in sources for word in ("--camera", source)]
    return running.stagectl("run", "--sequence", sequence("single"), "--nominal", "--cycles", cycles, "-o", archive, "--json",
                            *cameras, *options, code=code, camera=False)


def rings(folder, count):
    return [f"ring:{folder}/cam{n}.ring" for n in range(count)]


@pytest.fixture(scope="module")
def alone(tmp_path_factory):
    """What each camera records when it is the only one."""
    lamps = []
    for name, stage in (("front", SMALL_STAGE), ("side", SIDE)):
        folder = tmp_path_factory.mktemp(name)
        with VirtualStage(folder / "work", "spheres.toml", stage=stage) as running:
            take(running, folder / "take.rfa", rings(folder / "work", 1))
        lamps.append([read_lamps(folder / "take.rfa", index) for index in range(CYCLES)])
    return lamps






def test_each_camera_comes_out_as_it_does_alone_and_every_tool_finds_it(tmp_path, alone):
    archive = tmp_path / "take.rfa"
    with VirtualStage(tmp_path / "work", "spheres.toml", stage=BOTH) as running:
        report = take(running, archive, rings(tmp_path / "work", 2))
    assert report["targets_written"] == 2 * CYCLES and report["slots_missing"] == 0
    for camera in (0, 1):
        for index in range(CYCLES):
            assert np.array_equal(read_lamps(archive, index, camera=camera), alone[camera][index]), (camera, index)
    for camera in report["cameras"]:
        assert camera["frames"] == CYCLES * CYCLE and camera["slots_missing"] == 0
        # The virtual camera's clock is the board's, to the nanosecond.
        clock = camera["clock"]
        assert clock["samples"] == CYCLES * CYCLE and abs(clock["drift_ppm"]) < 0.1 and clock["scatter_ns"] < 50, clock
    checked = subprocess.run([BIN / "rf", "verify", archive], capture_output=True, text=True)
    assert checked.returncode == 0 and "4 targets intact" in checked.stdout, checked.stdout + checked.stderr
    for camera, shape in ((0, (64, 48)), (1, (40, 56))):
        relit = tmp_path / f"relit{camera}.exr"
        subprocess.run([BIN / "rf", "relight", archive, "--camera", str(camera), "--light", "0 0 1 1 1 1", "-o", relit], check=True)
        told = subprocess.run(["exrheader", relit], capture_output=True, text=True, check=True).stdout
        assert f"({shape[0] - 1} {shape[1] - 1})" in told, told


def test_frames_that_one_camera_loses_are_missing_of_that_one_with_their_causes(tmp_path, alone):
    faults = "".join(f'[[fault]]\nkind = "{kind}"\ncamera = 1\ntrigger = {trigger}\n'
                     for kind, trigger in (("drop_frame", 40), ("drop_frame", 41), ("drop_trigger", 60)))
    (tmp_path / "faults.toml").write_text(faults)
    archive = tmp_path / "take.rfa"
    with VirtualStage(tmp_path / "work", "spheres.toml", "--inject", tmp_path / "faults.toml", stage=BOTH) as running:
        report = take(running, archive, rings(tmp_path / "work", 2), code=2)
    assert missing_triggers(archive, 0) == set() and missing_triggers(archive, 1) == {40, 41, 60}
    assert report["causes"] == {"link_lost_it": 2, "camera_missed_trigger": 1}
    assert [slot["cause"] for slot in missing_slots(archive, 1)] == ["link_lost_it", "camera_missed_trigger"]
    for index in range(CYCLES):
        assert np.array_equal(read_lamps(archive, index, camera=0), alone[0][index])
    assert np.array_equal(read_lamps(archive, 1, camera=1), alone[1][1])


def test_a_camera_that_dies_takes_nothing_from_the_other(tmp_path, alone):
    """The second is one without hardware, which shows nothing of the lamps and dies at its hundredth frame."""
    archive = tmp_path / "take.rfa"
    with VirtualStage(tmp_path / "work", "spheres.toml", stage=BOTH) as running:
        sources = [*rings(tmp_path / "work", 1), "fake:2160,die@100"]
        done = subprocess.run(list(map(str, [
            BIN / "stagectl", "run", "--stage", running.stage, "--board", f"socket:{running.folder}/board.sock", "--sequence",
            sequence("single"), "--nominal", "--cycles", CYCLES, "-o", archive, "--json", "--camera", sources[0], "--camera", sources[1],
        ])), capture_output=True, text=True, timeout=300)
    assert done.returncode == 2, done.stderr
    report = json.loads(done.stdout)
    assert report["board_end"] is None, "the board plays on"
    assert missing_triggers(archive, 0) == set()
    dead = report["cameras"][1]
    assert dead["end"]["cause"] == "camera_gone" and dead["slots_missing"] == CYCLES * CYCLE
    assert "camera 1: the fake camera is gone" in done.stderr
    for index in range(CYCLES):
        assert np.array_equal(read_lamps(archive, index, camera=0), alone[0][index])


def test_sources_must_be_as_many_as_cameras_and_differ(tmp_path):
    with VirtualStage(tmp_path / "work", "spheres.toml", stage=BOTH) as running:
        told = running.stagectl("run", "--sequence", sequence("single"), "--nominal", "-o", tmp_path / "a.rfa", code=1)
        assert "--camera is given 1 times and 2 cameras are to be opened" in told
        twice = rings(tmp_path / "work", 1) * 2
        told = running.stagectl("run", "--sequence", sequence("single"), "--nominal", "-o", tmp_path / "a.rfa", "--camera", twice[0],
                                "--camera", twice[1], code=1, camera=False)
        assert "cameras 0 and 1 are both ring:" in told
    assert not (tmp_path / "a.rfa").exists()
