# SPDX-License-Identifier: MIT
# A stage and a daemon that the tests of a file share, as most of them change nothing that lasts.
import pytest

from stage_daemon import BIN, Daemon, Stage, until


def pytest_configure():
    for program in ("stagectl", "stagesim", "rf", "gige_bridge"):
        if not (BIN / program).exists():
            raise pytest.UsageError(f"{BIN / program} is missing: run `make host`")


def on_stage(folder, settings="", stage="", options=()):
    """A stage that plays, and its daemon, idle."""
    daemon = Daemon(folder, settings, stage)
    virtual = Stage(daemon.work, *options).start()
    daemon.start()
    daemon.stage = virtual
    daemon.until_state("idle")
    return daemon


@pytest.fixture(scope="module")
def shared(tmp_path_factory):
    daemon = on_stage(tmp_path_factory.mktemp("stage"))
    yield daemon
    daemon.end()
    daemon.stage.end()


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
    made = []

    def make(settings="", stage="", options=()):
        made.append(on_stage(tmp_path / f"stage{len(made)}", settings, stage, options))
        return made[-1]

    yield make
    for daemon in made:
        daemon.end()
        daemon.stage.end()
