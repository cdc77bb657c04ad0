# SPDX-License-Identifier: MIT
# The daemon as a service: what it tells systemd, its log, and hours of takes without a leak.
import grp
import json
import os
import random
import re
import shutil
import signal
import socket
import subprocess
import time
from pathlib import Path

from stage_daemon import BIN, misplaced_lamps, read_lamps, until


class Systemd:
    """The end of sd_notify(3): a datagram socket that gathers what the service says."""

    def __init__(self, path):
        self.socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self.socket.bind(str(path))
        self.said = []

    def listen(self, seconds):
        end = time.monotonic() + seconds
        while (left := end - time.monotonic()) > 0:
            self.socket.settimeout(left)
            try:
                self.said += self.socket.recv(4096).decode().split("\n")
            except TimeoutError:
                break
        return self.said


def test_systemd_is_told_that_it_is_ready_its_state_and_that_it_lives(alone, tmp_path):
    daemon = alone()
    daemon.end()
    systemd = Systemd(tmp_path / "notify")
    daemon.start(NOTIFY_SOCKET=str(tmp_path / "notify"))
    until(lambda: systemd.listen(0.1).count("WATCHDOG=1") > 5)
    assert "READY=1" in systemd.said and "STATUS=idle" in systemd.said
    daemon.run("record", "--seconds", "60", "--no-wait")
    systemd.said.clear()
    until(lambda: any(line.startswith("STATUS=recording: untitled_001") for line in systemd.listen(0.1)))
    until(lambda: "WATCHDOG=1" in systemd.listen(0.1))
    daemon.process.send_signal(signal.SIGTERM)
    systemd.said.clear()
    until(lambda: "STOPPING=1" in systemd.listen(0.1))
    # It is told as long as it takes: a socket that nobody reads would hold the daemon back.
    until(lambda: systemd.listen(0.1) and daemon.process.poll() is not None)
    assert daemon.process.returncode == 0


def test_the_log_has_time_level_code_and_words_a_line_each(daemon):
    daemon.run("arm")
    lines = daemon.read_log().splitlines()
    pattern = r"\d{4}-\d\d-\d\d \d\d:\d\d:\d\d\.\d{3} (info|warning|error) \d{3} [a-z_]+: ."
    assert lines and all(re.match(pattern, line) for line in lines), lines
    known = {str(event["code"]): event["event"] for event in daemon.call("version")["events"]}
    assert all(known[line.split()[3]] == line.split()[4].rstrip(":") for line in lines)


def test_a_socket_may_be_given_to_a_group(alone):
    # Root may give it to any; others to one of their own.
    group = "daemon" if os.getuid() == 0 else grp.getgrgid(os.getgroups()[-1]).gr_name
    daemon = alone(f'socket_group = "{group}"')
    assert daemon.socket.group() == group
    daemon.end()
    daemon.config.write_text(daemon.text.replace(f'socket_group = "{group}"', 'socket_group = "no_such_group"'))
    done = subprocess.run(
        [str(BIN / "stagectl"), "serve", "--config", str(daemon.config)], capture_output=True, text=True, timeout=30
    )
    assert done.returncode == 1 and "no_such_group" in done.stderr and not daemon.socket.exists()


def ring_files():
    return {path.name for path in Path("/dev/shm").iterdir()}


FAULTS = ["drop_frame", "drop_trigger", "duplicate", "late", "swap", "wrong_size", "freeze"]


# SOAK_TAKES=200 and more: `make soak`. Each take with faults at random places; no frame is taken for another lamp's, and memory,
# descriptors, threads and files stay what they were.
def test_takes_with_random_faults_have_each_frame_in_its_slot_and_leave_the_daemon_as_it_was(alone, tmp_path):
    takes = int(os.environ.get("SOAK_TAKES", "12"))
    random.seed(int(os.environ.get("SOAK_SEED", "1")))
    slots = 180 * 2
    faults = tmp_path / "faults.toml"
    # The camera counts its triggers from its stage's start: take n has those from n * slots on.
    places = sorted(random.sample(range(slots * takes), 3 * takes))
    faults.write_text("".join(f'[[fault]]\nkind = "{random.choice(FAULTS)}"\ntrigger = {at}\n' for at in places))
    daemon = alone("fill = \"neighbours\"", options=("--inject", faults))
    shared_files, figures, seen, truth = ring_files(), [], 0, None
    for take in range(takes):
        end = daemon.background("record", "--slate", "soak", "--json")
        out, err = end.communicate(timeout=300)
        assert end.returncode in (0, 2), err
        seen += end.returncode == 2
        daemon.until_state("idle")
        # A client that has just left is still there for a moment.
        figures.append(tuple(map(min, zip(*(daemon.figures() for _ in range(10) if time.sleep(0.03) is None)))))
        latest = daemon.run("takes", "--limit", "1", "--json")["takes"][0]
        report = subprocess.run([str(BIN / "rf"), "verify", latest["archive"]], capture_output=True, text=True)
        assert latest["state"] == "finished" and latest["targets_written"] + latest["targets_missing"] == 2, report.stdout
        archive = Path(latest["archive"])
        if truth is None and latest["targets_written"]:
            truth = read_lamps(min((archive / "cam0").glob("target_??????.exr")))
        # An old buffer behind a frame of another size is a picture that was never handed on: no bits tell it, the lamps' light does.
        misplaced = truth is not None and misplaced_lamps(archive, truth)
        assert not misplaced or json.loads(out)["suspect_targets"], (take, misplaced)
        shutil.rmtree(archive)
    assert seen > 0, "faults were noticed"
    warm = figures[min(4, takes // 2) :]
    resident, descriptors, threads = zip(*warm)
    assert len(set(descriptors)) == 1 and len(set(threads)) == 1, figures
    assert max(resident) < min(resident) * 1.1 + (8 << 20), figures
    assert ring_files() == shared_files
    numbers = [event["number"] for event in daemon.events()]
    assert numbers == sorted(set(numbers))
