# SPDX-License-Identifier: MIT
# What goes away or goes wrong, in each state: the daemon says what, ends dark, keeps what was finished, and goes on when it is back.
import json
import os
import pathlib
import re
import signal
import subprocess
import time

import pytest

from stage_daemon import BIN, Daemon, assert_takes_are_whole, bring_to, targets_written, until


@pytest.mark.parametrize("state", ["idle", "armed", "recording"])
@pytest.mark.parametrize("how", ["board killed", "board stands still", "stage ended", "stage killed"])
def test_a_device_that_goes_away_is_a_fault_that_says_so(alone, state, how):
    daemon = alone()
    bring_to(daemon, state)
    if how == "board killed":
        os.kill(daemon.stage.board_process(), signal.SIGKILL)
    elif how == "board stands still":
        os.kill(board := daemon.stage.board_process(), signal.SIGSTOP)
    else:
        daemon.stage.end(signal.SIGKILL if how == "stage killed" else signal.SIGTERM)
    daemon.until_state("fault", seconds=90)
    state_now = daemon.call("status")
    assert any(word in state_now["fault"] for word in ("board", "camera", "ring")), state_now["fault"]
    assert state_now["fault_is_latched"] == (state != "idle")
    for verb in ("arm", "record"):
        assert "in state fault" in daemon.run(verb, code=1)
    if how == "board stands still":
        os.kill(board, signal.SIGKILL)
    if state == "recording":
        assert daemon.events("take_finished")[-1]["data"]["slots_missing_total"] > 0
        assert_takes_are_whole(daemon, 1)
    daemon.stage.end(signal.SIGKILL)
    daemon.stage.start()
    if state == "idle":
        daemon.until_state("idle")
    else:
        time.sleep(1)
        assert daemon.state() == "fault", "what came while light could play stays until somebody looks"
        daemon.run("status", "--clear-fault")
    assert daemon.run("record", "--slate", "after", "--json")["targets_missing"] == 0


@pytest.mark.parametrize("light, ended", [("record", "take_finished"), ("calibrate", "calibration_finished")])
def test_a_stage_that_goes_right_after_light_that_ended_well_is_taken_again_when_it_is_back(alone, light, ended):
    daemon = alone()
    daemon.stage.end()
    daemon.until_state("fault")
    daemon.stage.scene = "card.toml"
    daemon.stage.start()
    for _ in range(6):  # the daemon looks at its devices at once: in some of them it finds the board gone
        daemon.until_state("idle")
        board = daemon.stage.board_process()
        with daemon.connect() as client:
            client.call("subscribe")
            client.call(light, **({"card": 0.985} if light == "calibrate" else {}))
            client.until_event(ended)
            os.kill(board, signal.SIGKILL)
        daemon.until_state("fault")
        assert not daemon.call("status")["fault_is_latched"]
        daemon.stage.end(signal.SIGKILL)
        daemon.stage.start()
    daemon.until_state("idle")


@pytest.mark.parametrize("state", ["idle", "armed", "recording"])
def test_sigterm_finishes_what_is_held_and_leaves_the_board_dark(alone, state):
    daemon = alone()
    bring_to(daemon, state)
    assert daemon.end(signal.SIGTERM) == 0, daemon.read_log()
    assert not daemon.socket.exists() and "daemon_stopping" in daemon.read_log()
    daemon.start()
    daemon.until_state("idle")
    if state == "recording":
        assert_takes_are_whole(daemon, 1)
        assert daemon.run("takes", "--json")["takes"][0]["targets_missing"] > 0


@pytest.mark.parametrize("state", ["idle", "armed", "recording"])
def test_a_daemon_that_is_killed_loses_no_finished_target_and_the_board_goes_dark(alone, state):
    daemon = alone()
    bring_to(daemon, state)
    written = targets_written(daemon)
    daemon.end(signal.SIGKILL)
    time.sleep(1)
    daemon.start()  # the socket that was left behind does not hinder it
    daemon.until_state("idle", "fault")
    if daemon.state() == "fault":
        assert "host" in daemon.call("status")["fault"] or "heartbeat" in daemon.call("status")["fault"]
        daemon.run("status", "--clear-fault")
    if state == "recording":
        take = daemon.run("takes", "--json")["takes"][0]
        assert take["state"] == "unfinished" and take["targets_written"] >= written
        report = subprocess.run([str(BIN / "rf"), "verify", take["archive"], "--json"], capture_output=True, text=True)
        assert len(json.loads(report.stdout)["intact"]) == take["targets_written"]
    assert daemon.run("record", "--slate", "after", "--json")["targets_missing"] == 0


def test_a_take_that_there_is_no_memory_for_is_an_error_and_no_light(alone):
    daemon = alone()
    daemon.run("arm")
    of_daemon = ["prlimit", "--pid", str(daemon.process.pid)]
    size_kb = re.search(r"VmSize:\s+(\d+)", pathlib.Path(f"/proc/{daemon.process.pid}/status").read_text())[1]
    subprocess.run([*of_daemon, f"--as={(int(size_kb) << 10) + (1 << 20)}:unlimited"], check=True)
    assert daemon.run("record", "--slate", "none", code=1)
    subprocess.run([*of_daemon, "--as=unlimited:unlimited"], check=True)
    daemon.until_state("idle", "fault")
    assert daemon.run("stop", "--json")["dark"]
    if daemon.state() == "fault":
        daemon.run("status", "--clear-fault")
    assert daemon.run("record", "--slate", "after", "--json")["targets_missing"] == 0


