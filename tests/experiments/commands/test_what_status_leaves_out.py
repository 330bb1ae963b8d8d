"""Status lists the sessions omitted from its table, and why a table is empty."""

import json
import shutil

import pytest

from experiments.session.lock import session_lock
from experiments.session.store import create_session
from tests.experiments.program import only_session, traction


@pytest.fixture
def data(recorded, tmp_path):
    """A copy of a data folder with one session."""
    shutil.copytree(recorded.data, tmp_path / "data")
    return tmp_path / "data"


def status(config, data, *options):
    done = traction("status", "--config", config, "--data", data, *options)
    assert done.code == 0
    return done


def test_a_complete_status_table_has_no_remarks(config, data):
    assert status(config, data).err == ""


def test_a_data_folder_that_does_not_exist_is_reported(config, tmp_path):
    done = traction("status", "--config", config, "--data", tmp_path / "typo")
    assert done.code == 2
    assert f"no data folder {tmp_path / 'typo'}" in done.err


def test_a_data_folder_without_sessions_is_reported(config, tmp_path):
    assert "no sessions" in status(config, tmp_path).err


def test_a_session_of_an_unknown_terrain_is_reported(config, tmp_path):
    create_session(tmp_path, "MOON", is_simulated=True, utc_ns=0)
    assert "MOON is not a terrain of the matrix" in status(config, tmp_path).err


def test_a_session_renamed_to_another_terrain_is_reported_as_damaged(config, data):
    folder = only_session(data)
    folder.rename(folder.with_name(folder.name.replace("TF", "MOON")))
    done = traction("status", "--config", config, "--data", data)
    assert done.code == 6
    assert "MOON is not a terrain of the matrix" in done.err
    assert "events.jsonl is of TF: a renamed session" in done.err


def test_a_condition_that_matches_nothing_is_reported(config, data):
    done = status(config, data, "--where", "terrain=TF,stones=big", "--json")
    assert "Nothing matches --where terrain=TF,stones=big" in done.err
    assert json.loads(done.out) == []


def test_resume_reports_that_the_session_is_open_elsewhere(tmp_path):
    folder = create_session(tmp_path, "TF", is_simulated=True, utc_ns=0)
    with session_lock(folder):
        done = traction("resume", "--data", tmp_path)
    assert done.code == 2
    assert f"{folder.id} is open in process" in done.err
