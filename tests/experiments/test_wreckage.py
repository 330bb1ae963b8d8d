import pytest

from experiments.runner import SessionRunner
from experiments.store import create_session
from experiments.wreckage import find_wreckage, held_open
from tests.acquisition.trials import make_cycles, write_trial
from tests.experiments.program import run_short, traction

START = {"event": "session-started", "utc": "U0", "terrain": "S10", "trials": 10}
END = {"event": "session-ended", "utc": "U9", "reason": "complete"}
KEPT_AND_RUNNING = (
    {"event": "trial-started", "utc": "U1", "trial": 1},
    {"event": "trial-kept", "utc": "U2", "trial": 1},
    {"event": "trial-started", "utc": "U3", "trial": 2},
)


def make_session(data, *events):
    folder = create_session(
        data, "S10", is_simulated=True, utc_ns=1_800_000_000 * 10**9
    )
    for event in events:
        folder.append_event(event)
    return folder


def leave_partial(folder, name="T02"):
    """Leave a `.partial` of 0.4 s as a kill does."""
    writer = write_trial(folder.trials / f"{name}.mcap", make_cycles(201), block=67)
    writer.close_partial()
    return writer.partial


def test_a_session_that_was_not_closed_is_found(tmp_path):
    folder = make_session(tmp_path, START, *KEPT_AND_RUNNING)
    partial = leave_partial(folder)
    (wreck,) = find_wreckage(tmp_path)
    assert (wreck.folder, wreck.kept, wreck.running) == (folder, 1, "T02")
    assert wreck.partials == (partial,)
    assert wreck.seconds == pytest.approx(0.4)
    assert wreck.last_utc == "U3"
    assert wreck.text() == (
        "S001 ended without closing (T02 at 0.4 s). 1 kept. "
        f"To save the rest: traction recover {partial}"
    )


def test_a_session_that_was_closed_is_none(tmp_path):
    make_session(tmp_path, START, *KEPT_AND_RUNNING, END)
    assert find_wreckage(tmp_path) == []


def test_a_folder_in_which_nothing_happened_is_none(tmp_path):
    make_session(tmp_path)
    assert find_wreckage(tmp_path / "nowhere") == find_wreckage(tmp_path) == []


def test_a_session_of_a_living_process_is_none(tmp_path):
    folder = make_session(tmp_path, START)
    with held_open(folder):
        assert find_wreckage(tmp_path) == []
    assert len(find_wreckage(tmp_path)) == 1


def test_a_trial_without_verdict_is_told_apart(tmp_path):
    make_session(tmp_path, START, *KEPT_AND_RUNNING)
    (wreck,) = find_wreckage(tmp_path)
    assert wreck.text() == (
        "S001 ended without closing (T02 before its verdict). 1 kept."
    )


def test_a_session_left_between_trials_is_told_apart(tmp_path):
    make_session(tmp_path, START, *KEPT_AND_RUNNING[:2])
    (wreck,) = find_wreckage(tmp_path)
    assert wreck.text() == "S001 ended without closing (between trials). 1 kept."


def test_several_files_are_named_by_their_session(tmp_path):
    data = tmp_path / "my data"
    folder = make_session(data, START, *KEPT_AND_RUNNING)
    leave_partial(folder)
    leave_partial(folder, "T01.truth")
    (wreck,) = find_wreckage(data)
    assert wreck.text().endswith(f"traction recover '{folder.path}'")


def test_what_was_recovered_is_not_asked_for_again(tmp_path):
    folder = make_session(tmp_path, START, *KEPT_AND_RUNNING)
    traction("recover", leave_partial(folder))
    (wreck,) = find_wreckage(tmp_path)
    assert wreck.partials == ()
    assert "recover" not in wreck.text()


def test_a_damaged_journal_or_partial_stops_nothing(tmp_path):
    folder = make_session(tmp_path, START, *KEPT_AND_RUNNING)
    (folder.trials / "T02.mcap.partial").write_bytes(b"nothing")
    with (folder.path / "events.jsonl").open("ab") as journal:
        journal.write(b'{"event": "trial-ke')
    (wreck,) = find_wreckage(tmp_path)
    assert (wreck.running, wreck.seconds) == ("T02", 0.0)


def test_a_folder_that_cannot_be_read_is_left_out(tmp_path):
    folder = make_session(tmp_path)
    (folder.path / "events.jsonl").mkdir()
    make_session(tmp_path, START)
    assert [wreck.folder.id for wreck in find_wreckage(tmp_path)] == ["S002"]


def test_a_run_tells_of_a_wreck_and_is_none_while_it_lasts(
    tmp_path, config, monkeypatch
):
    make_session(tmp_path, START)
    seen = []

    def run(runner, trials):
        runner.book.note("session-started", terrain="TF", trials=trials)
        seen.extend(wreck.folder.id for wreck in find_wreckage(tmp_path))
        return 5

    monkeypatch.setattr(SessionRunner, "run", run)
    done = run_short(config, tmp_path)
    assert done.code == 5
    assert "▲ S001 ended without closing (between trials). 0 kept." in done.out
    assert seen == ["S001"]
    assert [wreck.folder.id for wreck in find_wreckage(tmp_path)] == ["S001", "S002"]
