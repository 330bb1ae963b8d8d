"""Foresight in a session: recorded beside the samples, and computed anew from them."""

import json

import numpy as np
import pytest

from acquisition.trial_file.reader import TrialReader
from tests.acquisition.ros import messages_of
from tests.analysis.foresight.databases import database, write_database
from tests.analysis.foresight.made import STONES, model
from tests.experiments.program import only_session, run_short, traction

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def foreseen(tmp_path_factory, config):
    """Return (data folder, trial file, database) of a session that was foreseen."""
    folder = tmp_path_factory.mktemp("foreseen")
    path = write_database(folder / "terrains.json")
    done = run_short(config, folder / "data", STONES, 1, "--foresight", path)
    assert done.code == 0, done.err
    trial = only_session(folder / "data") / "trials" / "T01.mcap"
    return folder / "data", trial, path


def test_a_state_is_recorded_for_every_fifth_cycle(foreseen):
    reader = TrialReader(foreseen[1])
    cycles = reader.cycles().data["cycle"]
    states = reader.foresight().data
    assert states["cycle"].tolist() == [c for c in cycles.tolist() if c % 5 == 0]
    assert set(states["since"].tolist()) == {int(cycles[0])}


def test_states_say_something_once_the_foot_stands(foreseen):
    states = TrialReader(foreseen[1]).foresight().data
    is_valid = (states["flags"] & 1) != 0
    p = states["slip_probability"][is_valid]
    assert is_valid.sum() > 100
    assert ((p[np.isfinite(p)] > 0.0) & (p[np.isfinite(p)] < 1.0)).all()
    shares = states["terrains"][is_valid]
    whole = shares[:, :2].sum(axis=1) + states["none"][is_valid]
    assert whole == pytest.approx(np.ones(len(whole)))
    assert np.isnan(shares[:, 2:]).all()


def test_other_programs_read_the_channel_by_its_own_definition(foreseen):
    rows = messages_of(foreseen[1])["/foresight"]
    states = TrialReader(foreseen[1]).foresight()
    assert len(rows) == len(states.data)
    assert [time for time, _ in rows] == states.log_time.tolist()


def test_the_trial_says_what_it_was_foreseen_with(foreseen):
    said = TrialReader(foreseen[1]).metadata["foresight"]
    assert json.loads(said["terrains"]) == list(model().terrains)
    assert said["known_rig"] == "true"
    assert len(said["sha256"]) == 64


def test_every_field_of_the_channel_has_its_unit_in_the_trial(foreseen):
    said = TrialReader(foreseen[1]).metadata["channels"]
    states = TrialReader(foreseen[1]).foresight().data
    numbers = [n for n in states.dtype.names if states.dtype[n].base.kind == "f"]
    assert {f"foresight.{name}" for name in numbers} <= set(said)
    assert said["foresight.v_t"].startswith("m/s")


def test_the_record_gives_the_same_bits_again(foreseen):
    data, _, path = foreseen
    done = traction("replay", "S001", "T01", "--data", data, "--foresight", path)
    assert done.code == 0, done.err
    count = len(TrialReader(foreseen[1]).foresight().data)
    assert f"{count} of {count}" in done.out


def test_other_models_do_not_pass_for_those_of_the_record(foreseen, tmp_path):
    changed = model().to_dict()
    changed["slip"]["regression"]["weights"][1] += 1e-12
    (tmp_path / "other.json").write_text(database(changed))
    done = traction(
        *("replay", "S001", "T01", "--data", foreseen[0]),
        *("--foresight", tmp_path / "other.json"),
    )
    assert done.code == 1
    assert "other models" in done.err
    assert "first state that differs" in done.err


def test_a_session_without_a_database_records_no_foresight(first_trial):
    reader = TrialReader(first_trial)
    assert not reader.has_foresight
    assert len(reader.foresight().data) == 0
    assert "foresight" not in reader.metadata


def test_a_trial_that_was_not_foreseen_cannot_be_compared(recorded, foreseen):
    done = traction(
        *("replay", "S001", "T01", "--data", recorded.data),
        *("--foresight", foreseen[2]),
    )
    assert done.code == 2
    assert "no foresight channel" in done.err


def test_foresight_of_no_trial_is_refused(foreseen):
    done = traction("replay", "--foresight", foreseen[2])
    assert done.code == 2
    assert "--foresight" in done.err


@pytest.mark.parametrize("text", [None, "{}", database()], ids=["none", "no", "old"])
def test_a_database_that_cannot_foresee_starts_nothing(tmp_path, config, text):
    path = tmp_path / "terrains.json"
    if text is not None:
        path.write_text(text)
    done = run_short(config, tmp_path / "data", STONES, 1, "--foresight", path)
    assert done.code == 2
    assert not list((tmp_path / "data").glob("sessions/*"))


def test_the_database_of_the_studys_report_is_used_by_itself(tmp_path, config):
    (tmp_path / "study").mkdir()
    write_database(tmp_path / "study" / "terrains.json")
    done = run_short(config, tmp_path, "Tf", 1)
    assert done.code == 0, done.err
    assert "another foot or rig" in done.out + done.err  # Tf is pushed bare
    reader = TrialReader(only_session(tmp_path) / "trials" / "T01.mcap")
    assert reader.metadata["foresight"]["known_rig"] == "false"
    assert np.isnan(reader.foresight().data["slip_probability"]).all()


def test_a_damaged_database_of_the_study_does_not_stop_a_session(tmp_path, config):
    (tmp_path / "study").mkdir()
    (tmp_path / "study" / "terrains.json").write_text("{")
    done = run_short(config, tmp_path, STONES, 1)
    assert done.code == 0, done.err
    assert "Foresight is off." in done.out
    assert not TrialReader(only_session(tmp_path) / "trials" / "T01.mcap").has_foresight


@pytest.mark.parametrize("is_there", [True, False])
def test_a_session_that_is_opened_again_is_foreseen_as_before(
    config, tmp_path, is_there
):
    data = tmp_path / "data"
    path = write_database(tmp_path / "terrains.json")
    assert run_short(config, data, STONES, 1, "--foresight", path).code == 0
    if not is_there:
        path.unlink()

    auto = ("--operator-script", "auto", "--data", data)
    done = traction("redo", "S001", "T01", "--reason", "again", *auto)
    assert done.code == 0, done.err
    trial = only_session(data) / "trials" / "T01.mcap"
    assert TrialReader(trial).has_foresight is is_there
    assert ("Foresight is off." in done.out) is not is_there
