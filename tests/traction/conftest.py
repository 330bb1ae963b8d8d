"""A session of two trials and its tables, in a working folder."""

import shutil

import pytest

from tests.experiments.program import traction


@pytest.fixture(scope="session")
def workplace(recorded, tmp_path_factory):
    """A folder with data/ of session S001 and its tables in tables/."""
    folder = tmp_path_factory.mktemp("workplace")
    shutil.copytree(recorded.data, folder / "data")
    data = folder / "data"
    done = traction("export", "S001", "--to", folder / "tables", "--data", data)
    assert (done.code, done.err) == (0, "")
    return folder


@pytest.fixture(autouse=True)
def _at_the_workplace(workplace, monkeypatch):
    monkeypatch.chdir(workplace)
