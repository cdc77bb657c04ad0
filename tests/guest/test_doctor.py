# SPDX-License-Identifier: MIT
"""stagectl doctor on the kernel's real CAN, GPIO and USB: what it says of lines, interfaces and nodes is what other programs see, and
nothing changes by it."""
import json
import sys

from gpio_chip import NAMES
from test_gpio import STAGE
from test_usb import NOBODY


def doctor(stagectl, *arguments, **options):
    """Findings by id, then by subject."""
    done = stagectl("doctor", "--quick", "--json", *arguments, **options)
    found = {}
    for check in json.loads(done.stdout)["checks"]:
        found.setdefault(check["id"], {})[check["subject"]] = check
    return found


def only(found, check):
    (finding,) = found[check].values()
    return finding


def write(guest, path, text):
    guest.run([sys.executable, "-c", "import sys; open(sys.argv[1], 'w').write(sys.argv[2])", path, text])


def test_lines_of_a_chip_are_looked_at_and_not_taken(guest, chip, stagectl):
    write(guest, "/tmp/stage.toml", STAGE)
    found = doctor(stagectl, "--stage", "/tmp/stage.toml")["gpio.lines"]
    assert {use: check["status"] for use, check in found.items()} == dict.fromkeys(("arm", "emergency stop", "genlock", "tally"), "ok")
    assert found["genlock"]["found"] == f"offset {NAMES.index('GENLOCK')} of {chip.name}"
    holder = guest.start(["gpioset", "--mode=signal", chip.name, f"{NAMES.index('TALLY')}=1"])
    while not chip.value("TALLY"):
        pass
    found = doctor(stagectl, "--stage", "/tmp/stage.toml")["gpio.lines"]
    assert found["tally"]["status"] == "fail" and "used by 'gpioset'" in found["tally"]["found"]
    assert found["arm"]["status"] == "ok" and chip.value("TALLY")
    holder.end()


def test_a_line_that_the_chip_lacks_is_named_with_those_it_has(guest, chip, stagectl):
    write(guest, "/tmp/stage.toml", STAGE.replace('"ARM"', '"ALARM"'))
    arm = doctor(stagectl, "--stage", "/tmp/stage.toml")["gpio.lines"]["arm"]
    assert arm["status"] == "fail" and "'ESTOP'" in arm["found"]


def test_a_can_interface_is_what_ip_says_of_it(guest, bus, stagectl):
    lane = bus()
    guest.load("can-isotp")
    found = doctor(stagectl, "--board", f"can:{lane.name}")
    assert only(found, "can.interface")["status"] == "ok"
    assert "'vcan'" in only(found, "can.bit_rate")["found"] and only(found, "can.bit_rate")["status"] == "skipped"
    assert only(found, "can.isotp")["found"] == "loaded"
    (link,) = json.loads(guest.run(["ip", "-details", "-json", "link", "show", "dev", lane.name]).stdout)
    queue = only(found, "can.queue")
    assert queue["found"] == f"{link['txqlen']} frames" and queue["status"] == ("ok" if link["txqlen"] >= 155 else "warn")
    guest.run(["ip", "link", "set", lane.name, "down"])
    assert only(doctor(stagectl, "--board", f"can:{lane.name}"), "can.interface")["found"] == "it is down"
    guest.run(["ip", "link", "set", lane.name, "up"])


def test_a_board_on_usb_is_found_by_who_may_open_it(guest, emulated, usb, stagectl, udev_rules):
    port = usb(emulated())
    found = doctor(stagectl, "--board", "usb:", user=NOBODY)
    assert only(found, "permissions.udev_rules")["status"] == "fail"
    assert only(found, "permissions.nodes")["status"] == "fail"
    assert only(found, "board.link")["status"] == "fail" and "no permission" in only(found, "board.link")["found"]
    udev_rules.install()
    found = doctor(stagectl, "--board", "usb:")
    assert only(found, "permissions.udev_rules")["found"] == udev_rules.path
    for check in ("permissions.nodes", "board.link", "board.firmware", "board.fault"):
        assert only(found, check)["status"] == "ok", only(found, check)
    (node,) = found["permissions.nodes"]
    assert guest.run(["test", "-c", node]).returncode == 0
    port.unplug()
    assert only(doctor(stagectl, "--board", "usb:"), "permissions.nodes")["status"] == "skipped"
