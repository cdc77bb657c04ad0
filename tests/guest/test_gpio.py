# SPDX-License-Identifier: MIT
"""The stage's lines on the kernel's GPIO (gpio-sim): edges seen are those made, with gpiomon as a witness on a line beside; emergency
stop, arm button and tally; and a chip that is unbound while a sequence plays. The board is tests/unit/fake_board.py, in the guest."""
import re
import signal
import sys

import pytest
from conftest import ROOT, STAGECTL
from gpio_chip import NAMES

BOARD = """import sys, time
sys.path.insert(0, sys.argv[1])
from fake_board import FakeBoard
board = FakeBoard(sys.argv[2])
print("board is up", flush=True)
while not board.stops:
    time.sleep(0.01)
print("told to stop", flush=True)
time.sleep(1000)
"""
STAGE = """[gpio]
chip = "stage-lines"
[gpio.arm]
line = "ARM"
debounce_ms = 0
[gpio.emergency_stop]
line = "1"
[gpio.genlock]
line = "GENLOCK"
active_low = true
[gpio.tally]
line = "TALLY"
"""


class Play:
    """stagectl play in the guest, of a board that plays for hours."""

    def __init__(self, guest, *arguments, stage=STAGE):
        guest.run(["rm", "-rf", "/tmp/gpio"])
        guest.run(["mkdir", "-p", "/tmp/gpio"])
        guest.run([sys.executable, "-c", "import sys; open('/tmp/gpio/stage.toml', 'w').write(sys.argv[1])", stage])
        self.board = guest.start([sys.executable, "-c", BOARD, str(ROOT / "tests/unit"), "/tmp/gpio/board.sock"])
        self.board.wait_for("board is up")
        self.process = guest.start([str(STAGECTL), "play", str(ROOT / "examples/sequence_single.toml"), "--cycles", "500000", "--json",
                                    "--stage", "/tmp/gpio/stage.toml", "--board", "socket:/tmp/gpio/board.sock", *arguments])

    def plays(self):
        self.process.wait_for('"counter"')
        return self

    def end(self, interrupt=False):
        """Exit code and standard error. What has played was told to stop."""
        if interrupt:
            self.process.signal(signal.SIGINT)
        code = self.process.wait()
        if self.process.output:
            self.board.wait_for("told to stop")
        return code, self.process.errors

    def close(self):
        self.process.end()
        self.board.end()


@pytest.fixture
def play(guest, chip):
    started = []

    def start(*arguments, **options):
        started.append(Play(guest, *arguments, **options))
        return started[-1]

    yield start
    for one in started:
        one.close()


def counted(errors, name):
    """(seen, known to be lost) of a line, as stagectl tells at the end."""
    found = re.search(rf"line '{name}' \(\w+\): (\d+) edges seen, (\d+) known to be lost", errors)
    return tuple(map(int, found.groups())) if found else (0, 0)


def test_edges_seen_are_those_made_and_gpiomon_saw_as_many_on_the_line_beside(guest, chip, play):
    witness = guest.start(["gpiomon", "--num-events=60", chip.name, str(NAMES.index("WITNESS"))])
    playing = play("--arm")
    playing.process.wait_for("waiting for the arm button")
    chip.train(["ARM", "WITNESS"], 60, 0.02)
    playing.plays()
    assert witness.wait() == 0
    code, errors = playing.end(interrupt=True)
    assert code == 0, errors
    assert len(witness.output.splitlines()) == 60
    assert counted(errors, "ARM") == (60, 0)


def test_what_the_kernel_dropped_is_counted_where_it_can_be_known(chip, play):
    playing = play().plays()
    playing.process.signal(signal.SIGSTOP)
    chip.train(["ARM"], 41, 0.01)  # the kernel keeps 16, the last of which is a fall; the level is high in the end
    playing.process.signal(signal.SIGCONT)
    chip.shell("sleep 2")  # a level counts when two looks at a quiet line have found it
    code, errors = playing.end(interrupt=True)
    seen, lost = counted(errors, "ARM")
    assert (seen, lost) == (16, 1), errors


def test_the_tally_is_lit_while_it_plays_and_dark_before_and_after(chip, play):
    playing = play("--arm")
    playing.process.wait_for("waiting for the arm button")
    assert not chip.value("TALLY")
    chip.pull("ARM", True)
    playing.plays()
    assert chip.value("TALLY")
    code, errors = playing.end(interrupt=True)
    assert code == 0 and not chip.value("TALLY"), errors


def test_a_pulse_of_the_emergency_stop_ends_play_by_name_and_the_tally_is_dark(chip, play):
    playing = play().plays()
    chip.train(["ESTOP"], 2, 0)
    code, errors = playing.end()
    assert code == 1 and re.search(r"emergency stop: line '1' of the GPIO chip 'gpiochip\d+' is active", errors), errors
    assert not chip.value("TALLY")


def test_genlock_that_is_lost_ends_play_and_refuses_the_next_start(chip, play):
    playing = play().plays()
    chip.pull("GENLOCK", True)  # active low
    code, errors = playing.end()
    assert code == 1 and "genlock is absent: line 'GENLOCK'" in errors, errors
    again = play()
    code, errors = again.end()
    assert code == 1 and "genlock is absent" in errors and again.process.output == ""


@pytest.mark.parametrize("when", ["waiting for the arm button", "playing"])
def test_a_chip_that_is_unbound_ends_it_by_name(chip, play, when):
    playing = play("--arm") if when != "playing" else play().plays()
    if when != "playing":
        playing.process.wait_for(when)
    chip.unbind()
    code, errors = playing.end()
    assert code == 1 and re.search(r"the GPIO chip 'gpiochip\d+' has gone", errors), errors


@pytest.mark.parametrize("change, words", [
    (('"stage-lines"', '"no-such-chip"'), r"no GPIO chip 'no-such-chip'.*there are gpiochip\d+ 'stage-lines'"),
    (('"GENLOCK"', '"GENLOK"'), r"has no line 'GENLOK': it has the offsets 0 to 7, and the names 'ARM', 'ESTOP', 'GENLOCK'"),
    (('"TALLY"', '"99"'), r"has no line '99'")])
def test_what_is_not_there_is_answered_with_what_is(chip, play, change, words):
    code, errors = play(stage=STAGE.replace(*change)).end()
    assert code == 1 and re.search(words, errors), errors


def test_a_line_that_another_program_has_is_named_with_that_program(guest, chip, play):
    holder = guest.start(["gpioset", "--mode=signal", chip.name, f"{NAMES.index('TALLY')}=0"])
    while "gpioset" not in chip.shell(f"gpioinfo {chip.name}"):
        pass
    code, errors = play().end()
    holder.end()
    assert code == 1 and re.search(r"line 'TALLY' of the GPIO chip .* is used by 'gpioset'", errors), errors
