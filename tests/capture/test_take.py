# SPDX-License-Identifier: MIT
"""Takes and calibrations end to end: against closed forms, and interrupted."""
import os
import random
import signal
import subprocess
import time

import numpy as np
import OpenEXR
import pytest

from virtual_take import HEIGHT, WIDTH, VirtualStage, missing_slots, read_lamps, sequence, target_file, verify

CARD = 0.985


@pytest.fixture(scope="module")
def card_stage(tmp_path_factory):
    with VirtualStage(tmp_path_factory.mktemp("card"), "card.toml") as stage:
        yield stage


@pytest.fixture(scope="module")
def calibration(card_stage):
    folder = card_stage.folder / "cal"
    card_stage.stagectl("calibrate", "-o", folder, "--card", CARD)
    return folder


def test_the_calibrated_card_shows_lamberts_cosine_under_every_lamp(card_stage, calibration):
    """At the centre of the stage every lamp is at one distance and on its own axis, and the flat has taken out the
    camera: what is left is r = rho max(0, n . l). Sums of all bases must agree with it alike."""
    # The card is twice as bright as skin, which the examples' exposures are for.
    for basis, exposure_us in (("single", 412), ("s159", 50), ("hadamard156", 25)):
        own = card_stage.folder / f"{basis}.toml"
        own.write_text(f'basis = "{basis}"\ncycles = 1\nexposure_us = {{ basis = {exposure_us}, tracking = 20 }}\n')
        archive = card_stage.folder / f"{basis}.rfa"
        card_stage.stagectl("run", "--sequence", own, "--calibration", calibration, "-o", archive)
        lights = [line.split() for line in (archive / "lights.lp").read_text().splitlines()[1:]]
        cosine = np.array([max(0.0, float(line[3])) for line in lights])
        lamps = read_lamps(archive, 0)[:, HEIGHT // 2 - 4 : HEIGHT // 2 + 4, WIDTH // 2 - 4 : WIDTH // 2 + 4]
        means = lamps.mean(axis=(1, 2))
        # A mean of 64 samples. A row of half the lamps has some 30 counts of noise at 2500, and inversion leaves a sixth of
        # it in a lamp value (noise gain 0.025, 0.032): 5 / (2.52 * 50 us) / 8 = 0.005 in r; five times that for the
        # largest of 156, and twice that at half the exposure.
        limit = {"single": 0.01, "s159": 0.025, "hadamard156": 0.05}[basis]
        errors = means - CARD * cosine
        limits = np.full(len(errors), limit)
        if basis == "hadamard156":
            # Lamp 0 rests on the row of all lamps with weight 1 (noise gain 1): 31 counts of noise at 3300, five times that.
            limits[0] = 5 * 31 / (2.52 * exposure_us) / 8
        assert (np.abs(errors) < limits).all(), basis
        assert abs(errors.mean()) < limit / 10, basis


def test_the_black_level_is_the_cameras_and_the_flat_falls_off_as_its_lens_does(calibration):
    black = OpenEXR.File(str(calibration / "cam0/black.exr")).channels()["Y"].pixels
    flat = OpenEXR.File(str(calibration / "cam0/flat.exr")).channels()["Y"].pixels
    # 128 frames: the mean's deviation is 2.68 / sqrt(128) = 0.24 counts, rounding included.
    assert abs(black.mean() - 64) < 0.05 and np.abs(black - 64).max() < 1.5
    y, x = np.mgrid[0:HEIGHT, 0:WIDTH]
    r2 = ((x + 0.5 - WIDTH / 2) ** 2 + (y + 0.5 - HEIGHT / 2) ** 2) / ((WIDTH / 2) ** 2 + (HEIGHT / 2) ** 2)
    lens = 1 - 0.25 * r2
    assert np.corrcoef(flat.ravel(), lens.ravel())[0, 1] > 0.9
    # Counts a microsecond on the axis, as the stage states them.
    assert abs(flat[22:26, 30:34].mean() / 2.52 - 1) < 0.01


@pytest.mark.parametrize("exposure_us, word", [(60, "saturates"), (1, "card reaches")])
def test_a_card_too_bright_or_too_dark_is_refused_and_nothing_is_written(card_stage, exposure_us, word):
    folder = card_stage.folder / f"refused{exposure_us}"
    printed = card_stage.stagectl("calibrate", "-o", folder, "--exposure-us", exposure_us, "--cycles", 2, code=1)
    assert word in printed and not folder.exists()


def test_a_view_that_the_card_does_not_fill_is_refused(tmp_path):
    with VirtualStage(tmp_path, "spheres.toml") as stage:
        printed = stage.stagectl("calibrate", "-o", tmp_path / "cal", "--exposure-us", 60, "--cycles", 2, code=1)
    assert "card" in printed and not (tmp_path / "cal").exists()


def test_the_same_take_gives_the_same_bytes_wherever_it_is_recorded(card_stage, calibration):
    arguments = ["run", "--sequence", sequence("single"), "--calibration", calibration, "--cycles", 1]
    archives = []
    for n in range(2):
        with VirtualStage(card_stage.folder / f"again{n}", "spheres.toml") as stage:
            archive = stage.folder / "take.rfa"
            stage.stagectl(*arguments, "-o", archive)
            archives.append({path.relative_to(archive): path.read_bytes() for path in archive.rglob("*") if path.is_file()})
    assert archives[0] == archives[1] and len(archives[0]) == 4


def test_ctrl_c_stops_the_light_and_finishes_the_archive(tmp_path):
    archive = tmp_path / "take.rfa"
    with VirtualStage(tmp_path / "work", "spheres.toml") as stage:
        run = subprocess.Popen(
            stage.command("run", "--sequence", sequence("single"), "--nominal", "--cycles", 2000, "-o", archive),
            stderr=subprocess.PIPE,
            text=True,
        )
        while not target_file(archive, 0).exists():
            assert run.poll() is None
            time.sleep(0.02)
        run.send_signal(signal.SIGINT)
        _, printed = run.communicate(timeout=60)
        assert run.returncode == 2 and "stopped" in printed
        assert stage.stagectl("status", "--json", camera=False)["state"] != "playing"
    checked = verify(archive)
    assert checked.returncode == 0, checked.stdout
    first, *_ = missing_slots(archive)
    assert first["why"] == "its light may have been cut off: stopped by you" and first["count"] == 1
    # What was never played is one line, with the reason.
    assert "to 1999: no frame of it was recorded: stopped by you" in checked.stdout
    intact = sum(line.startswith("ok") for line in checked.stdout.splitlines())
    assert len(checked.stdout.splitlines()) < intact + 6, checked.stdout


def test_kill_9_at_random_moments_leaves_what_was_finished(tmp_path):
    """KILLS=50 for the long version."""
    generator = random.Random(3)
    with VirtualStage(tmp_path / "work", "spheres.toml") as stage:
        for n in range(int(os.environ.get("KILLS", 6))):
            archive = tmp_path / f"take{n}.rfa"
            run = subprocess.Popen(
                stage.command("run", "--sequence", sequence("single"), "--nominal", "--cycles", 2000, "-o", archive),
                stderr=subprocess.DEVNULL,
            )
            while not archive.exists():
                assert run.poll() is None
                time.sleep(0.005)
            time.sleep(generator.uniform(0, 2))
            run.kill()
            run.wait()
            finished = sorted(path.name for path in (archive / "cam0").glob("target_??????.exr"))
            checked = verify(archive)
            intact = [line for line in checked.stdout.splitlines() if line.startswith("ok")]
            # A target may have been renamed and not journalled: one at most.
            assert len(finished) - 1 <= len(intact) <= len(finished), checked.stdout
            # The board saw its host go, unless that was before it was armed: it is dark, and says so.
            status = stage.stagectl("status", "--json", camera=False)
            assert status["state"] != "playing"
            if status["state"] == "fault":
                assert "host_lost" in status["fault"]
                stage.stagectl("status", "--clear-fault", camera=False)
