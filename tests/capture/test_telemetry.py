# SPDX-License-Identifier: MIT
"""Lamp nodes' telemetry during a take: in report and manifest, and trouble of a node ends the take with what was proved kept."""
import json

from virtual_take import SMALL_STAGE, VirtualStage, sequence

CYCLE, CYCLES = 180, 60


def record(tmp_path, *options, code):
    """A take of 5 s with a virtual stage that has lamp nodes: report, and what the manifest holds besides."""
    folder = tmp_path / "work"
    telemetry = f'[telemetry]\nbus = "can-socket:{folder}/can.sock"\n'
    with VirtualStage(folder, "card.toml", "--can", *options, stage=telemetry + SMALL_STAGE) as stage:
        report = stage.stagectl("run", "--sequence", sequence("s159"), "--nominal", "--cycles", CYCLES, "-o", folder / "take.rfa",
                                "--json", code=code)
    return report, json.loads((folder / "take.rfa/manifest.json").read_text())["extra"]


def test_a_whole_take_has_every_nodes_extremes(tmp_path):
    report, manifest = record(tmp_path, code=0)
    assert report["board_end"] is None and "board_end" not in manifest["identification"]
    assert report["lamp_nodes"] == manifest["lamp_nodes"] and len(manifest["lamp_nodes"]) == 11
    for node in manifest["lamp_nodes"][:9]:
        assert node["frames"] >= 5 and node["frames_lost"] == node["faults"] == 0
        # 16 lamps of 700 mA, lit in half of the basis slots for less than the whole of each.
        assert 0 < node["current_ma"][1] < 16 * 700 / 2 and 25 <= node["temperature_c"][0] < node["temperature_c"][1] < 30
    assert manifest["lamp_nodes"][3]["lamps"] == "48-63"


def test_a_node_that_gets_hot_ends_the_take_and_what_was_proved_is_kept(tmp_path):
    report, manifest = record(tmp_path, "--board-inject", f"lampfault:3:1@trigger:{20 * CYCLE}", code=2)
    for told, end in ((report, report["board_end"]), (manifest, manifest["identification"]["board_end"])):
        assert end["cause"] == "stopped" and end["why"].startswith("lamp node 3 reports over-temperature"), end
        assert "95.0 C" in end["why"] and "the lamps 48-63" in end["why"]
        assert told["lamp_nodes"][3]["faults"] == 1 and told["lamp_nodes"][3]["temperature_c"][1] == 95
    assert 19 <= report["targets_written"] < CYCLES
    assert report["targets_written"] + report["targets_missing"] == CYCLES