def test_a_configuration_that_is_wrong_is_said_with_file_and_line_and_the_old_one_stays(alone):
    daemon = alone()
    lines = daemon.text.splitlines()
    at = next(number for number, line in enumerate(lines, 1) if line.startswith("seconds"))
    for wrong in ('seconds = "ten"', "secnds = 10", "seconds = -1", "seconds ="):
        daemon.config.write_text(daemon.text.replace(lines[at - 1], wrong))
        assert f"{daemon.config}:{at}: " in daemon.run("reload", code=1)
        daemon.process.send_signal(signal.SIGHUP)
        until(lambda: f"{daemon.config}:{at}: " in daemon.events("configuration_wrong")[-1]["text"])
    for wrong in ('quality = "best"', 'estimate = "guess"', 'fill = "x"', 'slate = "../x"', 'sequence = "none"'):
        daemon.config.write_text(daemon.text.replace(lines[at - 1], wrong).replace('sequence = "single"\n', "", "sequence" in wrong))
        assert f"{daemon.config}:" in daemon.run("reload", code=1), wrong
        check = [str(BIN / "stagectl"), "serve", "--check", "--json", "--config", str(daemon.config)]
        checked = subprocess.run(check, capture_output=True, text=True)
        assert checked.returncode == 1 and f"{daemon.config}:" in checked.stderr
        assert f"{daemon.config}:" in json.loads(checked.stdout)["problem"]
    assert daemon.run("arm", "--json")["cycles"] == 2
    daemon.run("stop")
    daemon.config.write_text(daemon.text.replace(lines[at - 1], "seconds = 0.5"))
    daemon.run("reload")
    daemon.until_state("idle")
    assert daemon.run("arm", "--json")["cycles"] == 6
    assert "for the states idle or fault" in daemon.run("reload", code=1)


def test_a_folder_that_cannot_be_written_to_is_said_with_file_and_line(alone):
    daemon = alone()

    def serve(*options):
        command = [str(BIN / "stagectl"), "serve", "--config", str(daemon.config), *options]
        return subprocess.run(command, capture_output=True, text=True, timeout=60)

    takes = f'takes = "{daemon.takes}"\n'
    at = daemon.text[: daemon.text.index(takes)].count("\n") + 1
    # Below a file there is none, not for root either.
    for key, line in {"takes": at, "spill": at + 1}.items():
        others = takes if key == "spill" else ""
        daemon.config.write_text(daemon.text.replace(takes, f'{others}{key} = "{daemon.config}/{key}"\n'))
        said = f"{daemon.config}:{line}: daemon.{key} is '{daemon.config}/{key}', which is no folder"
        assert said in daemon.run("reload", code=1)
        for options in ((), ("--check",)):
            refused = serve(*options)
            assert refused.returncode == 1 and said in refused.stderr, refused
    # One that is not there yet is made where the daemon itself reads of it.
    new = daemon.folder / "new/takes"
    daemon.config.write_text(daemon.text.replace(str(daemon.takes), str(new)))
    assert serve("--check").returncode == 0 and not new.parent.exists()
    daemon.run("reload")
    daemon.until_state("idle")
    assert new.is_dir() and daemon.run("record", "--json")["targets_missing"] == 0


def test_a_daemon_without_its_devices_waits_for_them(tmp_path):
    with Daemon(tmp_path) as daemon:
        daemon.until_state("fault")
        assert "ring" in daemon.call("status")["fault"] and not daemon.call("status")["fault_is_latched"]
        assert "fault" in daemon.run("status", code=1)
        said = daemon.run("stop", code=1)
        assert "did not confirm" in said and "emergency stop" in said


def test_a_take_to_a_folder_that_has_vanished_is_an_error_and_no_light(alone):
    daemon = alone()
    daemon.takes.rmdir()
    said = daemon.run("record", code=1)
    assert "takes" in said and daemon.until_state("idle")
    daemon.takes.mkdir()
    assert daemon.run("record", "--json")["targets_missing"] == 0


# What a wall's clock says decides nothing: it is moved by an hour, forth and back, while a take runs.
def test_a_jump_of_the_clock_changes_no_take(tmp_path, alone):
    source, shim = tmp_path / "jump.c", tmp_path / "jump.so"
    source.write_text(
        """#define _GNU_SOURCE
#include <dlfcn.h>
#include <time.h>
#include <sys/time.h>
static long calls;
static long jump(void) { return (++calls / 5) % 2 ? 3600 : -3600; }
int clock_gettime(clockid_t id, struct timespec *t) {
    static int (*real)(clockid_t, struct timespec *);
    if (!real) real = (int (*)(clockid_t, struct timespec *))dlsym(RTLD_NEXT, "clock_gettime");
    int result = real(id, t);
    if (id == CLOCK_REALTIME) t->tv_sec += jump();
    return result;
}
int gettimeofday(struct timeval *t, void *zone) {
    struct timespec now;
    clock_gettime(CLOCK_REALTIME, &now);
    t->tv_sec = now.tv_sec, t->tv_usec = now.tv_nsec / 1000;
    return 0;
}
time_t time(time_t *t) {
    struct timespec now;
    clock_gettime(CLOCK_REALTIME, &now);
    if (t) *t = now.tv_sec;
    return now.tv_sec;
}
"""
    )
    subprocess.run(["cc", "-shared", "-fPIC", "-O1", str(source), "-o", str(shim), "-ldl"], check=True)
    daemon = alone()
    daemon.end()
    daemon.start(LD_PRELOAD=str(shim))
    daemon.until_state("idle")
    end = daemon.run("record", "--seconds", "0.5", "--json")
    assert end["slots_missing_total"] == 0 and end["targets_missing"] == 0
    hours = {event["time"][11:13] for event in daemon.events()}
    assert len(hours) > 1, "the clock has jumped"
