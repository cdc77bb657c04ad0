# SPDX-License-Identifier: MIT
"""The account of a take of the fault matrix held against what was done: right, an exception by name and with its reason, or wrong."""
import collections

# What is done to triggers: in words, and the cause that the account must say; None: its frame is to be kept.
DONE = {
    "board": ("the board ended before it: fault, emergency stop", "board_did_not_fire"),
    "board reset": ("the board was reset before it", "board_gone"),
    "miss_trigger": ("the camera did not see it", "camera_missed_trigger"),
    "lose_frame": ("the frame was lost on the link", "link_lost_it"),
    "cut_frame": ("a part of the frame was lost on the link", "link_lost_it"),
    "late_beyond": ("the frame came 40 frames late", "link_lost_it"),
    "host": ("no room, the host being late", "host_was_late"),
    "disk": ("no room, the disk being late", "disk_was_late"),
    "no_light": ("the lamps were dark", "no_light"),
    "stale_buffer": ("an old buffer under a new stamp", "stale"),
    "wrong_size": ("a frame of another size", "wrong_size"),
    "bad_time": ("a stamp between triggers", "not_proved"),
    "late_within": ("the frame came up to ten frames late", None),
    "swap_next": ("the next frame came before it", None),
    "twice": ("the frame came twice", None),
    "restart": ("the camera's count began anew", None),
    "clock_jump": ("the camera's clock jumped", None),
    "nothing": ("nothing", None),
}
RIGHT = {done: cause for done, (_, cause) in DONE.items()}
NOTHING_CAME = ("miss_trigger", "lose_frame", "cut_frame", "late_beyond", "host", "disk")
KEPT = "kept"
AFTER_STALL = 64  # triggers by which whoever reads has come to it again


