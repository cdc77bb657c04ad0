# SPDX-License-Identifier: MIT
"""Boards on the socket that misbehave, each verb against each: it ends by itself, names the board, takes no memory, and the first
Ctrl-C ends a wait that is longer than somebody's patience. The board is tests/unit/fake_board.py, which shares no code with ours."""
import concurrent.futures
import os
import pathlib
import random
import re
import resource
import signal
import struct
import subprocess
import tempfile
import time

import pytest

from fake_board import (ARM, CLEAR, DIGESTS, ERROR, HELLO, LOAD_BEGIN, LOAD_CHUNK, LOG, PLAYING, REPLY, START, STATUS, USBR,
                        FakeBoard, digest, digests_reply, entry, frame, log_reply, reply_head)

ROOT = pathlib.Path(__file__).resolve().parents[2]
STAGECTL = ROOT / "build/host/bin/stagectl"
SEQUENCE = ROOT / "examples/sequence_single.toml"
ADDRESS_SPACE = 2 << 30  # a program that grows is refused memory, and ends by an exception
HANG_S = 60  # far above what any run may take; not a measure of speed


def noise(seed, count):
    return random.Random(seed).randbytes(count)


def forever(piece):
    while True:
        yield piece


def trickle(data, seconds):
    for byte in data:
        yield bytes([byte])
        yield seconds


