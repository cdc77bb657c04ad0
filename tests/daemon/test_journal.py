# SPDX-License-Identifier: MIT
# The journal's fields, as systemd-journald keeps them and journalctl finds them.
import json
import pathlib
import shutil
import subprocess
import sys

import pytest

from stage_daemon import Daemon, Stage, until

HERE = pathlib.Path(__file__).parent
PRIORITIES = {"debug": 7, "info": 6, "warning": 4, "error": 3}  # syslog(3)


def journal(folder, *matches):
    done = subprocess.run(["journalctl", "-D", str(folder), "-o", "json", "--no-pager", *matches], capture_output=True, text=True)
    return [json.loads(line) for line in done.stdout.splitlines()]


@pytest.fixture
def journaled(tmp_path):
    """A daemon whose standard error is a stream to a journald of its own, which keeps what it is told in `daemon.journal`."""
    if not shutil.which("journalctl") or not pathlib.Path("/lib/systemd/systemd-journald").exists():
        pytest.skip("there is no systemd-journald here")
    if subprocess.run(["unshare", "--mount", "true"], capture_output=True).returncode != 0:
        pytest.skip("no mount namespace can be made here: unshare --mount")
    daemon = Daemon(tmp_path)
    daemon.journal = tmp_path / "journal"
    daemon.journal.mkdir()
    daemon.under = ["unshare", "--mount", sys.executable, HERE / "in_journal.py", daemon.journal]
    with Stage(daemon.work), daemon:
        yield daemon


def test_each_event_is_an_entry_with_its_code_name_number_and_priority(journaled):
    journaled.until_state("idle")
    journaled.run("record", "--slate", "kept")
    journaled.config.write_text(journaled.text.replace("seconds = 0.1", "secnds = 1"))
    journaled.run("reload", code=1)  # an error: nothing else here is one
    events = journaled.events()
    assert {event["level"] for event in events} >= {"info", "error"}
    numbers = {event["number"] for event in events}
    until(lambda: numbers <= {int(entry.get("OLS_NUMBER", -1)) for entry in journal(journaled.journal)}, what="the last entry")
    entries = [entry for entry in journal(journaled.journal) if "OLS_NUMBER" in entry]
    by_number = {int(entry["OLS_NUMBER"]): entry for entry in entries}
    assert len(by_number) == len(entries), "each once"
    for event in events:
        entry = by_number[event["number"]]
        assert entry["OLS_CODE"] == str(event["code"]) and entry["OLS_EVENT"] == event["event"]
        assert entry["PRIORITY"] == str(PRIORITIES[event["level"]]) and entry["SYSLOG_IDENTIFIER"] == "stagectl"
        assert entry["MESSAGE"] == f"{event['code']} {event['event']}: {event['text']}"
    assert not journaled.read_log(), "nothing besides, on the streams that the journal does not have"
    # As docs/operating.md has it, and as anybody looks for what is wrong.
    finished = journal(journaled.journal, "OLS_EVENT=take_finished")
    assert len(finished) == 1 and "kept" in finished[0]["MESSAGE"]
    wrong = [entry for entry in journal(journaled.journal, "-t", "stagectl", "-p", "err") if "OLS_NUMBER" in entry]
    assert [entry["OLS_EVENT"] for entry in wrong] == ["configuration_wrong"]


# systemd.exec(5): a service whose standard error goes elsewhere has the variable, too.
def test_a_stream_that_is_not_the_journals_gets_lines(tmp_path):
    daemon = Daemon(tmp_path)
    daemon.start(JOURNAL_STREAM="1:2")
    daemon.end()
    assert "daemon_stopping" in daemon.read_log()
