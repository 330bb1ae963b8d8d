import os

import pytest

from experiments.operator.console import Console
from experiments.operator.prompts import Prompt, PromptState
from experiments.operator.terminal import TerminalInput
from experiments.run.resume import ResumeChoice, choose_resume
from experiments.session.lock import session_lock
from experiments.session.store import create_session
from experiments.session.unfinished import find_unfinished
from tests.acquisition.trials import make_cycles, write_trial
from tests.experiments.program import run_short, traction

START = {"event": "session-started", "utc": "U0", "terrain": "S10", "trials": 10}
ACTIVE = {"event": "activated", "utc": "U0"}
LEFT = {"event": "session-ended", "utc": "U9", "reason": "unfinished"}
KEPT_AND_RUNNING = (
    START,
    ACTIVE,
    {"event": "trial-started", "utc": "U1", "trial": 1, "attempt": 1},
    {"event": "trial-recorded", "utc": "U1", "trial": 1, "attempt": 1},
    {"event": "trial-kept", "utc": "U2", "trial": 1, "attempt": 1},
    {"event": "trial-started", "utc": "U3", "trial": 2, "attempt": 1},
)


def make_session(data, *events, terrain="S10"):
    folder = create_session(
        data, terrain, is_simulated=True, utc_ns=1_800_000_000 * 10**9
    )
    for event in events:
        folder.append_event(event)
    return folder


def leave_partial(folder, name="T02"):
    """Leave a `.partial` of 0.4 s, as after a kill."""
    writer = write_trial(folder.trials / f"{name}.mcap", make_cycles(201), block=67)
    writer.close_partial()
    return writer.partial


def test_a_crashed_session_is_found_with_its_running_trial(tmp_path):
    folder = make_session(tmp_path, *KEPT_AND_RUNNING)
    leave_partial(folder)
    (found,) = find_unfinished(tmp_path)
    assert (found.folder, found.state.kept, found.running) == (folder, (1,), "T02")
    assert found.seconds == pytest.approx(0.4)  # 201 cycles of 2 ms
    assert found.is_crashed
    assert found.text() == "S001 ended without closing (T02 at 0.4 s). 1 kept."


def test_a_session_that_is_complete_or_closed_is_not_unfinished(tmp_path):
    one = {**START, "trials": 1}
    make_session(tmp_path, one, *KEPT_AND_RUNNING[1:-1], LEFT)
    make_session(tmp_path, START, ACTIVE, LEFT, {"event": "session-closed"})
    assert find_unfinished(tmp_path) == []


def test_a_session_left_on_purpose_is_unfinished_and_not_crashed(tmp_path):
    make_session(tmp_path, *KEPT_AND_RUNNING[:-1], LEFT)
    (found,) = find_unfinished(tmp_path)
    assert not found.is_crashed
    assert found.text() == "S001 S10 is unfinished, 1 of 10 kept."


def test_a_session_without_events_is_not_unfinished(tmp_path):
    make_session(tmp_path)
    assert find_unfinished(tmp_path / "nowhere") == find_unfinished(tmp_path) == []


def test_a_session_open_in_a_process_is_not_unfinished(tmp_path):
    folder = make_session(tmp_path, START)
    with session_lock(folder):
        assert find_unfinished(tmp_path) == []
    assert len(find_unfinished(tmp_path)) == 1


def test_a_crash_before_a_verdict_is_reported(tmp_path):
    make_session(tmp_path, *KEPT_AND_RUNNING)
    (found,) = find_unfinished(tmp_path)
    assert "(T02 before its verdict)" in found.text()


def test_a_crash_between_trials_is_reported(tmp_path):
    make_session(tmp_path, *KEPT_AND_RUNNING[:-1])
    (found,) = find_unfinished(tmp_path)
    assert "(between trials)" in found.text()


def test_a_crashed_session_with_damaged_journal_and_partial_is_found(tmp_path):
    folder = make_session(tmp_path, *KEPT_AND_RUNNING)
    (folder.trials / "T02.mcap.partial").write_bytes(b"nothing")
    with (folder.path / "events.jsonl").open("ab") as journal:
        journal.write(b'{"event": "trial-ke')
    (found,) = find_unfinished(tmp_path)
    assert (found.running, found.seconds) == ("T02", 0.0)


