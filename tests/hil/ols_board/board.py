# SPDX-License-Identifier: MIT
# The board as the tests see it: an emulated one started as a process, and its messages over the USB cable.
import json
import os
import pathlib
import select
import socket
import subprocess
import tempfile
import time

from ols_board import wire
from ols_board.can import Can, EmulatedBus, SocketCanBus
from ols_board.usb import OK, Usb

ROOT = pathlib.Path(__file__).resolve().parents[3]
IMAGE = pathlib.Path(os.environ.get("IMAGE", ROOT / "build/firmware/stage.elf"))
EMULATOR = ROOT / "tools/stagesim/board/board.mjs"
BOARD = os.environ.get("BOARD", "emulated")
EXIT_VIOLATION = 3


class BoardError(Exception):
    def __init__(self, code, slot, text):
        super().__init__(f"{code}: {text}")
        self.code, self.slot, self.text = code, slot, text


class EmulatedBoard:
    """board.mjs as a child process, with its trace, its exposures and its log."""

    def __init__(self, *arguments, trace=False, exposures=False, image=IMAGE, can=BOARD.startswith("can:"),
                 may_violate=False):
        self.can = can
        self.may_violate = may_violate
        self.directory = tempfile.TemporaryDirectory(prefix="ols")
        self.path = pathlib.Path(self.directory.name)
        self.trace = self.path / "trace.vcd" if trace else None
        self.listener = self._listen() if exposures else None
        command = ["node", EMULATOR, "--image", image, "--usb", self.path / "board.sock", "--stats", *arguments]
        command += ["--vcd", self.trace] if trace else []
        command += ["--can", self.path / "can.sock"] if can else []
        command += ["--exposures", self.path / "stage.sock"] if exposures else []
        self.process = subprocess.Popen([str(part) for part in command], stderr=subprocess.PIPE, text=True)
        self.stage = self.listener.accept()[0].makefile() if exposures else None
        self.log = ""

    def _listen(self):
        listener = socket.socket(socket.AF_UNIX)
        listener.bind(str(self.path / "stage.sock"))
        listener.listen(1)
        return listener

    def plug(self):
        """Connects the cable that BOARD asks for."""
        return self.plug_can() if BOARD.startswith("can:") else self.plug_usb()

    def plug_usb(self):
        return self._connect(lambda: Link(Usb(self.path / "board.sock")))

    def plug_can(self):
        return Link(Can(self.bus()))

    def bus(self):
        """One more node on the board's CAN bus."""
        return self._connect(lambda: EmulatedBus(self.path / "can.sock"))

    def _connect(self, connect):
        """Waits for the board's sockets to be there."""
        for _ in range(500):
            try:
                return connect()
            except (FileNotFoundError, ConnectionRefusedError):
                assert self.process.poll() is None, self.process.stderr.read()
                time.sleep(0.02)
        raise TimeoutError("the board's socket did not come up")

    def exposures_until(self, kind, count):
        """Reads the exposure stream until `count` messages of `kind` have come; returns all messages but "now"."""
        found = []
        while count > 0:
            message = json.loads(self.stage.readline())
            count -= message["type"] == kind
            if message["type"] != "now":
                found.append(message)
        return found

    def stop(self):
        """Ends the process as stagesim does; returns its statistics."""
        self.process.terminate()
        if self.stage:
            while select.select([self.stage], [], [], 0)[0] and self.stage.readline():
                pass
        _, self.log = self.process.communicate(timeout=30)
        assert self.process.returncode in (0, EXIT_VIOLATION), self.log
        statistics = json.loads(self.log.strip().splitlines()[-1])
        if not self.may_violate:
            assert statistics["violations"] == [], statistics["violations"]
        return statistics

    def __enter__(self):
        return self

    def __exit__(self, *_):
        """Ends what still runs. Whatever a test looks at, it fails when the firmware did what a chip does not forgive."""
        try:
            if self.process.poll() is None:
                self.stop()
        finally:
            if self.process.poll() is None:
                self.process.kill()
                self.process.communicate()
            self.directory.cleanup()


class CanBoard:
    """A board at a CAN interface of this machine, BOARD=can:IFACE."""

    def __init__(self, interface):
        self.interface = interface

    def bus(self):
        """One more node on the board's CAN bus."""
        return SocketCanBus(self.interface)

    def plug_can(self):
        return Link(Can(self.bus()))

    plug = plug_can

    def __exit__(self, *_):
        pass


