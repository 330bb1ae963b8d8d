"""One simulated session for all who only look at it."""

from dataclasses import dataclass
from pathlib import Path

import pytest

from tests.experiments.program import Done, only_session, run_short, write_config


@dataclass(frozen=True)
class Recorded:
    """A session of two trials on the flat plate."""

    done: Done
    data: Path
    folder: Path


@pytest.fixture(scope="session")
def config(tmp_path_factory):
    """Return a rig.toml with a matrix of short containers beside it."""
    return write_config(tmp_path_factory.mktemp("config"))


@pytest.fixture(scope="session")
def recorded(tmp_path_factory, config):
    data = tmp_path_factory.mktemp("data")
    done = run_short(config, data, "TF", 2)
    return Recorded(done, data, only_session(data))


@pytest.fixture(scope="session")
def first_trial(recorded):
    return recorded.folder / "trials" / "T01.mcap"
