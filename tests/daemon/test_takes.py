# SPDX-License-Identifier: MIT
# Takes by the daemon: what is recorded is what `stagectl run` records, light ends at a word, and no disk ends a take otherwise than clean.
import contextlib
import json
import re
import signal
import subprocess

import pytest

from stage_daemon import BIN, Refused, read_lamps, targets_written, until


def verify(archive):
    return subprocess.run([str(BIN / "rf"), "verify", str(archive)], capture_output=True, text=True)


def test_takes_are_named_by_slate_and_number(daemon):
    names = [daemon.run("record", "--slate", "12A", "--notes", "blinks", "--json")["take"] for _ in range(2)]
    assert names == ["12A_001", "12A_002"]
    assert daemon.run("record", "--slate", "12A", "--take", "7", "--json")["take"] == "12A_007"
    assert daemon.run("record", "--slate", "12A", "--json")["take"] == "12A_008"
    assert "12A_007 is there already" in daemon.run("record", "--slate", "12A", "--take", "7", code=1)
    takes = {take["take"]: take for take in daemon.run("takes", "--json")["takes"]}
    assert list(takes)[0] == "12A_008" and takes["12A_001"]["notes"] == "blinks"
    assert all(take["state"] == "finished" and take["targets_missing"] == 0 for take in takes.values())
    manifest = json.loads((daemon.takes / "12A_007.rfa/manifest.json").read_text())
    assert manifest["slate"]["scene"] == "12A" and manifest["slate"]["take"] == "7"
    assert verify(daemon.takes / "12A_007.rfa").returncode == 0


# The emulated board is deterministic and so is the camera: a take by the daemon has the same samples as one by hand.
def test_a_take_of_the_daemon_is_a_take_of_the_command_line(alone, tmp_path):
    daemon = alone("seconds = 0.2")
    daemon.run("record", "--slate", "same")
    daemon.end()
    daemon.stage.end()
    daemon.stage.start()
    run = [BIN / "stagectl", "run", "--basis", "single", "--stage", daemon.config, "--nominal", "--cycles", "3"]
    subprocess.run([*map(str, run), "-o", str(tmp_path / "hand.rfa")], check=True, capture_output=True)
    archives = (daemon.takes / "same_001.rfa", tmp_path / "hand.rfa")
    by_daemon, by_hand = (read_lamps(path / "cam0/target_000000.exr") for path in archives)
    assert by_daemon.shape == (156, 24, 32) and (by_daemon == by_hand).all() and by_daemon.max() > 0.1


def test_stop_acts_at_once_and_reports_dark_when_the_board_has_said_so(daemon):
    daemon.run("record", "--seconds", "60", "--no-wait")
    until(lambda: targets_written(daemon) >= 1)
    stopped = daemon.run("stop", "--json")
    assert stopped["dark"]
    daemon.until_state("idle")
    events = [event["event"] for event in daemon.events()][-6:]
    assert events.index("stop_asked") < events.index("dark") < events.index("take_finished")
    end = daemon.events("take_finished")[-1]
    assert "stopped by uid" in end["text"] and end["data"]["targets_written"] >= 1
    assert end["data"]["cameras"][0]["frames"] < 60 * 2160 / 4, "it did not play on"
    assert daemon.run("takes", "--json")["takes"][0]["state"] == "finished"


def test_ctrl_c_at_the_client_ends_the_light_and_finishes_the_take(daemon):
    client = daemon.background("record", "--seconds", "60", "--json")
    until(lambda: targets_written(daemon) >= 1)
    client.send_signal(signal.SIGINT)
    out, _ = client.communicate(timeout=60)
    assert client.returncode == 2 and json.loads(out)["targets_written"] >= 1
    assert daemon.until_state("idle")


def test_a_take_is_what_the_stage_was_armed_for(daemon):
    daemon.run("arm", "--seconds", "0.5")
    armed = len(daemon.events("armed"))
    assert daemon.run("record", "--json")["targets_written"] == 6
    assert len(daemon.events("armed")) == armed, "the board had it already"
    daemon.run("arm", "--seconds", "0.5")
    assert daemon.run("record", "--seconds", "0.1", "--json")["targets_written"] == 2
    assert daemon.run("record", "--json")["targets_written"] == 2, "as configured"


def test_a_re_arming_that_fails_leaves_what_is_armed(daemon):
    daemon.run("arm")
    assert "targets a second" in daemon.run("arm", "--fps", "7.3", code=1)
    assert daemon.state() == "armed" and daemon.call("status")["plan"]["cycles"] == 2
    assert daemon.run("record", "--json")["targets_written"] == 2


def test_arming_foretells_and_stop_takes_it_back(daemon):
    plan = daemon.run("arm", "--seconds", "0.5", "--json")
    assert daemon.state() == "armed" and plan["cycles"] == 6 and plan["seconds"] == pytest.approx(0.5, rel=1e-4)
    daemon.run("stop")
    assert daemon.state() == "idle"


# What the disk is foretold to hold is held: not less than a take needs, and not twice as much.
@pytest.mark.parametrize("words", [[], ["--fps", "24", "--seconds", "0.3"]])
def test_the_disk_that_is_foretold_is_what_a_take_needs(daemon, words):
    plan = daemon.run("arm", *words, "--json")
    end = daemon.run("record", *words, "--slate", "size", "--json")
    files = sum(path.stat().st_size for path in (daemon.takes / f"{end['take']}.rfa").rglob("*") if path.is_file())
    overhead = 256 * 1024 * end["targets_written"]
    assert files <= plan["disk_bytes_needed"] < 1.5 * files + overhead, (files, plan)


