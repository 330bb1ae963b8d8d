"""Verdicts, notes, replay and status of an ended session; init and settings."""

import json
import shutil
import tomllib
from dataclasses import dataclass
from pathlib import Path

import pytest

from acquisition.clock import SystemClock
from analysis.data.load import load_trial
from experiments.session.annotations import parse_trial
from experiments.session.reducer import replay
from tests.experiments.program import (
    digest,
    journal,
    kept_and_sound,
    only_session,
    sidecar,
    traction,
)


@dataclass(frozen=True)
class Copy:
    data: Path
    folder: Path

    def say(self, command, *arguments):
        return traction(command, *arguments, "--data", self.data)


@pytest.fixture
def copied(tmp_path, recorded):
    """A copy of the session of two trials that tests may change."""
    shutil.copytree(recorded.data, tmp_path / "data")
    return Copy(tmp_path / "data", only_session(tmp_path / "data"))


# --- verdict --------------------------------------------------------------------------


def test_a_rejected_trial_moves_with_reason_author_and_history(copied):
    before = digest(copied.folder / "trials" / "T01.mcap")
    done = copied.say(
        "verdict", "S001", "T01", "reject", "foot tilted", "--operator=mk"
    )
    assert (done.code, done.err) == (0, "")
    assert done.out == "rejected/T01a: reject. S001 has 1 of 2 kept.\n"
    path = copied.folder / "rejected" / "T01a.mcap"
    fields = sidecar(path)
    assert digest(path) == before == fields["sha256"]
    assert (fields["verdict"], fields["reason"], fields["who"]) == (
        *("reject", "foot tilted", "mk"),
    )
    assert fields["when"].endswith("Z")
    (old,) = fields["history"]
    assert (old["verdict"], old["who"]) == ("keep", "auto")
    assert kept_and_sound(copied.folder) == ["T02"]
    assert replay(journal(copied.folder)).phase == "unfinished"


def test_a_trial_kept_again_is_the_same_file_with_a_longer_history(copied):
    before = digest(copied.folder / "trials" / "T01.mcap")
    copied.say("verdict", "S001", "T01", "reject", "why")
    done = copied.say("verdict", "S001", "T01a", "keep", "it was fine")
    assert (done.code, done.out.split(".")[0]) == (0, "trials/T01: keep")
    path = copied.folder / "trials" / "T01.mcap"
    assert digest(path) == before
    assert [old["verdict"] for old in sidecar(path)["history"]] == ["keep", "reject"]
    assert list((copied.folder / "rejected").iterdir()) == []
    fields = json.loads((copied.folder / "session.json").read_text())
    assert (fields["phase"], fields["rejected"]) == ("complete", 0)


def test_a_trial_whose_file_has_changed_is_not_kept(copied):
    copied.say("verdict", "S001", "T01", "reject", "why")
    path = copied.folder / "rejected" / "T01a.mcap"
    path.chmod(0o644)
    path.write_bytes(b"something else")
    done = copied.say("verdict", "S001", "T01", "keep", "why not")
    assert done.code == 2
    assert done.err.startswith("T01a.mcap is missing or is not what was recorded.")
    assert kept_and_sound(copied.folder) == ["T02"]


@pytest.mark.parametrize(
    ("trial", "text"),
    [
        ("T09", "There is no T09 in S001. Trials: T01 T02."),
        ("T01b", "There is no T01b in S001. Trials: T01 T02."),
        ("../T01", "'../T01' is not a trial."),
    ],
)
def test_a_verdict_on_an_unknown_trial_is_refused(copied, trial, text):
    done = copied.say("verdict", "S001", trial, "reject", "why")
    assert (done.code, done.err[: len(text)]) == (2, text)
    assert kept_and_sound(copied.folder) == ["T01", "T02"]


@pytest.mark.parametrize(
    ("text", "parsed"),
    [("T04", (4, 0)), ("4", (4, 0)), ("T04b", (4, 2)), ("T04aa", (4, 27))],
)
def test_trial_names_are_parsed_into_number_and_attempt(text, parsed):
    assert parse_trial(text) == parsed


# --- note -----------------------------------------------------------------------------


def test_a_note_on_a_session_goes_into_its_journal(copied):
    done = copied.say("note", "S001", "heater on", "--operator", "mk")
    assert (done.code, done.out) == (0, "Noted on S001.\n")
    entry = journal(copied.folder)[-1]
    assert (entry["event"], entry["text"], entry["who"]) == (
        *("noted", "heater on", "mk"),
    )
    assert replay(journal(copied.folder)).phase == "complete"


def test_a_note_on_a_trial_goes_into_its_sidecar_without_control_characters(copied):
    done = copied.say("note", "S001", "T02", "a stone\n was \x1b[31mwedged")
    assert done.out == "Noted on S001 T02.\n"
    (note,) = sidecar(copied.folder / "trials" / "T02.mcap")["notes"]
    assert note["text"] == "a stone was [31mwedged"  # no control characters
    assert kept_and_sound(copied.folder) == ["T01", "T02"]


