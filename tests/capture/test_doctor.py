# SPDX-License-Identifier: MIT
# stagectl doctor on the virtual stage, against this machine's own tools; and a take under the service's confinement.
import json
import re
import shutil
import subprocess
import sys

import pytest

import confined
from virtual_take import BIN, ROOT, VirtualStage, sequence, verify

sys.path.append(str(ROOT / "tests/gige"))
from gige_camera import GigeCamera  # noqa: E402

PAGE = ROOT / "docs/checking_the_machine.md"


def doctor(*arguments, command=None):
    """Exit code and findings by id, each a list."""
    done = subprocess.run(command or [BIN / "stagectl", "doctor", "--json", *map(str, arguments)], capture_output=True, text=True)
    report = json.loads(done.stdout)
    found = {}
    for check in report["checks"]:
        found.setdefault(check["id"], []).append(check)
    return done.returncode, found, report


def statuses(findings):
    return [finding["status"] for finding in findings]


@pytest.fixture(scope="module")
def stage(tmp_path_factory):
    with VirtualStage(tmp_path_factory.mktemp("stage"), "card.toml") as running:
        yield running


def test_a_stage_that_runs_is_found_and_a_page_explains_each_check(stage, tmp_path):
    command = stage.command("doctor", "--json", "--takes", tmp_path, "--spill", tmp_path, "--sequence", sequence("s159"))
    code, found, report = doctor(command=command)
    for check in ("board.link", "board.firmware", "board.fault", "camera.link", "camera.setup", "disk.space"):
        assert set(statuses(found[check])) == {"ok"}, found[check]
    assert "64 x 48, 12 bits" in found["camera.setup"][0]["found"]
    assert not list(tmp_path.iterdir())
    states = [check["status"] for checks in found.values() for check in checks]
    assert code == (1 if "fail" in states else 2 if "warn" in states else 0)
    assert report["counts"] == {name: states.count(name) for name in ("ok", "warn", "fail", "skipped")}
    for checks in found.values():
        for check in checks:
            needs_help = check["status"] in ("warn", "fail")
            assert bool(check["commands"]) >= needs_help and bool(check["needed"]) >= needs_help, check
            assert check["found"], check


def test_every_check_is_made_listed_and_on_the_page():
    listing = json.loads(subprocess.check_output([BIN / "stagectl", "doctor", "--list", "--json"]))
    listed = [check["id"] for check in listing["checks"]]
    _, found, _ = doctor()
    assert set(listed) == set(found) and len(listed) == len(set(listed))
    on_the_page = re.findall(r"^\| `([a-z_]+\.[a-z_]+)` \|", PAGE.read_text(), re.MULTILINE)
    assert on_the_page == listed


def test_the_kernels_settings_are_those_that_sysctl_reads(tmp_path):
    stage_file = tmp_path / "stage.toml"
    stage_file.write_text('[[camera]]\nsource = "aravis:127.0.0.1"\nwidth = 640\nheight = 480\n')
    _, found, _ = doctor("--stage", stage_file, "--quick")
    for name in ("rmem_max", "rmem_default"):
        value = int(subprocess.check_output(["/usr/sbin/sysctl", "-n", f"net.core.{name}"]))
        [finding] = found[f"network.{name}"]
        assert finding["found"] == f"{value} bytes"
        # 640 x 480 x 12 bits, two bytes a sample, at 2160 frames/s: 132.7 MB in 0.1 s, more than Aravis asks for.
        assert finding["status"] == ("ok" if value >= 32 << 20 else "fail")
    [mtu] = found["network.mtu"]
    assert mtu["found"].startswith((lambda text: text.strip() + " bytes on lo")(open("/sys/class/net/lo/mtu").read()))