class Link:
    """Messages over one plugged-in cable."""

    def __init__(self, usb):
        self.usb = usb
        self.stream = bytearray()
        self.request_id = 0

    def ask(self, message_type, payload=b""):
        """Sends a request and returns the reply's payload. Raises BoardError for an error reply."""
        return self.ask_many(message_type, [payload])[0]

    def ask_many(self, message_type, payloads):
        """Sends several requests in one transfer, without waiting for the reply of each; returns their replies."""
        first_id = self.request_id + 1
        requests = [wire.frame(message_type, first_id + n & 0xFFFF, payload) for n, payload in enumerate(payloads)]
        self.request_id = first_id + len(payloads) - 1 & 0xFFFF
        status = self.usb.write(b"".join(requests))
        if status != OK:
            raise ConnectionError(f"transfer status {status}")
        return [self._reply(message_type, first_id + n & 0xFFFF) for n in range(len(payloads))]

    def _reply(self, message_type, request_id):
        while True:
            found = wire.take_frame(self.stream)
            if found is not None and found[1] == request_id:
                break
            status, data = self.usb.read()
            if status != OK:
                raise ConnectionError(f"transfer status {status}")
            self.stream += data
        reply_type, _, reply = found
        if reply_type == wire.ERROR | wire.REPLY:
            code, slot, text = wire.ERROR_REPLY.unpack(reply)
            raise BoardError(code, slot, text.rstrip(b"\0").decode())
        assert reply_type == message_type | wire.REPLY
        return reply

    def hello(self, layout_hash):
        names = ("layout_hash", "firmware_version", "board_id", "boot_nonce", "tick_hz", "capabilities", "chain_bits",
                 "slots_max", "shift_ticks", "slot_gap_ticks", "lamps_lit_max", "lamp_duty_max_permille",
                 "edge_start_ticks", "cycle_edge_ticks", "board")
        reply = self.ask(wire.HELLO, layout_hash.to_bytes(8, "little"))
        return dict(zip(names, wire.HELLO_REPLY.unpack(reply)))

    def status(self):
        names = ("state", "fault", "fault_slot", "boot_nonce", "fault_ticks", "now_ticks", "triggers_fired",
                 "cycles_played", "log_entries_lost", "program_crc32", "next", "edges_seen", "edges_missed")
        return dict(zip(names, wire.STATUS_REPLY.unpack(self.ask(wire.STATUS))))

    def load(self, program, chunk_bytes=1000):
        data = wire.program_bytes(program)
        self.ask(wire.LOAD_BEGIN, wire.load_begin(program, data))
        for offset in range(0, len(data), chunk_bytes):
            self.ask(wire.LOAD_CHUNK, offset.to_bytes(4, "little") + data[offset : offset + chunk_bytes])
        self.ask(wire.LOAD_END)

    def arm(self, heartbeat_ticks=0, start=wire.BY_COMMAND, debounce_ticks=0):
        self.ask(wire.ARM, wire.ARM_REQUEST.pack(heartbeat_ticks, start, debounce_ticks))

    def play(self, program, heartbeat_ticks=0):
        self.load(program)
        self.arm(heartbeat_ticks)
        self.ask(wire.START)

    def play_to_the_end(self, program, start=wire.BY_COMMAND):
        """Plays all cycles; the board must not end in a fault."""
        self.load(program)
        self.arm(start=start)
        self.ask(wire.START)
        while (status := self.status())["state"] in (wire.WAITING, wire.PLAYING):
            if status["state"] == wire.WAITING:
                self.usb.read(timeout_us=1_000)  # nothing comes: board time passes
        assert (status["state"], status["fault"]) == (wire.DONE, 0), wire.FAULTS[status["fault"]]

    def swap(self):
        """Lets the loaded next program follow; returns after how many cycles, and its number."""
        return wire.SWAP_REPLY.unpack(self.ask(wire.SWAP))

    def wait_until(self, states, polls=100_000):
        """Asks for the status until the board is in one of `states`; returns that status."""
        for _ in range(polls):
            status = self.status()
            if status["state"] in states:
                return status
        raise TimeoutError(f"the board stays in state {status['state']}")

    def digests(self, first=0):
        """The digests of cycles from number `first` on, as dictionaries, and how many are lost."""
        names = ("first_rise_ticks", "last_rise_ticks", "first_counter", "cycle", "entries_crc32", "trigger_count",
                 "program", "flags")
        reply = self.ask(wire.READ_DIGESTS, first.to_bytes(4, "little") + (31).to_bytes(2, "little") + b"\0\0")
        _, _, lost, count, _ = wire.DIGESTS_REPLY.unpack_from(reply)
        return [dict(zip(names, wire.DIGEST.unpack_from(reply, wire.DIGESTS_REPLY.size + n * wire.DIGEST.size)))
                for n in range(count)], lost

    def trigger_log(self, first=0):
        """All entries from counter `first` on that the board has now, and how many it has lost."""
        entries = []
        while True:
            reply = self.ask(wire.READ_TRIGGER_LOG, first.to_bytes(4, "little") + (48).to_bytes(2, "little") + b"\0\0")
            _, _, lost, count, _ = wire.LOG_REPLY.unpack_from(reply)
            for n in range(count):
                entries.append(wire.LOG_ENTRY.unpack_from(reply, wire.LOG_REPLY.size + n * wire.LOG_ENTRY.size))
            if count == 0:
                return entries, lost
            first = entries[-1][1] + 1