class Verdicts:
    """Of one take: each trigger's strike, what the account says, and whether that is right, an exception by name, or wrong."""

    def __init__(self, take, link):
        self.take, self.link = take, link
        self.strikes = dict(take["strikes"])
        self.stalls = take["stalls"]
        self.kinds = take["kinds"]
        self.missing = {trigger: cause for trigger, cause, _ in take["missing"]}
        self.kept = dict(take["kept"])
        self.fired, self.triggers = take["fired"], take["triggers"]
        self.board = "board reset" if "reset" in take["report"]["board_end"] else "board"
        self.tally = collections.defaultdict(collections.Counter)  # by what was done: injected, right, exception, wrong
        self.exceptions = collections.Counter()  # by what was done and reason
        self.wrong = []
        self._mark_stalls()
        self._judge()

    def kind(self, trigger):
        return self.kinds[trigger % len(self.kinds)]

    def _mark_stalls(self):
        """Of a stall it is known when nothing was let go of, and, where the link tells the camera, which frames found no room."""
        self.stalled = {n: of for first, last, of in self.stalls for n in range(first, last + 1)}
        self.without_room = set(self.take["without_room"])

    def done(self, trigger):
        if trigger >= self.fired:
            return self.board
        if trigger in self.without_room and trigger not in self.kept:
            return self.stalled.get(trigger, "host")
        struck = self.strikes.get(trigger)
        # GigE does not tell: what is missing from a stall for no other reason found no room, be it late or twice.
        if trigger in self.stalled and not self.without_room and self.missing.get(trigger) == RIGHT[self.stalled[trigger]]:
            if struck not in ("miss_trigger", "lose_frame", "cut_frame"):
                return self.stalled[trigger]
        if struck:
            return struck
        if trigger in self.stalled and not self.without_room and self.missing.get(trigger) not in (None, "not_proved", "no_light"):
            return self.stalled[trigger]
        return "nothing"

    def _judge(self):
        came = [n for n in range(self.fired) if n in self.kept or self.done(n) not in NOTHING_CAME]
        self.first_came, self.last_came = (came[0], came[-1]) if came else (self.triggers, -1)
        self.first_kept, self.last_kept = min(self.kept, default=self.triggers), max(self.kept, default=-1)
        self.mixed = self._mixed_gaps()
        for trigger in range(self.triggers):
            if (trigger in self.missing) == (trigger in self.kept):
                self._wrong(trigger, "has no account, or two")
            elif trigger in self.kept and self.kept[trigger] != trigger:
                self._wrong(trigger, f"has the light of {self.kept[trigger]}")
            else:
                self._judge_cause(trigger, self.done(trigger), self.missing.get(trigger))

    def _judge_cause(self, trigger, done, said):
        if done == "nothing":
            if said is not None:
                self._collateral(trigger, said)
            return
        self.tally[done]["injected"] += 1
        right = RIGHT[done]
        exception = None if said == right else self._exception(trigger, done, said)
        if said == right:
            self.tally[done]["right"] += 1
        elif exception:
            self.tally[done]["exception"] += 1
            self.exceptions[done, exception] += 1
        else:
            self._wrong(trigger, f"{done}, and the account says {said or KEPT}")

    def _exception(self, trigger, done, said):
        """Where no witness can tell, what may be said instead."""
        if done in NOTHING_CAME and said == "no_frame" and not self.first_came < trigger < self.last_came:
            return "no frame before it, or none after it, has a count to tell by"
        if done in NOTHING_CAME and self.link != "ring" and said in (RIGHT[of] for of in self._stalls_beside(trigger)):
            return "lost while nothing had room, of which this driver is told no more"
        if trigger in self.mixed:
            return "of a gap the numbers are told, and not which is which"
        if done == "no_light" and said is None and self.kind(trigger) in "bd":
            return "dark as a lamp behind the subject, between landmarks that were lit"
        if done == "bad_time" and said == "no_frame" and trigger > self.last_kept:
            return "no frame before it, or none after it, has a count to tell by"
        if done in ("restart", "clock_jump") and said == "not_proved":
            return "where a count or a clock began anew, without a landmark between"
        if said in ("not_proved", "no_frame", "restarted") and trigger < self.first_kept:
            return "before the first frame that has its place"
        return None

    def _stalls_beside(self, trigger):
        """Stalls that it falls into, or behind which nobody has read on yet."""
        return [of for first, last, of in self.stalls if first <= trigger <= last + AFTER_STALL]

    def _collateral(self, trigger, said):
        """Frames that came as they should and are missing: the account may doubt them, and blame nobody."""
        if self.fired < self.triggers and said == RIGHT[self.board]:
            is_last = trigger == self.fired - 1
            if is_last or self.board == "board reset":
                what = "fired last, and its light may have been cut off" if is_last else "fired, and not told before the board was reset"
                self.exceptions["nothing", what] += 1
                return
        is_dark = self.take["lit"][trigger % len(self.kinds)] == "0"
        if said == "not_proved":
            self.exceptions["nothing", "not_proved: no landmark proves it, what is wrong beside it being what it is"] += 1
        elif said == "restarted":
            self.exceptions["nothing", "restarted: before the first frame that has its place, beside a stamp that fits no trigger"] += 1
        elif said == "no_light" and is_dark:
            self.exceptions["nothing", "no_light: dark by its slot or behind the subject, beside a spell without light"] += 1
        else:
            self._wrong(trigger, f"nothing was done to it, and the account says {said}")

    def _mixed_gaps(self):
        """Triggers of gaps whose triggers fell to several causes, if the account has the right number of each."""
        mixed, gap = set(), []
        for n in range(self.fired + 1):
            if n < self.fired and n not in self.kept and self.done(n) in NOTHING_CAME:
                gap.append(n)
                continue
            wanted = collections.Counter(RIGHT[self.done(t)] for t in gap)
            if len(wanted) > 1 and wanted == collections.Counter(self.missing.get(t) for t in gap):
                mixed |= set(gap)
            gap = []
        return mixed

    def _wrong(self, trigger, what):
        done = self.done(trigger)
        self.tally[done]["wrong"] += 1
        self.wrong.append(f"trigger {trigger} ({self.kind(trigger)}): {what}")
