"""A killed session is resumed, and a trial redone, without losing a recording."""

import json
import shutil
from dataclasses import asdict, dataclass
from pathlib import Path
from types import SimpleNamespace

import pytest

from acquisition.trial_file.verify import verify_file
from experiments.arguments import FRICTION
from experiments.operator.prompts import Prompt
from experiments.rig.rig import FakeOptions
from experiments.run.resume import fake_of
from experiments.session.reducer import replay
from tests.experiments.program import (
    Done,
    digest,
    journal,
    kept_and_sound,
    kill_this_process,
    only_session,
    run_killed,
    sidecar,
    traction,
)

pytestmark = pytest.mark.slow

AUTO = ("--operator-script", "auto")


@dataclass(frozen=True)
class Reopened:
    """A session before and after it was reopened."""

    done: Done
    folder: Path
    before: dict[str, str]


def digests(folder):
    paths = (folder / "trials").glob("*.mcap")
    return {path.name: digest(path) for path in paths}


def short(asked):
    """Key that ends a recording at once or keeps it; None leaves it to AutoOperator."""
    if asked.prompt is Prompt.RECORDING:
        return " " if asked.since > 0.3 else ""
    return "k" if asked.prompt is Prompt.REVIEW else None


@pytest.fixture(scope="module")
def resumed(tmp_path_factory, config):
    """A session of two trials, killed in the second one and resumed."""
    data = tmp_path_factory.mktemp("killed")

    def press(asked, rig):
        is_second = asked.prompt is Prompt.RECORDING and asked.trial == 2
        if is_second and asked.since > 1.0:
            kill_this_process()
        return short(asked) if asked.trial == 1 else None

    folder = run_killed(config, data, 2, press=press)
    before = digests(folder)
    done = traction("resume", *AUTO, "--data", data)
    return Reopened(done, folder, before)


@pytest.fixture(scope="module")
def redone(tmp_path_factory, recorded):
    """A copy of the session of two trials with the first one redone."""
    data = tmp_path_factory.mktemp("redone") / "data"
    shutil.copytree(recorded.data, data)
    folder = only_session(data)
    before = digests(folder)
    done = traction(
        *("redo", "S001", "T01", "--reason", "bed was wet", *AUTO, "--data", data)
    )
    return Reopened(done, folder, before)


def test_a_killed_session_is_resumed_and_completed(resumed):
    assert (resumed.done.code, resumed.done.err) == (0, "")
    assert kept_and_sound(resumed.folder) == ["T01", "T02"]
    fields = json.loads((resumed.folder / "session.json").read_text())
    assert (fields["phase"], fields["kept"]) == ("complete", ["T01", "T02"])


def test_a_resumed_session_does_not_report_itself_as_open(resumed):
    assert "is open in process" not in resumed.done.out


def test_a_resume_states_what_happens_to_the_running_trial(resumed):
    first, second, *_ = resumed.done.out.splitlines()
    assert first == (
        "S001 ended without closing. T02 will be redone, its data are in "
        "rejected/T02a.*"
    )
    assert second == "session S001: 1 of 2 kept"


def test_a_kill_leaves_earlier_trials_unchanged(resumed):
    assert set(resumed.before) >= {"T01.mcap"}
    assert digests(resumed.folder)["T01.mcap"] == resumed.before["T01.mcap"]


def test_the_recording_up_to_the_kill_is_in_rejected(resumed):
    path = resumed.folder / "rejected" / "T02a.mcap"
    verified = verify_file(path)
    assert not verified.is_complete
    # a second before the trigger, then until the kill less half a second at most
    assert verified.duration > 1.0 + 1.0 - 0.5
    fields = sidecar(path)
    assert fields["sha256"] == verified.sha256
    assert (fields["verdict"], fields["who"]) == ("reject", "traction")
    assert fields["reason"] == "the session ended without closing"
    assert path.with_suffix(".partial").exists()
    assert not list((resumed.folder / "trials").glob("*.partial"))


def test_the_journal_of_a_resumed_session_has_every_attempt_and_opening(resumed):
    events = journal(resumed.folder)
    state = replay(events)
    assert state.kept_attempts == ((1, 1), (2, 2))
    assert (state.rejected, state.openings) == (1, 2)
    names = [event["event"] for event in events]
    assert names.count("crash-found") == names.count("session-resumed") == 1


def test_every_opening_leaves_its_own_preflight_and_provenance(resumed):
    names = {path.name for path in resumed.folder.iterdir()}
    assert {"preflight.json", "preflight-2.json", "provenance-2.json"} <= names


