# SPDX-License-Identifier: MIT
"""One guest for all tests, started with the first; what it needs and is not there ends the run by name."""
import pathlib
import sys

import pytest

HERE = pathlib.Path(__file__).resolve().parent
ROOT = HERE.parents[1]
sys.path[:0] = [str(HERE), str(ROOT / "tests/hil")]

import kernel  # noqa: E402
from camera_program import CameraProgram  # noqa: E402
from can_join import CanJoin  # noqa: E402
from gpio_chip import Chip  # noqa: E402
from guest import Guest  # noqa: E402
from ols_board import board as emulated_board  # noqa: E402
from pacer import Pacer  # noqa: E402
from usb_port import SUPER_SPEED, BoardCable, UsbPort  # noqa: E402

STAGECTL = ROOT / "build/host/bin/stagectl"
UF2 = ROOT / "build/firmware/stage.uf2"
DESCRIBE_CAMERA = ROOT / "build/host/bin/describe_camera"
INSIDE = HERE / "inside"


def pytest_configure():
    for path, how in ((STAGECTL, "run `make host`"), (DESCRIBE_CAMERA, "run `make host`"),
                      (emulated_board.IMAGE, "run `make firmware`"), (UF2, "run `make firmware`"),
                      (emulated_board.EMULATOR.parent / "node_modules", "run `make setup`")):
        if not path.exists():
            raise pytest.UsageError(f"{path} is missing: {how}")


@pytest.fixture(scope="session")
def guest():
    try:
        running = Guest()
    except kernel.Missing as problem:
        pytest.exit(f"guest-test cannot run: {problem}", returncode=1)
    with running:
        yield running


class Boards:
    """Starts emulated boards on the host, in step with the guest."""

    def __init__(self, guest):
        self.guest, self.pacers = guest, {}

    def __call__(self, *arguments, **options):
        board = emulated_board.EmulatedBoard("--pace", "wall", *arguments, can=True, **options)
        self.pacers[board] = Pacer(self.guest, board)
        board.plug_usb().usb.close()  # it is up
        return board

    def end(self, board):
        self.pacers.pop(board).close()
        board.__exit__()


@pytest.fixture
def emulated(guest):
    boards = Boards(guest)
    yield boards
    for board in list(boards.pacers):
        boards.end(board)


class Bus:
    """A CAN interface of the guest, joined to a board's. `ends`: its name, or the names of a cable's two ends."""

    def __init__(self, guest, ends):
        self.guest, self.name, self.join = guest, ends[0], CanJoin()
        guest.load("can-raw")
        kind = ["type", "vcan"] if len(ends) == 1 else ["type", "vxcan", "peer", "name", ends[1]]
        guest.load(kind[1])
        for command in (["add", "dev", self.name, *kind], *(["set", end, "up"] for end in ends)):
            done = guest.run(["ip", "link", *command])
            assert done.returncode == 0, done.stderr
        guest.channel(self.name, self.join)
        self.node = guest.start([sys.executable, INSIDE / "can_node.py", ends[-1], self.name])
        self.node.wait_for("joined")

    def begin(self, board):
        self.guest.run(["ip", "link", "set", self.name, "up"])
        self.witness = self.guest.start(["candump", "-L", "-r", str(16 << 20), self.name])
        while "7FF#" not in self.witness.output:  # until it listens
            self.mark("7FF")
        if board:
            self.join.attach(board.path / "can.sock")

    def end(self):
        self.join.detach()
        self.witness.end()

    def mark(self, can_id):
        self.guest.run(["cansend", self.name, f"{can_id}#"])

    def candump(self):
        """What an independent program saw on the bus: (id, data) of each frame."""
        self.mark("7FE")
        self.witness.wait_for("7FE#")
        frames = [line.split()[2].split("#") for line in self.witness.output.splitlines()]
        return [(int(can_id, 16), bytes.fromhex(data)) for can_id, data in frames if can_id not in ("7FF", "7FE")]


@pytest.fixture(scope="session")
def buses(guest):
    return {}


@pytest.fixture
def bus(guest, buses):
    """The bus vcan0 of a board, or of none; or one whose far end is another machine's."""
    used = []

    def begin(board=None, ends=("vcan0",)):
        if ends not in buses:
            buses[ends] = Bus(guest, ends)
        used.append(buses[ends])
        used[-1].begin(board)
        return used[-1]

    yield begin
    for one in used:
        one.end()


@pytest.fixture(scope="session")
def udev(guest):
    """At work as on a desktop, and no rules of ours."""
    guest.run(["/lib/systemd/systemd-udevd", "--daemon"])


@pytest.fixture
def udev_rules(guest, udev):
    """The project's udev rules, to install during a test: before it and behind it the guest has none."""

    class Rules:
        path = "/etc/udev/rules.d/60-open-light-stage.rules"

        def install(self):
            self._change("cp", ROOT / "host/device/60-open-light-stage.rules", self.path)

        def remove(self):
            self._change("rm", "-f", self.path)

        def _change(self, *command):
            guest.run(list(command))
            guest.run(["udevadm", "control", "--reload"])

    rules = Rules()
    rules.remove()
    yield rules
    rules.remove()


@pytest.fixture(scope="session")
def port(guest, udev):
    """The guest's USB port."""
    return UsbPort(guest, INSIDE)


@pytest.fixture(scope="session")
def fast_ports(guest, udev):
    """Two ports of SuperSpeed."""
    return [UsbPort(guest, INSIDE, number, SUPER_SPEED) for number in range(2)]


@pytest.fixture
def usb(guest, port):
    """Plugs boards in, and pulls the cable at the end."""

    def plug(board):
        port.plug(BoardCable(board))
        settle(guest)
        return port

    yield plug
    port.unplug()


def settle(guest, name="light stage sequencer"):
    """Until udev has done what it has to for a device that came, of that product or serial number."""
    for _ in range(1000):
        found = guest.run(["sh", "-c", "udevadm settle; cd /sys/bus/usb/devices; cat */product */serial"]).stdout
        if name in found.splitlines():
            return
    raise TimeoutError(f"no {name} enumerates: " + guest.run(["dmesg"]).stdout[-2000:])


@pytest.fixture
def chip(guest):
    made = Chip(guest)
    yield made
    made.remove()


@pytest.fixture
def stagectl(guest):
    """Runs it in the guest."""

    def run(*arguments, **options):
        return guest.run([STAGECTL, *arguments], **options)

    return run


@pytest.fixture
def camera(guest):
    """Starts cameras, as CameraProgram does, and ends them before their devices go."""
    started = []

    def start(*arguments, **options):
        started.append(CameraProgram(guest, *arguments, **options))
        return started[-1]

    yield start
    for one in started:
        one.process.end()
