# SPDX-License-Identifier: MIT
# Whatever fails in play: dark, how soon, and with which cause. Prints the table of docs/firmware.md, "How each doubt ends
# dark" (pytest -s).
import os
import random
import re
import subprocess
import sys
import zlib

import pytest

import check_trace
from ols_board import board as board_of
from ols_board import claims, wire
from ols_board.board import BoardError
from ols_board.program import CHAIN_BITS, EXPOSURE_TICKS, PERIOD_TICKS, paper_program
from ols_board.stops import LIT, MS, injected, wait_for_fault

ROUNDS = int(os.environ.get("FAULTS", 4))  # of each fault
HANDLER_TICKS_MAX = 1250  # 10 us
SUSPEND_TICKS = 3 * MS  # an idle bus is a suspended one (USB 2.0 7.1.7.6)
BUS_RESET_TICKS = 0  # a bus reset shows as it begins
TIMER_TICKS = 2 * 125  # the timer's steps, twice
READ_BEFORE_TICKS = 50 * 125  # and some of the program's words are checked in between
GAP_TRIGGER = {"offset_ticks": EXPOSURE_TICKS, "width_ticks": PERIOD_TICKS - EXPOSURE_TICKS - 20}  # to a cycle's end


def bright_program():
    """In which the light is on or, between two lights, TRIG1, but for the 8 ticks before each LATCH: so that what ends in
    the dark can be seen to."""
    pick = random.Random(4)
    slots = [{"kind": wire.BASIS, "trigger_mask": 3, "exposure_ticks": EXPOSURE_TICKS, "period_ticks": PERIOD_TICKS,
              "bits": [int(lamp < 156 and (lamp + n) % 18 < 9 and pick.random() < 0.9) for lamp in range(CHAIN_BITS)]}
             for n in range(18)]
    return {"cycles": 0, "chain_bits": CHAIN_BITS, "slots": slots, "triggers": [{}, GAP_TRIGGER]}


def play_until_fault(board, link, program):
    """Plays until the board tells of a fault, plugging in again when the cable, the bus or the board has gone."""
    try:
        link.play(program)
        return link, wait_for_fault(link)
    except ConnectionError:
        link.usb.close()
        link = board.plug()
        return link, link.status()


def faults_at_random_ticks(emulated, injection):
    """Injects `injection` once in each of ROUNDS plays; returns (the trace's changes, [tick of each], [statuses])."""
    pick = random.Random(injection)
    # Some 40 to 60 slots into each play, for a slot has two triggers.
    moments = [f"trigger:{80 + 160 * n + pick.randrange(40)}+{pick.randrange(PERIOD_TICKS)}" for n in range(ROUNDS)]
    board = emulated(*(part for when in moments for part in ("--inject", f"{injection}@{when}")), trace=True)
    link, told = board.plug(), []
    for _ in moments:
        link, status = play_until_fault(board, link, bright_program())
        told.append(status)
        link.ask(wire.CLEAR_FAULT)
    board.stop()
    at = [tick for tick, _ in injected(board, {injection.split(":")[0]})]
    assert len(at) == ROUNDS
    return lit_changes(board), at, told


def lit_changes(board):
    return [change for change in check_trace.read_vcd(board.trace) if change[1] in LIT]


def rises(changes, name, end):
    """The ticks before `end` at which a signal rises."""
    return [tick for tick, which, level in changes if which == name and level and tick < end]


def rises_of_play(changes, tick):
    """The rises of TRIG0 of the play that `tick` lies in or after, up to its end."""
    before = rises(changes, "TRIG0", tick)
    begin = next((n for n in range(len(before) - 1, 0, -1) if before[n] - before[n - 1] > 2 * PERIOD_TICKS), 0)
    end = dark_from(changes, tick)
    return [rise for rise in rises(changes, "TRIG0", end + 1) if rise >= before[begin]]