@pytest.mark.parametrize("text", ["", "  ", "x" * 2001])
def test_an_empty_or_overlong_note_is_refused(copied, text):
    done = copied.say("note", "S001", text)
    assert done.code == 2
    assert "characters, expected 1 to 2000" in done.err


# --- init -----------------------------------------------------------------------------


def line_in(path, setting, key):
    """Printed line of a setting whose line in `path` begins with `key`."""
    lines = enumerate(path.read_text().splitlines(), 1)
    number = next(number for number, line in lines if line.startswith(key))
    return f"   {setting}   ({path}, line {number})"


def test_settings_are_printed_with_their_source(config):
    lines = traction("check", "--config-only", "--config", config).out.splitlines()
    beside = config.with_name("matrix.toml")
    assert line_in(config, 'can.channel = "can0"', "channel = ") in lines
    assert "   arm.mech_at_home = none   (default, not in rig.toml)" in lines
    assert line_in(beside, 'factors[0].unit = "mm"', "unit = ") in lines
    (cell,) = (line for line in lines if line.startswith("   cell S10:"))
    assert cell.endswith(f"+10 degrees, push 0, 10 trials   ({beside})")
    shipped = traction("check", "--config-only").out
    assert '   can.channel = "can0"   (shipped default, line ' in shipped
    assert tomllib.loads(config.read_text())["can"]["channel"] == "can0"


# --- replay ---------------------------------------------------------------------------


class JumpingClock(SystemClock):
    """Clock that waits by advancing."""

    def __init__(self):
        super().__init__()
        self.now = 0

    def now_ns(self):
        return self.now

    def sleep_until(self, t_ns):
        self.now = max(self.now, t_ns)


def test_a_trial_is_replayed_at_the_requested_speed(recorded, monkeypatch):
    clock = JumpingClock()
    monkeypatch.setattr("acquisition.clock.SystemClock", lambda: clock)
    options = ("--speed", "2", "--data", recorded.data)
    done = traction("replay", "S001", "T01", *options)
    lasted = load_trial(recorded.folder / "trials" / "T01.mcap").t[-1]
    lines = done.out.splitlines()
    assert (done.code, done.err) == (0, "")
    assert clock.now == pytest.approx(lasted / 2 * 1e9, abs=10)
    assert len(lines) == int(lasted) + 2  # one a second from 0 on, and the last
    assert lines[-1].startswith(f"▶ S001/T01  {lasted:5.2f} s  ")


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        (("S001",), "Either a session and a trial are shown, or a bus log."),
        ((), "Either a session and a trial are shown, or a bus log."),
        (("S001", "T07"), "There is no T07 in S001. Trials: T01 T02."),
        (("S001", "T01a"), "There is no T01a in S001. Trials: T01 T02."),
    ],
)
def test_a_replay_without_an_existing_trial_is_refused(recorded, arguments, text):
    done = traction("replay", *arguments, "--data", recorded.data)
    assert (done.code, done.err[: len(text)]) == (2, text)


# --- status ---------------------------------------------------------------------------


def test_status_shows_which_trials_are_kept(recorded, config):
    options = ("--data", recorded.data, "--config", config)
    done = traction("status", "--json", "--where", "kind=simulated", *options)
    (line,) = json.loads(done.out)
    assert (line["terrain"], line["kept"], line["trials"]) == (
        *("TF", 2, [1, 1] + [0] * 8),
    )
    status = traction("status", *options).out
    assert "██········" in status


@pytest.mark.parametrize(
    ("where", "names"),
    [
        ("stones=big", ["B0", "B10", "B15"]),
        ("incline_deg=10,kind=live", ["S10", "B10"]),
        ("operator=auto", ["TF"]),
        ("terrain=TF,stones=big", []),
    ],
)
def test_status_can_be_filtered(recorded, config, where, names):
    options = ("--data", recorded.data, "--config", config)
    done = traction("status", "--json", "--where", where, *options)
    assert [line["terrain"] for line in json.loads(done.out)] == names


@pytest.mark.parametrize("where", ["colour=red", "kind", "kind="])
def test_an_invalid_where_condition_is_refused(where):
    done = traction("status", "--where", where)
    assert done.code == 2
    assert "expected KEY=VALUE, e.g. kind=live" in done.err


def test_status_follow_ends_at_ctrl_c(recorded, config, monkeypatch):
    class InterruptedClock(JumpingClock):
        looks = 0

        def sleep_until(self, t_ns):
            self.looks += 1
            if self.looks == 3:
                raise KeyboardInterrupt

    monkeypatch.setattr("acquisition.clock.SystemClock", InterruptedClock)
    options = ("--data", recorded.data, "--config", config)
    done = traction("status", "--follow", *options)
    assert done.code == 0
    assert done.out.count("terrain") == 1 + done.out.count("Next terrains")
    assert "██········" in done.out
