# SPDX-License-Identifier: MIT
"""The fault matrix: plays scenarios (scenarios/*.toml) over camera links with fault_matrix, and holds what the recorder's account says
of each trigger against what was done to it.

usage: matrix.py [--page docs/faults.md] [SCENARIO...]     all scenarios, as many strikes as they say; prints the table
"""
import argparse
import collections
import json
import pathlib
import subprocess
import sys
import tempfile
import tomllib

HERE = pathlib.Path(__file__).resolve().parent
PROGRAM = HERE.parents[1] / "build/host/bin/fault_matrix"
SCENARIOS = HERE / "scenarios"
LINKS = ("ring", "gige", "v4l2")

# What the account must say of a trigger that was struck: a cause, or None where its frame is to be kept.
RIGHT = {
    "miss_trigger": "camera_missed_trigger",
    "lose_frame": "link_lost_it",
    "cut_frame": "link_lost_it",
    "wrong_size": "wrong_size",
    "stale_buffer": "stale",
    "bad_time": "not_proved",
    "late_within": None,
    "late_beyond": "link_lost_it",
    "twice": None,
    "swap_next": None,
    "no_light": "no_light",
    "restart": None,
    "clock_jump": None,
    "host": "host_was_late",
    "disk": "disk_was_late",
    "board": "board_did_not_fire",
}
NOTHING_CAME = ("miss_trigger", "lose_frame", "cut_frame", "late_beyond", "host", "disk")
KEPT = "kept"


class Verdicts:
    """Of one take: each trigger's strike, what the account says, and whether that is right, an exception by name, or wrong."""

    def __init__(self, take):
        self.take = take
        self.strikes = dict(take["strikes"])
        self.stalls = take["stalls"]
        self.kinds = take["kinds"]
        self.missing = dict(take["missing"])
        self.kept = dict(take["kept"])
        self.fired, self.triggers = take["fired"], take["triggers"]
        self.tally = collections.defaultdict(collections.Counter)  # by what was done
        self.wrong = []
        self._mark_stalls()
        self._judge()

    def kind(self, trigger):
        return self.kinds[trigger % len(self.kinds)]

    def _mark_stalls(self):
        """Of a stall it is known when nothing was let go of, and that frames found no room then: which did not, the link decides."""
        self.stalled = {n: of for first, last, of in self.stalls for n in range(first, last + 1)}

    def done(self, trigger):
        if trigger >= self.fired:
            return "board"
        if trigger in self.strikes:
            return self.strikes[trigger]
        if trigger in self.stalled and trigger in self.missing:
            return self.stalled[trigger]
        return "nothing"

    def _judge(self):
        came = [n for n in range(self.fired) if n in self.kept or self.done(n) not in NOTHING_CAME]
        self.first_came, self.last_came = (came[0], came[-1]) if came else (self.triggers, -1)
        self.first_kept = min(self.kept, default=self.triggers)
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
            self.tally[done][exception] += 1
        else:
            self._wrong(trigger, f"{done}, and the account says {said or KEPT}")

    def _exception(self, trigger, done, said):
        """Where no witness can tell, what may be said instead."""
        if done in NOTHING_CAME and said == "no_frame" and not self.first_came < trigger < self.last_came:
            return "no frame before it, or none after it, has a count to tell by"
        if trigger in self.mixed:
            return "of a gap the numbers are told, and not which is which"
        if done == "no_light" and said is None and self.kind(trigger) in "bd":
            return "dark as a lamp behind the subject, between landmarks that were lit"
        if said in ("not_proved", "no_frame", "restarted") and trigger < self.first_kept:
            return "before the first frame that has its place"
        return None

    def _collateral(self, trigger, said):
        """Frames that came as they should and are missing: the account may doubt them, and blame nobody."""
        self.tally["nothing"][said] += 1
        is_dark = self.take["lit"][trigger % len(self.kinds)] == "0"
        if said not in ("not_proved", "restarted") and not (said == "no_light" and is_dark):
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


def play(scenario, link):
    """The takes of a scenario over a link."""
    with tempfile.TemporaryDirectory(prefix="matrix") as work:
        done = subprocess.run([PROGRAM, scenario, link, work], capture_output=True, text=True, timeout=60)
    if done.returncode != 0:
        raise RuntimeError(f"{scenario} over {link}: {done.stderr}")
    return [Verdicts(json.loads(line)) for line in done.stdout.splitlines()]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenarios", nargs="*", type=pathlib.Path)
    options = parser.parse_args()
    wrong = 0
    for path in options.scenarios or sorted(SCENARIOS.glob("*.toml")):
        scenario = tomllib.loads(path.read_text())
        for link in scenario["links"]:
            takes = play(path, link)
            total = collections.defaultdict(collections.Counter)
            for take in takes:
                for done, counts in take.tally.items():
                    total[done] += counts
            print(f"{path.stem} over {link}")
            for done, counts in total.items():
                print(f"    {done}: {dict(counts)}")
            for line in [line for take in takes for line in take.wrong][:8]:
                print(f"    WRONG {line}")
            wrong += sum(len(take.wrong) for take in takes)
    return wrong > 0


if __name__ == "__main__":
    sys.exit(main())
