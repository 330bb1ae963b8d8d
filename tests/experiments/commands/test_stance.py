"""traction stance: what it refuses, and a session of it from tare to page."""

import json

import numpy as np
import pytest

from analysis.data.load import load_trial
from experiments.session.store import list_sessions
from experiments.settings.load import load_settings
from tests.experiments.program import traction, write_config


def test_a_real_arm_takes_no_stances(tmp_path):
    done = traction("stance", "S0", "--policy", "none", "--data", tmp_path)

    assert done.code == 3
    assert "Stances are not available on a real arm" in done.err
    assert "The arm was not touched" in done.err
    assert list_sessions(tmp_path) == []


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("--risk", "0"), "--risk 0 - expected"),
        (("--risk", "nan"), "--risk nan - expected"),
        (("--peak", "11"), "--peak 11 - expected"),
        (("--peak", "inf"), "--peak inf - expected"),
        (("--stances", "0"), "--stances 0 - expected"),
        (("--stances", "100"), "--stances 100 - expected"),
        (("--trials", "0"), "--trials 0 - expected"),
        (("--seed", "-1"), "--seed -1 - expected"),
        (("--foresight", "nowhere.json"), "nowhere.json"),
    ],
)
def test_options_out_of_range_start_nothing(tmp_path, options, words):
    done = traction(
        *("stance", "S0", "--fake", "--fast", "--policy", "none"),
        *(*options, "--data", tmp_path),
    )

    assert done.code == 2
    assert words in done.err
    assert "Traceback" not in done.err
    assert list_sessions(tmp_path) == []


@pytest.mark.parametrize(
    "arguments",
    [
        ("S0", "--policy", "boldness"),
        ("S0", "--risk", "much"),
        ("S0", "--stances", "2.5"),
    ],
)
def test_words_that_are_no_options_are_usage(tmp_path, arguments):
    done = traction("stance", *arguments, "--fake", "--data", tmp_path)

    assert done.code == 2
    assert "usage:" in done.err


def test_avoid_slip_needs_a_risk_that_is_known(tmp_path):
    done = traction("stance", "TF", "--fake", "--fast", "--data", tmp_path)

    assert done.code == 2
    assert "avoid-slip needs the risk of break-away" in done.err
    assert list_sessions(tmp_path) == []


def test_a_short_container_has_no_fresh_places(tmp_path):
    config = write_config(tmp_path, travel=0.1)
    done = traction(
        *("stance", "TF", "--fake", "--fast", "--policy", "none"),
        *("--config", config, "--data", tmp_path),
    )

    assert done.code == 2
    assert "0.1 m" in done.err


@pytest.mark.slow
def test_a_foot_that_gets_stuck_each_time_ends_the_session(tmp_path, monkeypatch):
    monkeypatch.setattr("analysis.stance.sequence._LONGEST_STEP", 0.2)
    done = traction(
        *("stance", "TF", "--fake", "--fast", "--operator-script", "auto"),
        *("--policy", "none", "--stances", 1, "--trials", 1, "--data", tmp_path),
    )

    assert done.code == 1
    assert "The foot got stuck in 5 recordings in a row." in done.err
    assert "ARM: idle" in done.out + done.err
    rejected = [path.name for path in tmp_path.glob("sessions/*/rejected/*.mcap")]
    assert {f"T01{letter}.mcap" for letter in "abcde"} <= set(rejected)


@pytest.mark.slow
@pytest.mark.timeout(600)
def test_a_session_of_stances_from_tare_to_page(tmp_path):
    asked = ("--policy", "constant-mu", "--stances", 3, "--trials", 1)
    done = traction(
        *("stance", "TF", "--fake", "--fast", "--operator-script", "auto"),
        *(*asked, "--data", tmp_path),
    )
    assert done.code == 0, done.err
    (session,) = list_sessions(tmp_path)
    sidecar = json.loads((session.trials / "T01.json").read_text())
    assert [one["is_success"] for one in sidecar["stances"]] == [True] * 3
    assert sidecar["stop_reason"] == "stances"

    contents = load_trial(session.trials / "T01.mcap")
    limits = load_settings(None).rig.limits
    torques = np.abs(contents.cycles["torque_command"])
    assert (torques <= np.array(limits.torque)).all()
    speeds = np.linalg.norm(contents.cycles["foot_velocity"][:, :3], axis=1)
    assert speeds.max() < limits.foot_speed
    assert contents.metadata["trial"]["stance_policy"] == "constant-mu"

    page = traction("report", session.id, "--data", tmp_path)
    assert page.code == 0, page.err
    html = (session.path / "report" / "index.html").read_text()
    assert "constant-mu, 6 N" in html
    assert "SIMULATED" in html
    study = traction("report", "--all", "--data", tmp_path)
    assert "no kept trials" in study.err

    again = traction(
        *("redo", session.id, 1, "--reason", "other", "--fake", "--fast"),
        *("--operator-script", "auto", "--data", tmp_path),
    )
    assert again.code == 0, again.err
    sidecar = json.loads((session.trials / "T01.json").read_text())
    assert len(sidecar["stances"]) == 3
    assert sidecar["attempt"] == 2
