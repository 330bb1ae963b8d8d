import json
import os
import shutil

import pytest

from experiments.preflight.conditions import last_foot
from tests.experiments.program import only_session, traction


@pytest.fixture
def data(recorded, tmp_path):
    """A copy of the data with a session of TF and the foot tread."""
    shutil.copytree(recorded.data, tmp_path / "data")
    return tmp_path / "data"


def add_session(data, name, foot, seconds):
    """Add a session that was open `seconds` after 1970."""
    folder = data / "sessions" / name
    folder.mkdir()
    (folder / "conditions.json").write_text(json.dumps({"terrain.foot": foot}))
    (folder / "events.jsonl").write_text("")
    os.utime(folder / "events.jsonl", (seconds, seconds))


def run(config, data, terrain, script):
    script_file = data / "script.txt"
    script_file.write_text(script)
    options = ("--fake", "--fast", "--config", config, "--data", data)
    return traction("run", terrain, *options, "--operator-script", script_file)


def test_there_is_no_last_foot_before_the_first_session(tmp_path):
    assert last_foot(tmp_path, is_simulated=True) is None


def test_the_last_foot_is_that_of_the_session_open_last(data):
    add_session(data, "2027-01-01_S007_Tf.fake", "bare", 1)
    last = last_foot(data, is_simulated=True)
    assert (last.folder.id, last.foot) == ("S001", "tread")
    add_session(data, "2027-01-01_S002_Tf.fake", "bare", 5_000_000_000)
    last = last_foot(data, is_simulated=True)
    assert (last.folder.id, last.foot) == ("S002", "bare")


def test_simulated_sessions_do_not_state_the_real_foot(data):
    assert last_foot(data, is_simulated=False) is None


def test_damaged_conditions_name_no_foot(data):
    (only_session(data) / "conditions.json").write_text("[")
    assert last_foot(data, is_simulated=True) is None


@pytest.mark.slow
def test_another_foot_is_confirmed_and_shown_on_the_preflight_page(config, data):
    done = run(config, data, "Tf", "last\nlast\n")  # no trial at all
    assert "S001 was recorded with the foot tread; Tf needs the foot bare." in done.out
    (folder,) = (data / "sessions").glob("*_S002_Tf.fake")
    page = json.loads((folder / "preflight.json").read_text())["checks"]
    assert page[0] == {
        "mark": "✔",
        "name": "foot",
        "text": "bare, mounted since S001 (tread), as confirmed",
    }
