# SPDX-License-Identifier: MIT
# A stage and a daemon that the tests of a file share, as most of them change nothing that lasts.
import contextlib
import itertools

import pytest

from stage_daemon import BIN, Daemon, Stage, until


def pytest_configure():
    for program in ("stagectl", "stagesim", "rf", "gige_bridge"):
        if not (BIN / program).exists():
            raise pytest.UsageError(f"{BIN / program} is missing: run `make host`")


@contextlib.contextmanager
def on_stage(folder, settings="", stage="", options=()):
    """A stage that plays, and its daemon, idle."""
    daemon = Daemon(folder, settings, stage)
    with Stage(daemon.work, *options) as daemon.stage, daemon:
        daemon.until_state("idle")
        yield daemon


@pytest.fixture(scope="module")
def shared(tmp_path_factory):
    with on_stage(tmp_path_factory.mktemp("stage")) as daemon:
        yield daemon


@pytest.fixture
def daemon(shared):
    """The shared one, as it was at first."""
    shared.run("stop")
    until(lambda: shared.state() in ("idle", "fault"))
    if shared.state() == "fault":
        shared.run("status", "--clear-fault")
    shared.run("swap", "single")
    return shared


@pytest.fixture
def alone(tmp_path):
    """Makes stages of one's own: alone(settings, stage)."""
    with contextlib.ExitStack() as made:
        folders = (tmp_path / f"stage{number}" for number in itertools.count())
        yield lambda *settings, **more: made.enter_context(on_stage(next(folders), *settings, **more))
