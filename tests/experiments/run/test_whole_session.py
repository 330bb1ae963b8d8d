"""Status, journal and files agree after redos, a pause, notes, a fault and a kill."""

import json
import os

import pytest

from acquisition.errors import TrialFileError
from experiments.operator.auto_operator import AutoOperator
from experiments.operator.prompts import Prompt
from experiments.session.reducer import replay
from tests.experiments.program import (
    digest,
    journal,
    kept_and_sound,
    only_session,
    run_short,
    sidecar,
    traction,
)

pytestmark = [pytest.mark.slow, pytest.mark.timeout(300)]

FAST = ("--fake", "--fast")


def write_scripts(folder, trials, killed_in):
    """Scripts before and after the kill in trial `killed_in`."""
    before, after = folder / "before.txt", folder / "after.txt"
    keeps = "keep\n" * trials
    before.write_text(f"note raked twice\nredo 2\nkeep\npause\n{keeps}")
    after.write_text(f"redo 4\nremark stone in the tread\nkeep\nview\n{keeps}")
    assert 1 < killed_in <= trials
    return before, after


def in_a_child(*arguments):
    """Run a command in a fork; the signal that ended the fork, or 0."""
    child = os.fork()
    if child == 0:
        try:
            traction(*arguments)
        finally:
            os._exit(1)
    status = os.waitpid(child, 0)[1]
    return os.WTERMSIG(status) if os.WIFSIGNALED(status) else 0


def digests(folder):
    return {path.name: digest(path) for path in (folder / "trials").iterdir()}


def shorten(monkeypatch):
    """End every push by key soon, before the foot has crossed the container."""
    for module in ("auto_operator", "scripted"):
        monkeypatch.setattr(f"experiments.operator.{module}.READY_SECONDS", 0.1)
    usual = AutoOperator.answer

    def answer(self, asked):
        if asked.prompt is Prompt.RECORDING and asked.since > 0.8:
            return " "
        return usual(self, asked)

    monkeypatch.setattr(AutoOperator, "answer", answer)


@pytest.mark.parametrize(
    ("trials", "killed_in"),
    [
        (3, 2),
        pytest.param(10, 6, marks=[pytest.mark.long, pytest.mark.timeout(600)]),
    ],
)
def test_status_journal_and_files_of_an_eventful_session_agree(
    config, tmp_path, monkeypatch, trials, killed_in
):
    if trials < 10:
        shorten(monkeypatch)
    data = tmp_path / "data"
    before, after = write_scripts(tmp_path, trials, killed_in)
    faults = ("--fault", "ft-stale@T1+0.3s", "--fault", f"crash@T{killed_in}+0.5s")
    where = ("--config", config, "--data", data)
    run = ("run", "S10", *FAST, "--trials", trials, "--operator-script", before)
    assert in_a_child(*run, *faults, *where) == 9

    folder = only_session(data)
    safe = digests(folder)
    kept_before = [f"T{n:02d}" for n in range(1, killed_in)]
    assert [n for n in kept_before if f"{n}.mcap" in safe] == kept_before
    done = traction("resume", "--operator-script", after, *where)
    assert (done.code, done.err) == (0, "")

    names = [f"T{n:02d}" for n in range(1, trials + 1)]
    check_journal(folder, names, killed_in)
    check_files(folder, names, killed_in)
    now = digests(folder)
    assert {n: now[n] for n in safe if n[:3] in kept_before} == {
        n: d for n, d in safe.items() if n[:3] in kept_before
    }
    status = json.loads(traction("status", "--json", *where).out)
    (line,) = [row for row in status if row["sessions"]]
    assert (line["terrain"], line["kept"], line["rejected"]) == ("S10", trials, 4)
    assert line["trials"] == [1] * trials + [0] * (10 - trials)


def check_journal(folder, names, killed_in):
    events = journal(folder)
    state = replay(events)
    assert state.phase == "complete"
    assert [f"T{n:02d}" for n in state.kept] == names
    assert state.rejected == 4
    count = [event["event"] for event in events].count
    assert (count("paused"), count("continued"), count("noted")) == (1, 1, 2)
    assert (count("crash-found"), count("session-resumed")) == (1, 1)
    assert count("trial-started") == len(names) + 4
    summary = json.loads((folder / "session.json").read_text())
    assert (summary["kept"], summary["rejected"]) == (names, 4)
    assert summary["phase"] == "complete"
    assert len(summary["force_drift"]) == 3


def check_files(folder, names, killed_in):
    assert kept_and_sound(folder) == names
    killed = f"T{killed_in:02d}"
    reasons = {
        "T01a": "interrupted: ft-stale",
        "T01b": "too fast",
        f"{killed}a": "the session ended without closing",
        f"{killed}b": "sensor",
    }
    rejected = folder / "rejected"
    stated = {p.stem: sidecar(p)["reason"] for p in rejected.glob("T???.json")}
    assert stated == reasons
    for name in reasons:
        path = rejected / f"{name}.mcap"
        assert sidecar(path)["sha256"] == digest(path)
    assert not list((folder / "trials").glob("*.partial"))
    assert (folder / "faults" / "T01a.flight.mcap").exists()
    (note,) = sidecar(folder / "trials" / f"{killed}.mcap")["notes"]
    assert note["text"] == "stone in the tread"


def test_an_unreadable_other_session_does_not_fail_a_complete_one(
    tmp_path, config, monkeypatch
):
    def refuse(*_, **__):
        raise TrialFileError(tmp_path / "S007", "cannot be read (EIO)")

    monkeypatch.setattr("experiments.run.session.next_steps", refuse)
    done = run_short(config, tmp_path)
    assert (done.code, done.err) == (0, "")
    assert "The next terrain is unknown" in done.out
    assert "cannot be read (EIO)" in done.out