def dark_from(changes, tick, within=23 * MS):
    """The tick of the last edge of lights and triggers after `tick`; all of them are low from then on."""
    level, last = {}, tick
    for at, name, value in changes:
        if at > tick + within:
            break
        level[name] = value
        if at >= tick:
            last = at
    assert not any(level.get(name) for name in LIT), f"not dark after {tick}"
    return last


def report(name, cause_to_dark, claim=claims.counted):
    claim(f"{name}: {len(cause_to_dark)} times, dark at most {max(cause_to_dark)} ticks, {max(cause_to_dark) / 125:.2f} us, "
          "after its cause")


def causes(told):
    return {wire.FAULTS[status["fault"]] for status in told}


@pytest.mark.parametrize(
    "injection, cause, noticed_ticks, within_ticks",
    [
        ("hardfault", "processor", 0, HANDLER_TICKS_MAX),
        ("unplug", "host lost", SUSPEND_TICKS, HANDLER_TICKS_MAX),
        ("suspend", "host lost", SUSPEND_TICKS, HANDLER_TICKS_MAX),
        ("busreset", "host lost", BUS_RESET_TICKS, HANDLER_TICKS_MAX),
        ("hang", "watchdog", 0, 20 * MS),
        ("lockup", "watchdog", 0, 20 * MS),
    ],
)
def test_a_fault_at_a_random_tick_is_dark_in_time_with_its_cause(emulated, injection, cause, noticed_ticks,
                                                                 within_ticks):
    changes, at, told = faults_at_random_ticks(emulated, injection)
    assert causes(told) == {cause}
    # PIO plays on until then: the fault is what made it dark.
    dark = [dark_from(changes, tick) - tick - noticed_ticks for tick in at]
    assert min(dark) > 0
    assert max(dark) <= within_ticks
    for tick, status in zip(at, told):
        slots = rises_of_play(changes, tick)
        noticed = tick + noticed_ticks - slots[0]
        if cause != "watchdog" and cause != "processor":
            assert status["fault_slot"] == (len(slots) - 1) % 18
            assert abs(status["fault_ticks"] - noticed) <= HANDLER_TICKS_MAX
        else:  # the last note before it, at most two turns of the main loop old
            assert 0 <= noticed - status["fault_ticks"] <= 2 * MS
            # The slot is read before the time, within the same turn.
            assert status["fault_slot"] in {(status["fault_ticks"] - before) // PERIOD_TICKS % 18
                                            for before in (0, READ_BEFORE_TICKS)}
    report(f"{injection}: {cause}", dark)


@pytest.mark.parametrize("in_light, cause, pin, due_ticks", [
    (True, "over-duty", "LIGHT_EN", EXPOSURE_TICKS),
    (False, "slipped", "TRIG0", PERIOD_TICKS),
], ids=["light", "trigger"])
def test_a_light_that_does_not_end_or_a_trigger_that_does_not_come_is_dark_soon_after_it_was_due(
        emulated, in_light, cause, pin, due_ticks):
    changes, at, told = upset_plays(emulated, bit=17, in_light=in_light)
    assert causes(told) == {cause}
    late = [dark_from(changes, tick) - (rises(changes, pin, tick + 1)[-1] + due_ticks) for tick in at]
    assert 0 < min(late) and max(late) <= HANDLER_TICKS_MAX
    report(f"upset:17 {'in a light' if in_light else 'between lights'}: {cause}", late)


def test_a_trigger_at_a_wrong_tick_is_dark_soon_after_it(emulated):
    changes, at, told = upset_plays(emulated, bit=3, in_light=False)
    assert causes(told) == {"slipped"}
    after = []
    for tick in at:
        dark = dark_from(changes, tick)
        before, rise = rises(changes, "TRIG0", dark + 1)[-2:]
        assert abs(rise - before - PERIOD_TICKS) == 8 and rise > tick
        after.append(dark - rise)
    assert max(after) <= HANDLER_TICKS_MAX
    report("upset:3, 1 bit of 8 ticks: slipped", after)


