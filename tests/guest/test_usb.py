# SPDX-License-Identifier: MIT
"""stagectl by libusb and the kernel's USB, against the emulated board plugged into a virtual port of the guest."""
import grp
import json
import signal

import pytest
from conftest import ROOT, STAGECTL


SEQUENCE = ROOT / "examples/sequence_s159.toml"
WAITING_SEQUENCE = ROOT / "examples/sequence_photo.toml"  # each cycle waits for an edge, which does not come
SERIAL = "00f1e2d3c4b5a697"
NOBODY = 65534


def test_a_board_on_usb_is_found_and_the_kernel_lists_the_same(guest, emulated, usb, stagectl):
    usb(emulated("--board-id", SERIAL))
    for link in ("usb:", "usb:" + SERIAL):
        asked = stagectl("status", "--json", "--board", link)
        assert asked.returncode == 0, asked.stderr
        assert json.loads(asked.stdout)["board"] == SERIAL
    seen = guest.run(["sh", "-c", "cd /sys/bus/usb/devices; for d in *; do [ -e $d/idVendor ] && "
                                  "cat $d/idVendor $d/idProduct $d/serial | tr '\\n' ' '; echo; done"]).stdout
    assert f"1209 0001 {SERIAL}" in seen
    other = stagectl("status", "--board", "usb:ffff")
    assert other.returncode == 1 and SERIAL in other.stderr


def test_a_sequence_is_played_over_the_kernels_usb(emulated, usb, stagectl):
    usb(emulated())
    played = stagectl("play", SEQUENCE, "--cycles", "1", "--json", "--board", "usb:")
    assert played.returncode == 0, played.stderr
    triggers = [json.loads(line) for line in played.stdout.splitlines()]
    assert [one["counter"] for one in triggers] == list(range(180))
    period, = {later["tick"] - one["tick"] for one, later in zip(triggers, triggers[1:])}
    assert period == 57870  # 462.96 us at 125 MHz, even


def test_a_board_that_is_unplugged_while_idle_or_in_play_is_named_and_found_again(guest, emulated, usb, stagectl):
    board = emulated()
    port = usb(board)
    playing = guest.start([STAGECTL, "play", WAITING_SEQUENCE, "--board", "usb:"])
    while guest.run([STAGECTL, "status", "--board", "usb:"]).returncode == 0:
        pass  # until the first has it: only one program can
    port.unplug()
    assert playing.wait() == 1
    assert "unplugged" in playing.errors, playing.errors
    gone = stagectl("status", "--board", "usb:")
    assert gone.returncode == 1 and "no board is plugged in" in gone.stderr, gone.stderr
    usb(board)
    asked = stagectl("status", "--json", "--board", "usb:")
    assert asked.returncode == 0, asked.stderr
    assert "host_lost" in json.loads(asked.stdout)["fault"] or json.loads(asked.stdout)["state"] in ("idle", "loaded")


def test_a_second_program_is_refused_while_the_first_has_the_board(guest, emulated, usb, stagectl):
    usb(emulated())
    first = guest.start([STAGECTL, "play", WAITING_SEQUENCE, "--board", "usb:"])
    while (second := stagectl("status", "--board", "usb:")).returncode == 0:
        pass
    assert "is used by another program" in second.stderr
    first.signal(signal.SIGINT)
    assert first.wait() == 0, first.errors


def test_without_permission_the_udev_rule_is_named_and_with_it_the_group_may(emulated, usb, stagectl, udev_rules):
    plugdev = grp.getgrnam("plugdev").gr_gid
    board = emulated()
    port = usb(board)
    refused = stagectl("status", "--board", "usb:", user=NOBODY, groups=[plugdev])
    assert refused.returncode == 1 and "60-open-light-stage.rules" in refused.stderr, refused.stderr
    udev_rules.install()
    port.unplug()
    usb(board)
    allowed = stagectl("status", "--json", "--board", "usb:", user=NOBODY, groups=[plugdev])
    assert allowed.returncode == 0, allowed.stderr
    refused = stagectl("status", "--board", "usb:", user=NOBODY)
    assert refused.returncode == 1 and "no permission" in refused.stderr
