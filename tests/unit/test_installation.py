# SPDX-License-Identifier: MIT
# `make install`: where files go, that nothing of the user's is overwritten, and what systemd and udev say of theirs.
import os
import pathlib
import re
import shutil
import subprocess

import pytest

ROOT = pathlib.Path(__file__).resolve().parents[2]
BUILD = ROOT / "build/host"
# systemd's own scale: below 1 "safe", below 5 "OK", from 5 on "medium".
EXPOSURE_MOST = 2.0
# With the packet socket, which needs a capability and one more family of addresses.
EXPOSURE_WITH_PACKET_SOCKET_MOST = 2.3


def install(prefix, destination=None):
    environment = {name: value for name, value in os.environ.items() if name != "DESTDIR"}
    environment |= {"DESTDIR": str(destination)} if destination else {}
    command = ["cmake", "--install", BUILD, "--prefix", prefix]
    done = subprocess.run(list(map(str, command)), env=environment, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return done.stdout


def needs(program):
    return pytest.mark.skipif(not shutil.which(program), reason=f"no {program} here")


@pytest.fixture(scope="module")
def image(tmp_path_factory):
    """What a package of /usr/local would hold."""
    folder = tmp_path_factory.mktemp("image")
    install("/usr/local", folder)
    return folder


@pytest.fixture(scope="module")
def prefix(tmp_path_factory):
    """Installed where it stands, so that the unit's programs are there."""
    folder = tmp_path_factory.mktemp("prefix")
    install(folder)
    return folder


def test_everything_is_where_linux_looks_for_it(image):
    files = {str(path.relative_to(image)) for path in image.rglob("*") if path.is_file()}
    local, doc = "usr/local", "usr/local/share/doc/open-light-stage"
    assert files == {
        *(f"{local}/bin/{program}" for program in ("stagectl", "stagectl-ingest", "rf", "stagesim")),
        f"{local}/lib/udev/rules.d/60-open-light-stage.rules",
        f"{local}/lib/systemd/system/stagectl.service",
        f"{local}/lib/sysusers.d/stagectl.conf",
        *(f"{doc}/stagectl.service.d/{name}.conf" for name in ("camera-network", "packet-socket", "takes-folder")),
        f"{doc}/checking_the_machine.md",
        f"{doc}/operating.md",
        f"{doc}/stage.toml",
        "etc/stagectl/stage.toml",
    }
    unit = (image / local / "lib/systemd/system/stagectl.service").read_text()
    assert "ExecStart=/usr/local/bin/stagectl serve --config /etc/stagectl/stage.toml\n" in unit
    assert "@" not in re.sub(r"@(system-service|privileged|resources)", "", unit)


def test_another_prefix_has_its_configuration_below_it(prefix):
    unit = (prefix / "lib/systemd/system/stagectl.service").read_text()
    assert f"ExecStart={prefix}/bin/stagectl serve --config {prefix}/etc/stagectl/stage.toml\n" in unit
    done = subprocess.run([prefix / "bin/stagectl", "--version"], capture_output=True, text=True)
    assert done.returncode == 0 and done.stdout.startswith("stagectl ")


def test_a_configuration_of_the_users_own_stays(tmp_path):
    install("/usr/local", tmp_path)
    own = tmp_path / "etc/stagectl/stage.toml"
    assert own.read_bytes() == (ROOT / "examples/stage.toml").read_bytes()
    own.write_text("# mine\n")
    install("/usr/local", tmp_path)
    assert own.read_text() == "# mine\n"
    assert (tmp_path / "usr/local/share/doc/open-light-stage/stage.toml").read_bytes() == (ROOT / "examples/stage.toml").read_bytes()


def test_the_sample_is_a_stage(prefix):
    done = subprocess.run(
        [prefix / "bin/stagectl", "doctor", "--quick", "--json", "--stage", prefix / "etc/stagectl/stage.toml"], capture_output=True, text=True
    )
    assert done.returncode in (0, 1, 2) and not done.stderr, done.stderr


def exposure(unit, most):
    command = ["systemd-analyze", "security", "--offline=true", "--no-pager", f"--threshold={round(most * 10)}", unit]
    done = subprocess.run(list(map(str, command)), capture_output=True, text=True)
    assert done.returncode == 0, done.stdout[-300:] + done.stderr
    return float(re.search(r"Overall exposure level for \S+: ([\d.]+)", done.stdout)[1])


@needs("systemd-analyze")
def test_systemd_finds_nothing_wrong_with_the_unit(prefix):
    unit = prefix / "lib/systemd/system/stagectl.service"
    done = subprocess.run(["systemd-analyze", "verify", "--man=no", unit], capture_output=True, text=True)
    assert (done.returncode, done.stdout + done.stderr) == (0, "")
    assert 0 < exposure(unit, EXPOSURE_MOST) <= EXPOSURE_MOST


@needs("systemd-analyze")
def test_systemd_notices_a_mistake_in_the_unit(prefix, tmp_path):
    broken = tmp_path / "stagectl.service"
    text = (prefix / "lib/systemd/system/stagectl.service").read_text()
    broken.write_text(text.replace("DevicePolicy=closed", "DevicePolicy=shut"))
    done = subprocess.run(["systemd-analyze", "verify", "--man=no", broken], capture_output=True, text=True)
    assert "Failed to parse device policy" in done.stderr
    broken.write_text(text.replace("ProtectSystem=strict", "ProtectSystem=no").replace("NoNewPrivileges=yes", "NoNewPrivileges=no"))
    with pytest.raises(AssertionError):
        exposure(broken, EXPOSURE_MOST)


@needs("systemd-analyze")
def test_the_drop_ins_fit_the_unit(prefix, tmp_path):
    unit = tmp_path / "stagectl.service"
    shutil.copy(prefix / "lib/systemd/system/stagectl.service", unit)
    shutil.copytree(prefix / "share/doc/open-light-stage/stagectl.service.d", tmp_path / "stagectl.service.d")
    done = subprocess.run(["systemd-analyze", "verify", "--man=no", unit], capture_output=True, text=True)
    assert (done.returncode, done.stdout + done.stderr) == (0, "")
    bare = exposure(prefix / "lib/systemd/system/stagectl.service", EXPOSURE_MOST)
    assert bare < exposure(unit, EXPOSURE_WITH_PACKET_SOCKET_MOST) <= EXPOSURE_WITH_PACKET_SOCKET_MOST


@needs("systemd-sysusers")
def test_the_user_of_the_unit_is_made_with_its_groups(image, tmp_path):
    shutil.copytree(image, tmp_path, dirs_exist_ok=True)
    subprocess.run(["systemd-sysusers", f"--root={tmp_path}"], check=True, capture_output=True)
    users = dict(line.split(":", 1) for line in (tmp_path / "etc/passwd").read_text().splitlines())
    groups = {line.split(":")[0]: line.split(":")[3].split(",") for line in (tmp_path / "etc/group").read_text().splitlines()}
    unit = (image / "usr/local/lib/systemd/system/stagectl.service").read_text()
    assert re.search(r"^User=(.*)$", unit, re.MULTILINE)[1] in users
    assert users["stagectl"].endswith(":/usr/sbin/nologin")
    for group in re.search(r"^SupplementaryGroups=(.*)$", unit, re.MULTILINE)[1].split() + ["gpio"]:
        assert groups[group] == ["stagectl"]
    assert "stagectl" in groups


@needs("udevadm")
def test_udev_finds_nothing_wrong_with_the_rules(image):
    if subprocess.run(["udevadm", "verify", "--help"], capture_output=True).returncode != 0:
        pytest.skip("udevadm before 254 has no verify")
    rules = image / "usr/local/lib/udev/rules.d/60-open-light-stage.rules"
    done = subprocess.run(["udevadm", "verify", rules], capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