def test_a_stop_input_is_heeded_while_the_main_program_hangs(emulated):
    board = emulated("--inject", "hang@trigger:51", "--inject", "openlamp@trigger:61+1000", trace=True)
    link = board.plug()
    link, status = play_until_fault(board, link, bright_program())
    assert wire.FAULTS[status["fault"]] == "watchdog", "which was the first"
    board.stop()
    (at, _), = injected(board, {"openlamp"})
    assert 0 < dark_from(lit_changes(board), at) - at <= HANDLER_TICKS_MAX


# Inputs to the board's own eyes: what reaches it over the cable.


def test_a_cable_pulled_in_an_upload_leaves_a_board_that_is_dark_and_takes_the_next_one_whole(emulated):
    board = emulated(trace=True)
    program = paper_program(cycles=1, slots=60)
    data = wire.program_bytes(program)
    for at in (0, 500, 1000, len(data) - 200):
        link = board.plug()
        link.ask(wire.LOAD_BEGIN, wire.load_begin(program, data))
        for offset in range(0, at, 500):
            link.ask(wire.LOAD_CHUNK, offset.to_bytes(4, "little") + data[offset : min(offset + 500, at)])
        whole = wire.frame(wire.LOAD_CHUNK, 99, at.to_bytes(4, "little") + data[at : at + 200])
        link.usb.submit(1, 0x01, whole[:70])  # and in the middle of a frame, too
        link.usb.close()
    link = board.plug()
    assert link.status()["state"] == wire.IDLE
    with pytest.raises(BoardError) as refused:
        link.ask(wire.LOAD_END)
    assert refused.value.code == wire.ERROR_BAD_OFFSET
    link.play(program)
    assert link.wait_until([wire.DONE])["triggers_fired"] == 60
    board.stop()
    assert len(rises(lit_changes(board), "TRIG0", 10**12)) == 60


def damaged(frame, pick):
    """A frame with a bit flipped, a byte lost, doubled, or its end cut off."""
    at = pick.randrange(len(frame))
    return pick.choice([frame[:at] + bytes([frame[at] ^ 1 << pick.randrange(8)]) + frame[at + 1 :],
                        frame[:at] + frame[at + 1 :], frame[:at] + frame[at : at + 1] + frame[at:], frame[:at]])


def send_and_drop_replies(link, data):
    if data:
        link.usb.write(data)
    while link.usb.read(timeout_us=2000)[1]:
        pass
    link.stream.clear()


def test_damaged_and_replayed_frames_in_an_upload_never_make_another_program(emulated):
    pick = random.Random(6)
    board = emulated()
    link = board.plug()
    program = paper_program(cycles=1, slots=18)
    data = wire.program_bytes(program)
    chunks = [wire.frame(wire.LOAD_CHUNK, 500 + n, offset.to_bytes(4, "little") + data[offset : offset + 200])
              for n, offset in enumerate(range(0, len(data), 200))]
    loaded = refusals = 0
    for _ in range(30):
        link.ask(wire.LOAD_BEGIN, wire.load_begin(program, data))
        sent = list(chunks)
        victim = pick.randrange(len(sent))
        how = pick.choice(["damaged", "replayed", "exchanged", "whole"])
        if how == "damaged":
            sent[victim] = damaged(sent[victim], pick)
        if how == "replayed":
            sent.insert(pick.randrange(victim + 1, len(sent) + 1), sent[victim])
        if how == "exchanged":
            sent[victim - 1], sent[victim] = sent[victim], sent[victim - 1]
        for frame in sent:
            send_and_drop_replies(link, frame)
        send_and_drop_replies(link, bytes(1100))  # ends whatever frame the damage has left open
        try:
            link.ask(wire.LOAD_END)
            assert how in ("whole", "damaged"), how  # a byte between two frames is no damage
            assert link.status()["program_crc32"] == zlib.crc32(data)
            loaded += 1
        except BoardError as refused:
            refusals += 1
            assert how != "whole" and refused.code in (wire.ERROR_BAD_STATE, wire.ERROR_BAD_OFFSET, wire.ERROR_BAD_CRC)
            assert link.status()["state"] == wire.IDLE
    assert loaded > 0 and refusals > 10
    board.stop()


