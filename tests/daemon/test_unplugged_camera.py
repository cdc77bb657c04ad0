# SPDX-License-Identifier: MIT
# A GigE Vision camera that goes away in each state, however it goes: the daemon names it, ends dark, keeps what was finished, and records
# again when it is back. Over the loopback, through Aravis and the kernel's UDP.
import contextlib
import sys

import pytest

from stage_daemon import ROOT, Daemon, Refused, Stage, assert_frames_have_their_slots, assert_takes_are_whole, bring_to, targets_written, until

sys.path.append(str(ROOT / "tests/gige"))
from gige_camera import GigeCamera  # noqa: E402


@pytest.fixture
def on_gige(tmp_path):
    """A daemon on a stage of wall pace, which waits for no camera, and the camera."""
    camera = GigeCamera(tmp_path / "work/cam0.ring")
    daemon = Daemon(tmp_path, camera=f"aravis:{camera.address}")
    with Stage(daemon.work, "--pace", "wall"), contextlib.ExitStack() as plugged:
        camera.start()
        plugged.callback(camera.unplug)
        with daemon:
            daemon.until_state("idle")
            yield daemon, camera


def bring_into_light(daemon):
    """A calibration that lasts."""
    daemon.call("calibrate", card=0.985, cycles=2000)
    until(lambda: daemon.call("status")["take"]["triggers_fired"] > 400)


def is_cleared(daemon):
    try:
        return daemon.call("clear_fault")
    except Refused:
        return False


@pytest.mark.parametrize("state", ["idle", "armed", "recording", "calibrating"])
@pytest.mark.parametrize("how", ["unplugged", "stands still"])
def test_a_camera_that_goes_away_is_a_fault_that_names_it(on_gige, state, how):
    daemon, camera = on_gige
    bring_into_light(daemon) if state == "calibrating" else bring_to(daemon, state)
    if state == "recording":
        until(lambda: targets_written(daemon) >= 2)
    camera.unplug() if how == "unplugged" else camera.stand_still()
    daemon.until_state("fault", seconds=120)
    fault = daemon.call("status")
    assert camera.address in fault["fault"] or "OLS Line OLS1" in fault["fault"], fault["fault"]
    assert "check its power and cable" in fault["fault"], fault["fault"]
    assert fault["fault_is_latched"] == (state != "idle")
    assert daemon.run("stop", "--json")["dark"], "the board is there, whatever became of the camera"
    for verb in ("arm", "record"):
        assert "in state fault" in daemon.run(verb, code=1)
    if state == "recording":
        causes = daemon.events("take_finished")[-1]["data"]["causes"]
        assert max(causes, key=causes.get) == "camera_gone", causes
        assert_takes_are_whole(daemon, 2)
        assert_frames_have_their_slots(daemon.takes / "cut_001.rfa")
    if state == "calibrating":
        assert "is gone" in daemon.events("calibration_failed")[-1]["text"]
    if state in ("recording", "calibrating"):
        kinds = [event["event"] for event in daemon.events()]
        assert kinds.index("dark") < kinds.index("fault")
    if state != "idle":  # later looks at the devices find other words for it
        assert daemon.call("status")["fault"] == fault["fault"]
    if how == "unplugged":
        camera.start()
    else:
        camera.go_on()
    if state == "idle":
        daemon.until_state("idle")
    else:
        until(lambda: is_cleared(daemon))
    assert daemon.run("record", "--slate", "after", "--json")["targets_missing"] == 0