def test_a_take_that_does_not_fit_is_refused_before_the_light(alone):
    daemon = alone("reserve_mb = 16000000")
    for verb in ("arm", "record"):
        said = daemon.run(verb, code=1)
        assert "are kept" in said and "0.0 s of this take fit" in said
    assert daemon.state() == "idle" and daemon.events("disk_short")
    assert not list(daemon.takes.glob("*"))


def test_sequences_are_swapped_by_name(daemon):
    (daemon.folder / "sequences/few.toml").write_text('basis = "triangle"\n')
    assert "takes are recorded with few" in daemon.run("swap", "few")
    assert daemon.run("arm", "--json")["basis"] == "triangle"
    assert daemon.run("swap", "s159", "--json") == {"sequence": "s159", "armed": True}
    assert daemon.call("status")["plan"]["basis"] == "s159" and daemon.state() == "armed"
    daemon.run("stop")
    (daemon.folder / "sequences/bad.toml").write_text("basis = 7\n")
    assert re.search(r"bad.toml:1: basis must be a text", daemon.run("swap", "bad", code=1))
    assert "no_such" in daemon.run("swap", "no_such", code=1)
    assert daemon.call("status")["sequence"] == "s159"


def test_the_last_target_is_shown_as_a_picture(daemon, tmp_path):
    from PIL import Image

    daemon.run("record", "--slate", "look")
    shown = daemon.run("preview", "-o", tmp_path / "look.png", "--json")
    assert shown["archive"].endswith(f"{daemon.run('takes', '--json')['takes'][0]['take']}.rfa")
    with Image.open(tmp_path / "look.png") as picture:
        assert picture.size == (32, 24) and picture.convert("L").getextrema()[1] > 100
    assert "there is no take" in daemon.run("preview", "nobody_001", code=1)


def test_a_calibration_is_measured_and_in_force(alone):
    daemon = alone('nominal = false\nsequence = "single"')
    assert "camera 0 is not calibrated" in daemon.run("record", code=1)
    daemon.stage.end()
    daemon.until_state("fault")
    daemon.stage.scene = "card.toml"
    daemon.stage.start()
    daemon.until_state("idle")
    measured = daemon.run("calibrate", "--card", "0.985", "--json")
    assert measured["frames"] > 0 and (daemon.folder / "calibration/cam0/flat.exr").exists()
    daemon.until_state("idle")
    assert daemon.run("record", "--json")["targets_written"] >= 1


def test_a_calibration_that_is_stopped_is_none(daemon):
    daemon.call("calibrate", card=0.985, cycles=2000)
    until(lambda: (daemon.call("status")["take"] or {}).get("triggers_fired", 0) > 400)
    assert daemon.run("stop", "--json")["dark"]
    daemon.until_state("idle")
    assert "was cut short: stopped by" in daemon.events("calibration_failed")[-1]["text"]
    assert not (daemon.folder / "calibration/cam0").exists()


# The reserve is put so near to what is free that a file of another program reaches it.
def leave_2_gb(daemon):
    reserve_mb = int((daemon.call("status")["disk_bytes_free"] - 2e9) / 1e6)
    daemon.config.write_text(daemon.text.replace("reserve_mb = 10", f"reserve_mb = {reserve_mb}"))
    daemon.run("reload")
    daemon.until_state("idle")


@contextlib.contextmanager
def filled(daemon):
    filler = daemon.folder / "filler"
    subprocess.run(["fallocate", "-l", "3G", str(filler)], check=True)
    yield
    filler.unlink()


def test_a_disk_that_comes_to_its_reserve_ends_the_take_cleanly(alone):
    daemon = alone()
    leave_2_gb(daemon)
    client = daemon.background("record", "--seconds", "60", "--json")
    until(lambda: ((daemon.call("status")["take"] or {}).get("triggers_fired", 0)) > 400)
    with filled(daemon):
        out, err = client.communicate(timeout=120)
    assert client.returncode == 2, err
    end = json.loads(out)
    assert daemon.events("disk_full") and "are kept" in daemon.events("take_finished")[-1]["text"]
    assert end["targets_written"] >= 1 and end["write_error"] == ""
    assert {take["state"] for take in daemon.run("takes", "--json")["takes"]} == {"finished"}
    assert daemon.until_state("idle")


def test_a_swap_that_the_disk_has_no_room_for_leaves_the_sequence_and_nothing_armed(alone):
    daemon = alone()
    leave_2_gb(daemon)
    daemon.run("arm")
    with filled(daemon):
        assert "make room" in daemon.run("swap", "s159", code=1)
    assert daemon.call("status")["sequence"] == "single" and daemon.until_state("idle")
    assert daemon.run("record", "--json")["targets_missing"] == 0


def test_a_take_of_much_memory_is_armed_behind_its_clearing(alone):
    daemon = alone("memory_mb = 2000")
    daemon.run("arm")
    take = daemon.run("record", "--json")
    assert take["targets_missing"] == 0 and take["slots_missing_total"] == 0


def test_recording_without_seconds_is_as_configured(daemon):
    plan = daemon.run("arm", "--json")
    assert plan["seconds"] == pytest.approx(plan["cycles"] * 180 / 2160, rel=1e-3) and plan["cycles"] == 2


def test_a_request_beyond_all_bounds_is_refused(daemon):
    for seconds in (0, -1, 1e9, 1e300):
        with pytest.raises(Refused) as refused:
            daemon.call("arm", seconds=seconds)
        assert refused.value.code == -32602
    assert daemon.state() == "idle"