def test_damaged_and_replayed_frames_in_play_change_nothing_that_is_played(emulated):
    pick = random.Random(7)
    board = emulated(trace=True)
    link = board.plug()
    program = paper_program(cycles=0, slots=18)
    link.play(program)
    replayed = [wire.frame(wire.STATUS, 7), wire.frame(wire.START, 8), wire.frame(wire.LOAD_END, 9),
                wire.frame(wire.ARM, 10, wire.ARM_REQUEST.pack(0, 0, 0)), wire.frame(wire.CLEAR_FAULT, 11),
                wire.frame(wire.LOAD_CHUNK, 12, bytes(4) + wire.program_bytes(program)[:200])]
    for _ in range(40):
        frame = pick.choice(replayed)
        send_and_drop_replies(link, frame if pick.random() < 0.3 else damaged(frame, pick))
    send_and_drop_replies(link, bytes(1100))
    status = link.status()
    assert (status["state"], status["fault"]) == (wire.PLAYING, 0)
    board.stop()
    at = rises(lit_changes(board), "TRIG0", 10**12)
    assert {after - before for before, after in zip(at, at[1:])} == {PERIOD_TICKS} and len(at) > 10 * 18


# DMA and memory.


@pytest.mark.parametrize("channel, cause", [(0, "timeline starved"), (3, "shifter starved")])
def test_a_starved_feed_is_dark_in_the_tick_in_which_its_next_word_was_due(emulated, channel, cause):
    pick = random.Random(cause)
    dark_after = []
    for _ in range(ROUNDS):
        when = f"trigger:{2 * pick.randrange(10, 40) + 1}+{pick.randrange(PERIOD_TICKS)}"
        board = emulated("--inject", f"starve:{channel}@{when}", trace=True)
        link = board.plug()
        _, status = play_until_fault(board, link, bright_program())
        assert wire.FAULTS[status["fault"]] == cause
        board.stop()
        changes, (at, _) = lit_changes(board), injected(board, {"starve"})[0]
        dark = dark_from(changes, at)
        slots = rises_of_play(changes, at)
        assert status["fault_slot"] == (len(slots) - 1) % 18
        # What was in the FIFOs has been played on the tick; then the timeline goes dark by itself at the end of an event,
        # the shifter's starvation is noticed when the light comes on with no pattern to follow.
        into = dark - slots[-1]
        due = [0, EXPOSURE_TICKS, GAP_TRIGGER["offset_ticks"], GAP_TRIGGER["offset_ticks"] + GAP_TRIGGER["width_ticks"],
               PERIOD_TICKS - 12, PERIOD_TICKS]
        dark_after.append(min(into - tick for tick in due if tick <= into) if channel == 0 else into)
    assert max(dark_after) <= (0 if channel == 0 else HANDLER_TICKS_MAX)
    by_pio = cause == "timeline starved"
    report(f"starve:{channel}: {cause}", dark_after, claims.measured if by_pio else claims.counted)


def sequence_words_address():
    """Where the words of the first program loaded lie: in the second of two buffers, behind the header."""
    symbols = subprocess.run(["arm-none-eabi-nm", "-S", board_of.IMAGE], capture_output=True, text=True, check=True)
    address, size = next(line.split()[:2] for line in symbols.stdout.splitlines() if line.endswith(" sequences"))
    source = (board_of.ROOT / "firmware/sequence.h").read_text()
    words = int(re.search(r"SEQUENCE_WORDS_MAX = (\d+)", source)[1])
    return int(address, 16) + int(size, 16) - 4 * words, words