def test_the_disks_room_is_that_of_df(tmp_path):
    _, found, _ = doctor("--takes", tmp_path, "--quick")
    of_takes = next(check for check in found["disk.space"] if check["subject"] == str(tmp_path))
    free = int(subprocess.check_output(["df", "--block-size=1", "--output=avail", tmp_path]).split()[1])
    value, unit = re.match(r"([\d.]+) (\w+) free", of_takes["found"]).groups()
    assert abs(float(value) * {"MB": 1e6, "GB": 1e9, "TB": 1e12}[unit] - free) < 0.01 * free


def test_what_is_printed_can_be_read_and_copied(tmp_path):
    stage_file = tmp_path / "stage.toml"
    stage_file.write_text('[board]\nlink = "usb:NOSUCH"\n[[camera]]\nsource = "v4l2:/dev/no_such_video"\n')
    done = subprocess.run([BIN / "stagectl", "doctor", "--stage", stage_file, "--quick"], capture_output=True, text=True)
    assert done.returncode == 1
    assert "\033" not in done.stdout
    row = r"fail +permissions\.nodes \(/dev/no_such_video\) +there is no such node\n +needed: .*\n +type: +v4l2-ctl --list-devices"
    assert re.search(row, done.stdout), done.stdout
    assert re.search(r"^\d+ ok, \d+ warnings?, \d+ failures?, \d+ not checked$", done.stdout, re.MULTILINE)


def test_wrong_arguments_are_named(tmp_path):
    done = subprocess.run([BIN / "stagectl", "doctor", "--camera", "fake:1", "--camera", "fake:2"], capture_output=True, text=True)
    assert done.returncode == 1 and "--camera is given 2 times" in done.stderr
    done = subprocess.run([BIN / "stagectl", "doctor", "--stage", tmp_path / "none.toml"], capture_output=True, text=True)
    assert done.returncode == 1 and "none.toml" in done.stderr


@pytest.mark.skipif(confined.why_not() != "", reason=confined.why_not() or "-")
@pytest.mark.parametrize("options", ([], ["--fps", "24", "--quality", "standard"]), ids=("still", "performance"))
def test_a_take_needs_no_more_than_the_service_may_do(tmp_path, options):
    with VirtualStage(tmp_path / "stage", "card.toml") as stage:
        archive = tmp_path / "take.rfa"
        done = confined.run(stage.command("run", "--sequence", sequence("s159"), "--nominal", *options, "-o", archive))
    assert done.returncode == 0, (done.returncode, done.stderr)
    assert verify(archive).returncode == 0


@pytest.mark.skipif(confined.why_not() != "", reason=confined.why_not() or "-")
def test_a_take_over_gige_needs_no_more_than_the_service_may_do(tmp_path):
    archive = tmp_path / "take.rfa"
    with VirtualStage(tmp_path / "stage", "card.toml") as stage, GigeCamera(stage.folder / "cam0.ring") as gige:
        _, found, _ = doctor(command=stage.command("doctor", "--json", "--quick", camera=f"aravis:{gige.address}"))
        assert statuses(found["camera.setup"]) == ["ok"]
        assert found["network.mtu"][0]["found"].endswith(" bytes on lo")
        options = ["--sequence", sequence("s159"), "--nominal", "--patience", 200, "-o", archive]
        done = confined.run(stage.command("run", *options, camera=f"aravis:{gige.address}"))
    assert done.returncode == 0, (done.returncode, done.stderr)
    assert verify(archive).returncode == 0


@pytest.mark.skipif(confined.why_not() != "", reason=confined.why_not() or "-")
def test_the_confinement_confines():
    write_and_execute = "import mmap; mmap.mmap(-1, 4096, prot=mmap.PROT_READ | mmap.PROT_WRITE | mmap.PROT_EXEC)"
    assert "PermissionError" in confined.run(["python3", "-c", write_and_execute]).stderr
    mount = "import ctypes; ctypes.CDLL(None).umount2(b'/no/such', 0)"
    assert confined.run(["python3", "-c", mount]).returncode == -31  # SIGSYS
    assert shutil.which("systemd-analyze") and confined.run(["true"]).returncode == 0
