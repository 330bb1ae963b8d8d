from dataclasses import replace

import numpy as np
import pytest

from acquisition.sample import Flag
from acquisition.trial_file.reader import TrialReader
from analysis.data.lag import ForceLag
from analysis.data.plausibility import Doubt
from experiments.operator.console import BAD, GOOD, WARNING
from experiments.run.quality import review_trial, thinnest_cell
from experiments.session.store import create_session
from tests.disturbances.rewriting import rewrite


@pytest.fixture
def cycles(first_trial):
    return TrialReader(first_trial).cycles().data.copy()


def test_a_good_trial_is_reviewed_with_its_numbers(first_trial):
    review = review_trial(first_trial)
    assert review.worst_gap == pytest.approx(0.002, abs=1e-6)
    assert review.missed == 0
    assert review.joint7 < 0.020
    assert review.ratio == pytest.approx(0.8, abs=0.25)  # rubber on a plate
    assert [mark for mark, _ in review.lines()][:5] == [GOOD] * 5


def test_missing_cycles_are_counted_and_marked(first_trial, cycles, tmp_path):
    holes = np.delete(cycles, [700, 701, 1200])
    review = review_trial(rewrite(first_trial, tmp_path / "T.mcap", holes))
    assert review.missed == 3
    assert review.worst_gap == pytest.approx(0.006, abs=1e-6)
    assert review.lines()[0][0] == WARNING


def test_a_foot_that_turned_is_marked(first_trial, cycles, tmp_path):
    cycles["position"][1000:, 6] += 0.03
    review = review_trial(rewrite(first_trial, tmp_path / "T.mcap", cycles))
    assert review.joint7 == pytest.approx(0.03, abs=0.005)
    assert review.lines()[2][0] == WARNING


def test_a_trial_of_a_foot_at_rest_can_be_reviewed(first_trial, cycles, tmp_path):
    """A person may press [space] at once."""
    path = rewrite(first_trial, tmp_path / "T.mcap", cycles[:300])
    review = review_trial(path)
    assert review.kept < 250
    assert review.lines()[3][0] == WARNING


def test_a_trial_in_the_air_has_no_friction(first_trial, cycles, tmp_path):
    cycles["wrench_raw"][:] = cycles["wrench_raw"][:1]
    review = review_trial(rewrite(first_trial, tmp_path / "T.mcap", cycles[:1000]))
    assert np.isnan(review.ratio)
    assert review.lines()[4] == (WARNING, "quick fit impossible: no load")


@pytest.mark.parametrize(
    ("flag", "is_set", "words"),
    [
        (Flag.FT_SATURATED, True, "sensor saturated in 5.0% of the cycles"),
        (Flag.FT_FRESH, False, "sensor stale in 5.0% of the cycles"),
    ],
)
def test_a_saturated_or_stale_sensor_is_marked(
    first_trial, cycles, tmp_path, flag, is_set, words
):
    few = cycles[:1000]
    flags = few["flags"][:50]
    few["flags"][:50] = flags | flag if is_set else flags & ~np.uint32(flag)
    review = review_trial(rewrite(first_trial, tmp_path / "T.mcap", few))
    assert review.lines()[1] == (WARNING, words)


AXES = ("Fx", "Fy", "Fz", "Tx", "Ty", "Tz")