def test_program_memory_that_is_damaged_in_play_is_noticed_within_one_reading_of_it(emulated):
    pick = random.Random(8)
    address, _ = sequence_words_address()
    program = bright_program()
    loaded_bytes = len(wire.program_bytes(program))
    for part in ("slots", "patterns", "events"):
        # 18 slots of 16 bytes, then their patterns, then more than three events of four bytes for each.
        begin, end = {"slots": (0, 18 * 16), "patterns": (18 * 16, loaded_bytes),
                      "events": (loaded_bytes + 8, loaded_bytes + 18 * 12)}[part]
        for _ in range(max(1, ROUNDS // 2)):
            where = address + pick.randrange(begin, end)
            board = emulated("--inject", f"flip:{where}:{pick.randrange(8)}@trigger:{pick.randrange(40, 60)}", trace=True)
            link = board.plug()
            _, status = play_until_fault(board, link, program)
            board.stop()
            (at, _), = injected(board, {"flip"})
            cause = wire.FAULTS[status["fault"]]
            # An event may do something wrong before it is read again; whatever it does, has its own witness.
            assert cause == "bad memory" or part != "patterns" and cause in ("slipped", "over-duty", "timeline starved")
            turns = -(-(loaded_bytes + 18 * 32) // 256) + 1
            assert dark_from(lit_changes(board), at) - at <= 2 * turns * MS
            claims.counted(f"flip in {part}: {cause}, dark {(dark_from(lit_changes(board), at) - at) / MS:.2f} ms after it")


def test_damage_between_upload_and_arming_lights_nothing(emulated):
    address, _ = sequence_words_address()
    board = emulated("--inject", f"flip:{address + 300}:3@{300 * MS}", trace=True)
    link = board.plug()
    link.load(bright_program())
    link.usb.read(timeout_us=200_000)  # nothing comes: board time passes
    with pytest.raises(BoardError) as refused:
        link.arm()
    assert refused.value.code == wire.ERROR_FAULT_LATCHED
    assert wire.FAULTS[link.status()["fault"]] == "bad memory"
    board.stop()
    assert rises(lit_changes(board), "LIGHT_EN", 10**12) == []


def upset_plays(emulated, bit, in_light):
    """A bit of the timeline's counter flips in each of ROUNDS plays: in a light, or between two lights."""
    pick = random.Random(bit)
    begin, end = (300, EXPOSURE_TICKS - 300) if in_light else (EXPOSURE_TICKS + 600, PERIOD_TICKS - 700)
    at, told, changes = [], [], []
    for _ in range(ROUNDS):
        trigger = 2 * pick.randrange(3, 40) + 1  # TRIG0's, which comes by turns with TRIG1's
        board = emulated("--inject", f"upset:{bit}@trigger:{trigger}+{pick.randrange(begin, end)}", trace=True)
        link = board.plug()
        _, status = play_until_fault(board, link, bright_program())
        board.stop()
        told.append(status)
        offset = 10**9 * len(at)
        at.append(injected(board, {"upset"})[0][0] + offset)
        changes += [(when + offset, name, level) for when, name, level in lit_changes(board)]
    return changes, at, told


def test_no_handler_took_longer_than_its_instructions_were_counted_to_take(emulated):
    sys.path.insert(0, str(board_of.ROOT / "firmware/tools"))
    import count_cycles
    counter = count_cycles.Counter(count_cycles.read_functions(board_of.IMAGE))
    numbers = {16: "interrupt_tick", 17: "interrupt_heartbeat", 21: "interrupt_usb", 29: "interrupt_stop_inputs"}
    taken = {}
    for injection, heartbeat in (("openlamp", 0), ("busreset", 0), (None, 40 * MS)):
        board = emulated(*(("--inject", f"{injection}@trigger:31") if injection else ()))
        link = board.plug()
        link.play(bright_program(), heartbeat_ticks=heartbeat)
        link.usb.read(timeout_us=60_000)
        assert link.status()["state"] == wire.FAULT
        for number, times in board.stop()["handlers"].items():
            taken[int(number)] = max(taken.get(int(number), 0), times["longest"])
    for number, name in numbers.items():
        bound = count_cycles.ENTRY_CYCLES + counter.longest(name)
        claims.counted(f"{name}: {taken[number]} cycles taken, {bound} counted at most")
        assert 0 < taken[number] <= bound