def test_a_complete_session_is_not_resumed(resumed):
    data = resumed.folder.parent.parent
    done = traction("resume", "S001", *AUTO, "--data", data)
    assert done.code == 2
    assert done.err.startswith("S001 cannot be opened: the session is complete.")


def test_a_redo_records_one_trial_and_sets_the_old_one_aside(redone):
    assert (redone.done.code, redone.done.err) == (0, "")
    after = digests(redone.folder)
    old = redone.folder / "rejected" / "T01a.mcap"
    assert digest(old) == redone.before["T01.mcap"] != after["T01.mcap"]
    assert digest(old.with_suffix(".truth.mcap")) == redone.before["T01.truth.mcap"]
    assert after["T02.mcap"] == redone.before["T02.mcap"]
    assert kept_and_sound(redone.folder) == ["T01", "T02"]


def test_a_redo_keeps_the_history_of_the_old_trial(redone):
    fields = sidecar(redone.folder / "rejected" / "T01a.mcap")
    assert (fields["verdict"], fields["reason"]) == ("reject", "redone")
    assert [entry["verdict"] for entry in fields["history"]] == ["keep"]
    redo = next(e for e in journal(redone.folder) if e["event"] == "redo-started")
    assert (redo["trial"], redo["reason"]) == (1, "bed was wet")


def test_a_redone_session_is_complete_again(redone):
    state = replay(journal(redone.folder))
    assert (state.phase, state.kept_attempts) == ("complete", ((2, 1), (1, 2)))


@pytest.mark.parametrize(
    ("trial", "text"),
    [
        ("T09", "S001 cannot be opened: T09 was never recorded."),
        ("T01a", "T01a is one attempt; a trial is repeated by its number."),
        ("first", "'first' is not a trial."),
    ],
)
def test_a_redo_of_an_unknown_trial_is_refused(recorded, trial, text):
    done = traction("redo", "S001", trial, *AUTO, "--data", recorded.data)
    assert done.code == 2
    assert done.err.startswith(text)


def test_a_redo_under_other_conditions_is_refused_with_the_differences(
    tmp_path, recorded, config
):
    data = tmp_path / "data"
    shutil.copytree(recorded.data, data)
    for name in ("rig.toml", "matrix.toml"):
        text = config.with_name(name).read_text()
        text = text.replace("mass = 0.45 ", "mass = 0.5 ").replace("0.07", "0.08")
        (tmp_path / name).write_text(text)
    options = ("--config", tmp_path / "rig.toml", "--data", data)
    done = traction("redo", "S001", "T01", *AUTO, *options)
    assert done.code == 2
    assert "▲ rig.feet.tread.mass was 0.45, is 0.5" in done.out
    assert "▲ terrain.travel was 0.07, is 0.08" in done.out
    assert done.err.startswith("2 conditions are not as in S001: rig.feet.tread.mass")
    assert digests(only_session(data)) == digests(recorded.folder)


def test_a_redo_despite_a_damaged_sidecar_keeps_the_old_recording(tmp_path, recorded):
    data = tmp_path / "data"
    shutil.copytree(recorded.data, data)
    folder = only_session(data)
    before = digests(folder)
    (folder / "trials" / "T01.json").chmod(0o644)
    (folder / "trials" / "T01.json").write_text("{")
    redo = ("redo", "S001", "T01", "--reason", "bed was wet", *AUTO, "--data", data)
    assert traction(*redo).code == 6
    done = traction(*redo, "--allow-missing")
    assert done.code == 0, done.err
    old = folder / "rejected" / "T01a.mcap"
    assert digest(old) == before["T01.mcap"] != digests(folder)["T01.mcap"]
    assert kept_and_sound(folder) == ["T01", "T02"]


@pytest.mark.parametrize(
    ("fake", "friction"),
    [
        ({"mode": "fast", "seed": 3, "friction": 0.7}, 0.7),
        (asdict(FakeOptions("fast", seed=3)), FRICTION),
    ],
)
def test_a_reopened_simulation_keeps_its_friction_and_seed(fake, friction):
    opened = fake_of({"fake": fake}, SimpleNamespace(mode=None))
    assert (opened.seed, opened.friction, opened.mode) == (3, friction, "fast")


@pytest.mark.parametrize(
    ("fake", "asked", "mode"),
    [
        ({"mode": "paced", "seed": 3}, "fast", "fast"),
        ({"mode": "processes", "seed": 3}, None, "processes"),
        ({"mode": "hurried", "seed": 3}, None, "paced"),
        (None, None, "paced"),
    ],
)
def test_a_reopened_simulation_runs_in_the_recorded_or_requested_mode(
    fake, asked, mode
):
    assert fake_of({"fake": fake}, SimpleNamespace(mode=asked)).mode == mode