@pytest.mark.parametrize("axis", range(6))
def test_a_frozen_channel_is_reported_and_the_sensor_is_marked_unreliable(
    first_trial, cycles, tmp_path, axis
):
    """A single frozen channel casts doubt on the whole sensor."""
    raw = cycles["wrench_raw"]
    raw[len(raw) // 3 :, axis] = raw[len(raw) // 3, axis]
    review = review_trial(rewrite(first_trial, tmp_path / "T.mcap", cycles))
    lines = review.lines()
    assert lines[1][0] == WARNING
    assert lines[1][1].startswith(f"sensor unreliable: {AXES[axis]} stands at ")
    assert lines[4][0] in {WARNING, BAD}
    assert any(mark == BAD and AXES[axis] in text for mark, text in lines[6:])


@pytest.mark.parametrize("ratio", [-3.59, -0.01, 0.0, 5.1, np.inf, -np.inf])
def test_an_impossible_quick_fit_is_marked_bad(first_trial, ratio):
    review = replace(review_trial(first_trial), ratio=ratio)
    for earlier in ([], [ratio] * 4, [0.7, 0.8, 0.9]):
        mark, text = review.lines(earlier)[4]
        assert mark == BAD
        assert "cannot be" in text
    assert (review.ratio_or_none is None) == np.isinf(ratio)


def test_impossible_quick_fits_are_left_out_of_the_comparison(first_trial):
    review = review_trial(first_trial)
    impossible = [-3.59, np.inf, np.nan]
    assert "before" not in review.lines([*impossible, 0.8, 0.8])[4][1]
    assert "(3 before: 0.80" in review.lines([*impossible, 0.8, 0.8, 0.8])[4][1]


def test_a_quick_fit_of_doubtful_forces_is_marked_unreliable(first_trial):
    doubt = Doubt("lag", "the force is 500 ms late", "a queue")
    mark, text = replace(review_trial(first_trial), doubts=(doubt,)).lines()[4]
    assert mark == WARNING
    assert text.endswith(", unreliable")


def test_too_few_earlier_trials_are_not_compared(first_trial):
    review = review_trial(first_trial)
    for earlier in ([], [0.1, 0.1]):
        shown, text = review.lines(earlier)[4]
        assert shown == GOOD
        assert "before" not in text


@pytest.mark.parametrize(
    ("off", "mark"),
    [(0.0, GOOD), (0.29, GOOD), (0.31, WARNING), (-0.29, GOOD), (-0.31, WARNING)],
)
def test_the_quick_fit_is_compared_with_earlier_trials(first_trial, off, mark):
    """Three standard deviations, 0.1 each, are the limit."""
    review = review_trial(first_trial)
    middle = review.ratio + off
    shown, text = review.lines([middle - 0.1, middle, middle + 0.1])[4]
    assert shown == mark
    assert text.endswith(f"(3 before: {middle:.2f} ± 0.10)")


def test_the_lag_of_the_force_is_shown(first_trial):
    review = replace(review_trial(first_trial), lag=ForceLag(0.0213, 0.8))
    assert review.lines()[5] == (GOOD, "lag force 21.3 ms late")
    early = replace(review, lag=ForceLag(-0.004, 0.8))
    assert "4.0 ms early" in early.lines()[5][1]


def test_a_doubtful_lag_of_the_force_is_not_ticked(first_trial):
    doubt = Doubt("lag", "the force is 500 ms late", "a queue")
    late = replace(
        review_trial(first_trial), lag=ForceLag(0.5, 0.8), doubts=(doubt,)
    ).lines()
    assert late[5] == (WARNING, "lag force 500.0 ms late")
    assert late[6] == (BAD, doubt.text)


def test_an_unknown_lag_on_a_plate_is_a_warning(first_trial):
    mark, words = review_trial(first_trial).lines()[5]
    assert mark == WARNING
    assert words.startswith("lag of the force unknown")


# --- thin cells ---------------------------------------------------------------------

SPARSE = [[0, 0, 0, 0], [0, 900, 3, 0], [0, 900, 900, 0], [0, 0, 0, 0]]
FULL = [[0, 900, 900, 0], [0, 0, 900, 0], [0, 0, 0, 0], [0, 0, 0, 0]]


def session(data, *coverages, verdict="trial-kept"):
    """Session whose trials have these coverages."""
    folder = create_session(data, "S0", is_simulated=True, utc_ns=0)
    folder.append_event({"event": "session-started", "terrain": "S0", "trials": 9})
    folder.append_event({"event": "activated"})
    for k, coverage in enumerate(coverages, 1):
        recording = {"sha256": "", "coverage": coverage}
        folder.append_event({"event": "trial-started", "trial": k})
        fields = {"event": "trial-recorded", "trial": k, "recording": recording}
        folder.append_event(fields)
        folder.append_event({"event": verdict, "trial": k})
    return folder


def test_the_samples_of_all_kept_trials_are_counted(tmp_path):
    one = session(tmp_path, [[0, 9, 9, 0], *SPARSE[1:]])
    assert thinnest_cell(one) == "slower than 0.05 m/s, above 5 N"
    assert thinnest_cell(session(tmp_path, SPARSE, FULL)) == ""


def test_rejected_and_damaged_trials_are_not_counted(tmp_path):
    assert thinnest_cell(session(tmp_path, SPARSE, verdict="trial-rejected")) == ""
    assert thinnest_cell(session(tmp_path, [[1, 2]], "none", None)) == ""