# On the socket: what comes instead of a transfer's reply.
TRANSFERS = {
    "silent": lambda board, tag, wanted, payload: [3600],
    "half a head": lambda board, tag, wanted, payload: [reply_head(tag)[:8], 3600],
    "a head and no payload": lambda board, tag, wanted, payload: [reply_head(tag, 0, wanted), 3600],
    "a payload that ends early": lambda board, tag, wanted, payload: [reply_head(tag, 0, wanted) + b"x" * (wanted // 2), 3600],
    "byte by byte without end": lambda board, tag, wanted, payload: trickle(reply_head(tag, 0, wanted) + bytes(wanted), 0.2),
    "nothing, again and again": lambda board, tag, wanted, payload: [reply_head(tag)],
    "garbage": lambda board, tag, wanted, payload: [noise(1, 4096)],
    "garbage without end": lambda board, tag, wanted, payload: forever(noise(2, 65536)),
    "garbage as payload": lambda board, tag, wanted, payload: [reply_head(tag, 0, wanted) + noise(3, wanted)],
    "zeros": lambda board, tag, wanted, payload: forever(bytes(4096)),
    "another magic": lambda board, tag, wanted, payload: [reply_head(tag, magic=0x54425355), 3600],
    "a length of 2^32 - 1": lambda board, tag, wanted, payload: [reply_head(tag, 0, 0xffffffff), 3600],
    "a length of 2^32 - 1 and as many bytes": lambda board, tag, wanted, payload: [reply_head(tag, 0, 0xffffffff), *[bytes(65536)] * 99999],
    "a byte more than asked for": lambda board, tag, wanted, payload: [reply_head(tag, 0, wanted + 1) + bytes(wanted + 1)],
    "a length of 2^31 in another's reply": lambda board, tag, wanted, payload: [reply_head(tag - 1, 0, 1 << 31), 3600],
    "replies to no transfer": lambda board, tag, wanted, payload: [reply_head(0)],
    "replies to transfers to come": lambda board, tag, wanted, payload: [reply_head(tag + 1)],
    "replies to old transfers without end": lambda board, tag, wanted, payload: forever(reply_head(max(1, tag - 1))),
    "an unknown status": lambda board, tag, wanted, payload: [reply_head(tag, -99)],
    "a status above 0": lambda board, tag, wanted, payload: [reply_head(tag, 1, len(payload)) + payload],
    "timed out": lambda board, tag, wanted, payload: [reply_head(tag, -3)],
    "busy": lambda board, tag, wanted, payload: [reply_head(0, -6), None],
    "gone": lambda board, tag, wanted, payload: [None],
    "gone within a head": lambda board, tag, wanted, payload: [reply_head(tag)[:7], None],
    "gone within a payload": lambda board, tag, wanted, payload: [reply_head(tag, 0, wanted) + b"x" * (wanted // 2), None],
}


def answer(payload, kind_bits=REPLY):
    return lambda board, kind, request_id, _: frame(kind | kind_bits, request_id, payload)


def refuse(text, slot=0xffff):
    return lambda board, kind, request_id, _: frame(ERROR | REPLY, request_id, struct.pack("<HH", 3, slot) + text)


def damaged(board, kind, request_id, _):
    good = bytearray(frame(kind | REPLY, request_id))
    good[-1] ^= 1
    return bytes(good)


# As a message: what comes instead of its reply.
MESSAGES = {
    "no message": lambda board, kind, request_id, payload: b"",
    "another's number": lambda board, kind, request_id, payload: frame(kind | REPLY, request_id + 1),
    "another's type": lambda board, kind, request_id, payload: frame((kind + 1) | REPLY, request_id),
    "the request itself": lambda board, kind, request_id, payload: frame(kind, request_id, payload),
    "a damaged reply": damaged,
    "a reply of 1 byte": answer(b"x"),
    "a reply of 7 bytes": answer(b"1234567"),
    "a reply of 1024 bytes": answer(bytes(1024)),
    "a reply of 1024 times 0xff": answer(b"\xff" * 1024),
    "a refusal that is not UTF-8": refuse(b"\xff\xfe\xc3\x28\x80" * 20),
    "a refusal with a terminal's commands": refuse(b"\x1b[2J\x1b]0;x\x07" * 8),
    "a refusal without a text": lambda board, kind, request_id, payload: frame(ERROR | REPLY, request_id),
    "a refusal without an end": refuse(b"A" * 1000, 7),
    "five thousand messages that nobody asked for": lambda board, kind, request_id, payload: frame(STATUS | REPLY, 999, bytes(52)) * 5000,
    "the head of a message of 1024 bytes": lambda board, kind, request_id, payload: frame(kind | REPLY, request_id, bytes(1024))[:10],
    "64 kB of noise": lambda board, kind, request_id, payload: noise(4, 65536),
}

LOGS = {
    "the same entries again": lambda first, most: log_reply(0, 48, [entry(n) for n in range(48)]),
    "entries without end": lambda first, most: log_reply(first, first + 10 * most, [entry(first + n) for n in range(most)]),
    "entries to the last counter": lambda first, most: log_reply(0xffffffff - 10, 0xffffffff, [entry(0xffffffff - 10 + n) for n in range(10)]),
    "one entry of 2^32 - 1": lambda first, most: log_reply(first, 0xffffffff, [entry(first)]),
    "more to come, and none of it": lambda first, most: log_reply(first, first + 5000, []),
    "a gap": lambda first, most: log_reply(first, first + 9, [entry(first), entry(first + 5)]),
    "a jump back": lambda first, most: log_reply(first, first + 9, [entry(first), entry(first + 1), entry(first)]),
    "ticks that go back": lambda first, most: log_reply(first, first + 9, [entry(first, 1000), entry(first + 1, 10)]),
    "ticks of 2^64 - 1": lambda first, most: log_reply(first, first + 1, [entry(first, (1 << 64) - 1)]),
    "more entries than bytes": lambda first, most: log_reply(first, first + 48, [entry(first)], count=48),
    "more entries than asked for": lambda first, most: log_reply(first, first + 50, [entry(first + n) for n in range(50)]),
    "a count of 65535": lambda first, most: log_reply(first, 70000, [], count=65535),
    "the first alone, again and again": lambda first, most: log_reply(0, 1, [entry(0)]),
    "fewer than before": lambda first, most: log_reply(0, max(0, 96 - first), [entry(n) for n in range(min(48, max(0, 96 - first)))]),
}

DIGEST_LISTS = {
    "the same digests again": lambda first: digests_reply(0, 4, [digest(n, n) for n in range(4)]),
    "digests without end": lambda first: digests_reply(first, first + 310, [digest(first + n, first + n) for n in range(31)]),
    "numbers to the last": lambda first: digests_reply(0xfffffff0, 0xffffffff, [digest(n, n) for n in range(15)]),
    "more digests than bytes": lambda first: digests_reply(first, first + 31, [digest(0)], count=31),
    "a count of 65535 digests": lambda first: digests_reply(first, 70000, [], count=65535),
    "more digests, and none of them": lambda first: digests_reply(first, first + 7, []),
    "digests that begin alike": lambda first: digests_reply(first, first + 2, [digest(5), digest(5)]),
    "digests that end before they begin": lambda first: digests_reply(first, first + 1, [digest(5, 0, 1, 100, 50)]),
}


def log_of(make):
    def work(board, kind, request_id, payload):
        first, most, _ = struct.unpack("<IHH", payload)
        return frame(kind | REPLY, request_id, make(first, most))

    return work


def digests_of(make):
    return lambda board, kind, request_id, payload: frame(kind | REPLY, request_id, make(struct.unpack("<IHH", payload)[0]))


def status_of(**odd):
    return lambda board, kind, request_id, payload: frame(kind | REPLY, request_id, board.status(payload, **odd))


def playing_after(board, kind, request_id, payload):
    """Plays on, and its clock stands still."""
    if board.state == PLAYING or board.fired:
        board.ticks = 0
        return frame(kind | REPLY, request_id, board.status(payload, state=PLAYING))
    return frame(kind | REPLY, request_id, board.status(payload))


def hello_of(**odd):
    return lambda board, kind, request_id, payload: frame(kind | REPLY, request_id, board.hello(payload, **odd))


STATUS_CYCLES = ("status", "--cycles", "--json")
PLAY = ("play", SEQUENCE, "--json")
RUN = ("run", "--sequence", SEQUENCE, "--nominal", "--camera", "fake:2000", "--json")
CALIBRATE = ("calibrate", "--camera", "fake:2000", "--json")

ALL = "EVERY_CASE" in os.environ  # the long version, some minutes


def at_each(often, seldom):
    """Messages at which to misbehave."""
    return often + seldom if ALL else often


# (verb, what the board does, the board's arguments, exit codes that are right)
CASES = []
for name, spoil in TRANSFERS.items():
    CASES += [(verb, f"{name} from hello on", {"spoil_transfer": spoil}, {1}) for verb in at_each([("status", "--json")], [PLAY, RUN, CALIBRATE])]
    CASES += [(PLAY, f"{name} from {at} on", {"spoil_transfer": spoil, "at": at}, {1}) for at in at_each([LOAD_CHUNK, LOG], [STATUS, ARM, START])]
    CASES += [(RUN, f"{name} from {at} on", {"spoil_transfer": spoil, "at": at}, {1, 2}) for at in at_each([LOG], [START])]
    CASES += [(STATUS_CYCLES, f"{name} from {at} on", {"spoil_transfer": spoil, "at": at}, {1}) for at in at_each([DIGESTS], [LOG])]
for name, spoil in MESSAGES.items():
    CASES += [(("status", "--clear-fault", "--json"), f"{name} for {at}", {"spoil_reply": spoil, "at": at}, {1}) for at in at_each([HELLO, STATUS], [CLEAR])]
    CASES += [(PLAY, f"{name} for {at}", {"spoil_reply": spoil, "at": at}, {1}) for at in at_each([LOAD_CHUNK, LOG], [LOAD_BEGIN, ARM, START])]
    CASES += [(RUN, f"{name} for {at}", {"spoil_reply": spoil, "at": at}, {1, 2}) for at in at_each([START], [LOG])]
    CASES += [(STATUS_CYCLES, f"{name} for {at}", {"spoil_reply": spoil, "at": at}, {1}) for at in at_each([DIGESTS], [LOG])]
for name, make in LOGS.items():
    # What status sees is one look: a log that is sound, but not what it was before, is not seen to be wrong.
    CASES += [(STATUS_CYCLES, name, {"spoil_reply": log_of(make), "at": LOG}, {0, 1}),
              (PLAY, name, {"spoil_reply": log_of(make), "at": LOG}, {1, 2}),
              (RUN, name, {"spoil_reply": log_of(make), "at": LOG}, {1, 2})]
for name, make in DIGEST_LISTS.items():
    CASES.append((STATUS_CYCLES, name, {"spoil_reply": digests_of(make), "at": DIGESTS}, {0, 1}))
for verb in (PLAY, RUN):
    CASES += [(verb, "plays on while its clock stands still", {"spoil_reply": playing_after, "at": STATUS}, {1, 2}),
              (verb, "a state that there is not", {"spoil_reply": status_of(state=77), "at": STATUS}, {1}),
              (verb, "another boot nonce", {"spoil_reply": status_of(nonce=8), "at": STATUS}, {1, 2})]
CASES += [(("status", "--json"), "names that are not UTF-8", {"spoil_reply": hello_of(version=b"\xff\xc3\x28\x80", board=b"\xf0\x9f"), "at": HELLO}, {0}),
          (("status",), "names with a terminal's commands", {"spoil_reply": hello_of(version=b"\x1b[2J", board=b"\x1b]0;x\x07"), "at": HELLO}, {0}),
          (("status", "--json"), "names without an end", {"spoil_reply": hello_of(version=b"v" * 24, board=b"b" * 16), "at": HELLO}, {0})]


def limit_memory():
    resource.setrlimit(resource.RLIMIT_AS, (ADDRESS_SPACE, ADDRESS_SPACE))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))


def play_against(board_arguments, verb, folder, interrupt_s=None, patience_s=0.5):
    path = folder / "board.sock"
    board = FakeBoard(path, **board_arguments)
    command = [STAGECTL, *verb, "--board", f"socket:{path}", "--patience", patience_s]
    if verb[0] in ("run", "calibrate"):
        command += ["-o", folder / "out.rfa"]
    process = subprocess.Popen(list(map(str, command)), stdout=subprocess.PIPE, stderr=subprocess.PIPE, preexec_fn=limit_memory)
    begin = time.monotonic()
    try:
        if interrupt_s is not None:
            time.sleep(interrupt_s)
            process.send_signal(signal.SIGINT)
        printed, errors = process.communicate(timeout=HANG_S)
    except subprocess.TimeoutExpired:
        process.kill()
        process.communicate()
        return "hangs", b"", b"", board
    finally:
        board.close()
    return process.returncode, printed, errors, board


def problem_of(case):
    verb, what, arguments, codes = case
    with tempfile.TemporaryDirectory() as folder:
        code, printed, errors, board = play_against(arguments, verb, pathlib.Path(folder))
        text = errors.decode("ascii", "backslashreplace")
        where = f"stagectl {verb[0]} {' '.join(map(str, verb[1:]))}, {what}: exit code {code}, {text}"
        if code not in codes:
            return where
        if code == 1 and not re.search(r"stagectl: .*(board|camera)", text):
            return f"{where}: does not name the device"
        if code == 1 and "board at '" in text and folder not in text:
            return f"{where}: does not name its board"
        if re.search(rb"[^\x20-\x7e\n]", printed) or re.search(rb"[^\x20-\x7e\n\xe2\x80\x93]", errors):
            return f"{where}: prints {printed!r}, {errors!r}"
    return None


def test_every_verb_ends_against_every_board_and_names_it():
    with concurrent.futures.ThreadPoolExecutor(24) as pool:
        problems = [problem for problem in pool.map(problem_of, CASES) if problem]
    assert not problems, f"{len(problems)} of {len(CASES)}:\n" + "\n".join(problems)


# Where the user's own patience is shorter than the program's. An hour of it, and Ctrl-C.
WAITS = [(verb, {"spoil_transfer": TRANSFERS[name], "at": at})
         for name in ("silent", "byte by byte without end", "a payload that ends early", "half a head")
         for verb, at in ((("status",), None), (PLAY, None), (PLAY, LOAD_CHUNK), (PLAY, START), (PLAY, LOG), (RUN, START), (RUN, LOG), (CALIBRATE, LOG))]
WAITS += [(verb, {"spoil_reply": playing_after, "at": STATUS}) for verb in (PLAY, RUN, CALIBRATE)]


def wait_problem(case):
    verb, arguments = case
    with tempfile.TemporaryDirectory() as folder:
        code, _, errors, _ = play_against(arguments, verb, pathlib.Path(folder), interrupt_s=1.5, patience_s=3600)
    return f"{verb} {arguments}: {errors}" if code == "hangs" else None


def test_the_first_ctrl_c_ends_every_wait_for_a_board():
    with concurrent.futures.ThreadPoolExecutor(len(WAITS)) as pool:
        problems = [problem for problem in pool.map(wait_problem, WAITS) if problem]
    assert not problems, "\n".join(problems)


@pytest.mark.parametrize("name", ["garbage as payload", "nothing, again and again", "timed out"])
def test_a_board_that_is_heard_no_more_is_told_to_stop(tmp_path, name):
    code, _, errors, board = play_against({"spoil_transfer": TRANSFERS[name], "at": LOG}, PLAY, tmp_path)
    assert code == 1 and board.stops == 1, errors


def test_the_honest_board_is_played_to_its_end(tmp_path):
    code, printed, errors, board = play_against({}, PLAY, tmp_path)
    assert code == 0, errors
    assert printed.count(b"\n") == board.total() and board.stops == 0
