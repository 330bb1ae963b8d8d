"""The keys between two trials and at the review, and the page at the end."""

import json

import numpy as np
import pytest

from acquisition.devices import SafetyMode
from analysis.data.load import load_trial
from analysis.data.quality import CoverageGrid, thinnest
from experiments.operator.prompts import Prompt, PromptState
from experiments.operator.scripted import ScriptedOperator
from experiments.run.quality import cells_of
from experiments.session.reducer import replay
from tests.experiments.program import (
    journal,
    only_session,
    run_watched,
    sidecar,
    traction,
)

pytestmark = [pytest.mark.slow, pytest.mark.timeout(300)]

SCRIPT = """\
note   dry stones # said before the first trial
pause
redo 2
remark hand slipped
keep
view
last
keep
"""


def quick(asked):
    """Key that ends a recording soon; None leaves the prompt to the script."""
    if asked.prompt is Prompt.RECORDING:
        return " " if asked.since > 0.5 else ""
    return None


@pytest.fixture(scope="module")
def scripted(tmp_path_factory, config):
    """A session of three trials that its script ends after the second."""
    folder = tmp_path_factory.mktemp("scripted")
    script = folder / "script.txt"
    script.write_text(SCRIPT)
    more = ("--operator-script", script)
    return run_watched(
        config, folder / "data", 3, *more, press=lambda asked, _: quick(asked)
    )


def test_a_script_ends_a_session_after_the_last_trial(scripted):
    assert (scripted.done.code, scripted.done.err) == (5, "")
    state = replay(journal(scripted.folder))
    assert (state.phase, state.kept, state.rejected) == ("unfinished", (1, 2), 1)


def test_a_note_on_the_session_is_in_the_journal_only(scripted):
    (note,) = [
        e
        for e in journal(scripted.folder)
        if e["event"] == "noted" and "trial" not in e
    ]
    assert (note["text"], note["who"]) == ("dry stones", "script")
    assert "Noted on S001: dry stones" in scripted.done.out


def test_a_note_at_the_review_stays_with_the_trial_through_its_verdict(scripted):
    (note,) = sidecar(scripted.folder / "trials" / "T01.mcap")["notes"]
    assert note["text"] == "hand slipped"
    noted = [e for e in journal(scripted.folder) if e["event"] == "noted"]
    assert [e.get("attempt") for e in noted] == [None, 2]
    assert note["when"] == noted[1]["utc"]


def test_a_pause_is_recorded_and_ends(scripted):
    names = [event["event"] for event in journal(scripted.folder)]
    assert names[names.index("paused") + 1] == "continued"
    assert "Paused. ARM: holding. [space] to go on." in scripted.done.out


def test_the_last_review_is_shown_again(scripted):
    lines = scripted.done.out.splitlines()
    first = [line for line in lines if line.startswith("T01 complete")]
    assert len(first) == 3  # the rejected attempt, the kept one, and the kept one again
    assert first[1] == first[2]
    last = len(lines) - 1 - lines[::-1].index(first[2])
    assert lines[last + 1].startswith(" ✔ timing worst gap")
    assert lines[last + 6].startswith(" ▲ lag of the force unknown")  # a plate


RESET = "Reset (its digit ticks a step):  1 ☐ wipe  2 ☐ foot at the far end"


def test_the_screen_between_trials_shows_keys_progress_and_time(scripted):
    lines = scripted.done.out.splitlines()
    heads = [line for line in lines if "ARM: floating" in line]
    assert heads[0].endswith("S001 TF · trial 1 of 3 · kept 0 · rejected 0")
    clocks = [line for line in lines if line.startswith("Elapsed ")]
    assert "left about" not in clocks[0]
    assert heads[-1].endswith("S001 TF · trial 2 of 3 · kept 1 · rejected 1")
    assert clocks[-1].endswith(" · left about 1 min")
    assert RESET in lines
    assert "[space] record  [n]ote  [v]iew last  [p]ause  [q]uit after this" in lines


def test_the_last_trial_is_announced(scripted):
    text = "T02 will be the last one for now. [q] again: quit at once."
    assert text in scripted.done.out.splitlines()


# --- thin cells ---------------------------------------------------------------------


def test_the_thinnest_cell_of_the_kept_trials_is_shown(recorded):
    lines = recorded.done.out.splitlines()
    first = lines.index(RESET)
    (line,) = [line for line in lines if line.startswith("Thin so far: ")]
    assert lines.index(line) > first + 2  # not before there is a kept trial
    kept = sidecar(recorded.folder / "trials" / "T01.mcap")["coverage"]
    assert line == f"Thin so far: {thinnest(CoverageGrid(np.array(kept)))}"


def test_the_coverage_of_a_trial_is_in_its_sidecar(recorded):
    for name in ("T01", "T02"):
        counts = np.array(
            sidecar(recorded.folder / "trials" / f"{name}.mcap")["coverage"]
        )
        assert counts.shape == (4, 4)
        assert counts.sum() > 200


@pytest.mark.parametrize(
    "damage", [None, "x", [[1, 2]], [[-1] * 4] * 4, [[1e30] * 4] * 4, [[[1]] * 4] * 4]
)
def test_a_damaged_coverage_is_not_counted(damage):
    assert not cells_of(damage).any()
    assert cells_of([[1] * 4] * 4).sum() == 16


# --- the end ------------------------------------------------------------------------