def test_a_session_with_an_unreadable_journal_is_left_out(tmp_path):
    folder = make_session(tmp_path)
    (folder.path / "events.jsonl").mkdir()
    make_session(tmp_path, START)
    assert [found.folder.id for found in find_unfinished(tmp_path)] == ["S002"]


# --- a new run while a session is unfinished ------------------------------------------


def press(keys, found, terrain):
    """Answer the question with `keys` from a keyboard once it is on the screen."""
    read, write = os.pipe()
    try:
        keyboard = TerminalInput(read)
        keyboard.answer(PromptState(Prompt.CHOICE, 0, 0, False, 0.0))
        os.write(write, keys)
        return choose_resume(found, terrain, "", keyboard, Console())
    finally:
        os.close(read)
        os.close(write)


@pytest.mark.parametrize(
    ("keys", "choice"),
    [
        (b"1", ResumeChoice.RESUME),
        (b"r", ResumeChoice.RESUME),
        (b"2", ResumeChoice.CLOSE),
        (b"x n", ResumeChoice.CLOSE),
    ],
)
def test_a_key_resumes_or_closes_the_unfinished_session(tmp_path, keys, choice):
    make_session(tmp_path, START, ACTIVE, LEFT)
    assert press(keys, find_unfinished(tmp_path), "B0") is choice


def test_both_terrains_and_both_choices_are_reported(tmp_path, capsys):
    make_session(tmp_path, START, ACTIVE, LEFT)
    press(b"1", find_unfinished(tmp_path), "B0")
    assert capsys.readouterr().out == (
        "▲ Session S001 of S10 is unfinished, but you asked for B0. [1] resume S10  "
        "[2] close it and start B0  [q]uit\n"
    )


def test_the_question_after_a_crash_states_what_a_resume_does(tmp_path, capsys):
    leave_partial(make_session(tmp_path, *KEPT_AND_RUNNING))
    press(b"r", find_unfinished(tmp_path), "S10")
    assert capsys.readouterr().out.startswith(
        "▲ S001 ended without closing (T02 at 0.4 s). 1 kept. [r]esume - T02 will be "
        "redone, its data are in rejected/"
    )


def test_without_a_terminal_a_run_is_refused_with_the_command_to_type(tmp_path, config):
    make_session(tmp_path, *KEPT_AND_RUNNING[:-1], LEFT)
    done = run_short(config, tmp_path, "TF")
    assert (done.code, done.out) == (2, "")
    assert done.err == (
        "Session S001 of S10 is unfinished, but you asked for TF. To go on: "
        f"traction resume S001 --data {tmp_path}   To close it: the "
        "same command with --new. Nothing was started.\n"
    )
    assert len(list((tmp_path / "sessions").glob("*_S*"))) == 1


def test_an_unfinished_simulated_session_does_not_block_a_real_one(tmp_path, config):
    make_session(tmp_path, START, ACTIVE, LEFT)
    done = traction("run", "TF", "--config", config, "--data", tmp_path)
    assert "needs a person at a terminal" in done.err  # the only obstacle


def test_resume_without_a_name_lists_several_unfinished_sessions(tmp_path):
    make_session(tmp_path, START, ACTIVE, LEFT)
    make_session(tmp_path, {**START, "terrain": "B0"}, terrain="B0")
    done = traction("resume", "--data", tmp_path)
    assert done.code == 2
    assert done.err == (
        "2 sessions are unfinished: S001 S10 is unfinished, 0 of 10 kept. S002 ended "
        "without closing (between trials). 0 kept. Name one, e.g. traction resume "
        "S002\n"
    )


def test_resume_without_an_unfinished_session_is_refused(tmp_path):
    done = traction("resume", "--data", tmp_path)
    assert done.code == 2
    assert done.err.startswith("There is no unfinished session in")


def test_a_real_session_is_not_resumed_with_a_simulated_arm(tmp_path):
    folder = create_session(tmp_path, "S10", is_simulated=False, utc_ns=10**18)
    for event in (START, ACTIVE, LEFT):
        folder.append_event(event)
    done = traction("resume", "S001", "--fake", "--data", tmp_path)
    assert done.code == 2
    assert done.err.startswith("S001 is a session with the real arm.")
