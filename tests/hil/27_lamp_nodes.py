# SPDX-License-Identifier: MIT
# Telemetry of the lamp nodes on the emulated bus: what they tell follows what was lit, and trouble stops what plays, by name.
import json
import re
import struct
import subprocess
import threading

import pytest

from ols_board.board import BOARD, ROOT

STAGECTL = ROOT / "build/host/bin/stagectl"
FIRST_NODE = 0x200
SECOND = 125_000_000
NODES = 11

pytestmark = pytest.mark.skipif(BOARD != "emulated", reason="needs the emulated lamp nodes")


def sequence(folder, cycles):
    """Node 0's lamps 0 to 15 for 20 % of the time, node 3's lamp 48 for as long."""
    path = folder / "lamps.toml"
    lamps = [*range(16), 48]
    path.write_text(f'cycles = {cycles}\n[[slot]]\nkind = "basis"\nlamps = {lamps}\nexposure_us = 2000\nperiod_us = 10000\n')
    return path


def stage(folder, board, more=""):
    path = folder / "stage.toml"
    path.write_text(f'[telemetry]\nbus = "can-socket:{board.path}/can.sock"\n{more}')
    return path


def play(folder, board, cycles, more=""):
    board.plug_usb().usb.close()  # it is up
    command = [STAGECTL, "play", sequence(folder, cycles), "--stage", stage(folder, board, more),
               "--board", f"socket:{board.path}/board.sock", "--json"]
    return subprocess.run(list(map(str, command)), capture_output=True, text=True, timeout=500)


def test_nodes_speak_every_second_of_board_time_and_tell_what_was_lit(emulated, tmp_path):
    board = emulated("--lamp-nodes", can=True)
    listener = board.bus()
    has_played = threading.Event()
    reader = threading.Thread(target=lambda: [listener.receive() for _ in iter(has_played.is_set, True)])
    reader.start()
    done = play(tmp_path, board, 450)
    has_played.set()
    reader.join()
    assert done.returncode == 0, done.stderr
    told = {node: [(tick, *struct.unpack("<hHHBB", data)) for tick, frame_id, data in listener.heard
                   if frame_id == FIRST_NODE + node] for node in range(NODES)}
    for node, frames in told.items():
        assert len(frames) >= 4
        assert [count for *_, count in frames] == [(frames[0][-1] + n) & 255 for n in range(len(frames))]
        steps = [b[0] - a[0] for a, b in zip(frames, frames[1:])]
        assert all(abs(step - SECOND) < SECOND // 10 for step in steps), steps
    lit = {node: max(current for _, _, current, *_ in frames) for node, frames in told.items()}
    # A lamp draws 700 mA (firmware/boards): 16 and 1 of them for a fifth of the time, in a second that was played whole.
    assert abs(lit[0] - 16 * 700 / 5) < 30 and abs(lit[3] - 700 / 5) < 3
    assert [lit[node] for node in range(NODES) if node not in (0, 3)] == [0] * (NODES - 2)
    assert max(temperature for _, temperature, *_ in told[0]) > 2500 == max(temperature for _, temperature, *_ in told[1])


@pytest.mark.parametrize("fault, words", [
    ("lampfault:3:1", r"lamp node 3 reports over-temperature: .*\(95\.0 C, \d+ mA\); it drives the lamps 48-63"),
    ("lampopen:0:5", r"lamp node 0 reports an open output, lamps 5: .*it drives the lamps 0-15"),
    ("lampfault:9:4", r"lamp node 9 reports a shorted lamp: .*it drives the lamps 144-159"),
    ("lampfault:1:8", r"lamp node 1 reports under-voltage: .*lamps 16-31"),
    ("lampsilent:2", r"lamp node 2 is silent: nothing came for \d\.\d s, .*it drives the lamps 32-47")])
def test_trouble_of_a_node_stops_what_plays_by_name(emulated, tmp_path, fault, words):
    board = emulated("--lamp-nodes", "--inject", f"{fault}@trigger:100", can=True)
    done = play(tmp_path, board, 5000, "silent_s = 2\n")
    assert done.returncode == 1 and re.search(words, done.stderr), done.stderr
    triggers = [json.loads(line)["counter"] for line in done.stdout.splitlines()]
    assert triggers == list(range(len(triggers))) and 100 <= len(triggers) < 5000
    # The board was told, and is dark: it is idle but for its program.
    status = subprocess.run([STAGECTL, "status", "--json", "--board", f"socket:{board.path}/board.sock"],
                            capture_output=True, text=True, timeout=100)
    assert json.loads(status.stdout)["state"] in ("loaded", "idle"), status.stdout + status.stderr


def test_a_node_that_is_not_there_refuses_the_start_by_name(emulated, tmp_path):
    board = emulated("--lamp-nodes", "--inject", "lampsilent:7@1", can=True)
    done = play(tmp_path, board, 10, "silent_s = 2\n")
    assert done.returncode == 1 and "lamp node 7 is silent" in done.stderr, done.stderr
    assert done.stdout == ""


def test_a_bus_without_nodes_and_no_bus_at_all_are_told_apart(emulated, tmp_path):
    board = emulated(can=True)
    done = play(tmp_path, board, 10, "silent_s = 2\n")
    assert done.returncode == 1 and "is silent" in done.stderr, done.stderr
    board = emulated(can=False)
    done = play(tmp_path, board, 10)
    assert done.returncode == 1 and "the lamp nodes' bus" in done.stderr, done.stderr