def test_the_drift_of_the_force_is_printed_at_the_end(recorded):
    tares = [e["bias"] for e in journal(recorded.folder) if e["event"] == "tared"]
    assert len(tares) == 3  # one before each trial, one at the end
    drift = json.loads((recorded.folder / "session.json").read_text())["force_drift"]
    assert drift == pytest.approx(np.subtract(tares[-1], tares[0])[:3], abs=6e-4)
    # Two tares of a sensor that drifts by 0.24 N: 0.34 N rms between them.
    assert 0.0 < np.abs(drift).max() < 1.4
    (line,) = [x for x in recorded.done.out.splitlines() if "drifted" in x]
    assert line.endswith("fx {:+.2f}  fy {:+.2f}  fz {:+.2f}".format(*drift))


def test_every_trial_has_the_tares_before_and_after_it(recorded):
    tares = [e["bias"] for e in journal(recorded.folder) if e["event"] == "tared"]
    for k, name in enumerate(("T01", "T02")):
        trial = load_trial(recorded.folder / "trials" / f"{name}.mcap")
        # The journal has four digits.
        assert trial.bracket.biases == pytest.approx(
            np.array(tares[k : k + 2]), abs=1e-4
        )
        before, after = trial.bracket.times
        assert before < 0.0
        assert trial.t[-1] < after < 60.0


def test_the_interpolated_zero_approaches_the_second_tare(recorded):
    trial = load_trial(recorded.folder / "trials" / "T01.mcap")
    moved = trial.with_interpolated_tare().force - trial.force
    assert np.linalg.norm(moved[-1]) > np.linalg.norm(moved[0]) > 0.0


def test_the_end_compares_the_time_taken_with_the_estimate(recorded):
    (line,) = [x for x in recorded.done.out.splitlines() if x.startswith("Took ")]
    took, estimated = (
        int(text.split(":")[0]) * 60 + int(text.split(":")[1])
        for text in (line.split()[1], line.split()[-1])
    )
    # Two equal trials; the end has a tare more, the first trial the activation.
    assert estimated == pytest.approx(took, abs=6)


def test_the_end_names_report_and_next_terrains(recorded):
    *_, report, terrains = recorded.done.out.splitlines()
    assert report == f"It writes {recorded.folder / 'report' / 'index.html'}"
    names = terrains.removeprefix("Suggested order, randomised against drift: ")
    assert sorted(names.split()) == ["B0", "B10", "B15", "S0", "S10", "S15", "Tf"]


# --- scripts ------------------------------------------------------------------------


def asked(prompt, since=3.0):
    return PromptState(prompt, 1, 1, is_complete=True, since=since)


def keys_of(folder, text):
    path = folder / "script.txt"
    path.write_text(text)
    return ScriptedOperator(path)


def test_script_lines_wait_for_their_own_prompt(tmp_path):
    keys = keys_of(tmp_path, "keep\nnote two words\nredo 3\n")
    assert keys.answer(asked(Prompt.READY)) == " "
    assert keys.answer(asked(Prompt.RECORDING)) == ""
    assert keys.answer(asked(Prompt.REVIEW)) == "k"
    assert keys.answer(asked(Prompt.READY, since=0.1)) == ""
    assert keys.answer(asked(Prompt.READY)) == "n"
    assert keys.line(asked(Prompt.NOTE)) == "two words"
    assert keys.answer(asked(Prompt.READY)) == " "
    assert keys.answer(asked(Prompt.REVIEW)) == "r3"
    assert keys.answer(asked(Prompt.REVIEW)) == "k"


@pytest.mark.parametrize("line", ["note", "remark", "pause now", "redo", "redo 1 2"])
def test_a_script_line_with_missing_or_extra_text_is_refused(tmp_path, config, line):
    script = tmp_path / "script.txt"
    script.write_text(line)
    options = ("--fake", "--fast", "--config", config, "--data", tmp_path / "data")
    done = traction("run", "TF", "--operator-script", script, *options)
    assert done.code == 2
    assert f"line 1: {line!r} - expected keep, redo 1..5 or quit" in done.err


ENDS = {
    # fault: exit code, phase of the session afterwards, mode of the arm
    "loop-late": (0, "complete", SafetyMode.IDLE),
    "estop": (4, "unfinished", SafetyMode.E_STOP),
}


@pytest.mark.parametrize("fault", ENDS)
def test_a_pause_continues_only_after_a_recoverable_fault(config, tmp_path, fault):
    struck, phases = [], []

    def press(asked, rig):
        if asked.prompt is Prompt.READY:
            return " " if struck else "p"
        if asked.prompt is Prompt.PAUSED and not struck:
            struck.append(True)
            rig.faults()[fault]()
            return ""
        if asked.prompt is Prompt.PAUSED:
            phases.append(replay(journal(only_session(tmp_path))).phase)
            return " " if len(phases) > 20 else ""
        if asked.prompt is Prompt.REVIEW:
            return "k"
        return quick(asked)

    seen = run_watched(config, tmp_path, 1, press=press)
    state = replay(journal(seen.folder))
    assert (seen.done.code, state.phase, seen.rig.network.safety_mode) == ENDS[fault]
    assert (set(phases) == {"paused"}) is (seen.done.code == 0)
    assert seen.done.out.count("Paused. ARM: holding.") == 2 - bool(seen.done.code)
