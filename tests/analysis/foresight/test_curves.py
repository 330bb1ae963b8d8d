from dataclasses import replace

import numpy as np
import pytest

from analysis.foresight.calibration import calibration_error
from analysis.foresight.curves import SHOWN, foresight_curves
from analysis.foresight.engine import ForesightFlag
from analysis.foresight.held_out import hold_out
from analysis.foresight.scores import score_slips
from analysis.foresight.ticks import ticks_of
from analysis.report.foresight_page import foresight_figure
from tests.analysis.foresight.made import trials


@pytest.fixture(scope="module")
def runs():
    return hold_out(trials(0, 3), {})


@pytest.mark.slow
def test_share_in_alarm_agrees_with_recall_and_falls_with_the_lead(runs):
    curves = foresight_curves(runs)
    assert curves.warned[0] == pytest.approx(score_slips(runs).recall)
    assert curves.warned[10] == pytest.approx(score_slips(runs).early)  # 0.1 s
    assert (np.diff(curves.warned) <= 0.0).all()


def test_reliability_gives_the_calibration_error(runs):
    curves = foresight_curves(runs)
    ticks = [ticks_of(run) for run in runs]
    p = np.concatenate([one.p[one.at_risk] for one in ticks])
    truth = np.concatenate([one.before[one.at_risk] for one in ticks])
    off = np.abs(curves.foreseen - curves.seen).mean()
    assert off == pytest.approx(calibration_error(p, truth), abs=1e-3)
    assert (np.diff(curves.foreseen) >= 0.0).all()


def test_the_excerpt_holds_the_slips_that_stand_closest(runs):
    excerpt = foresight_curves(runs).excerpt
    counts = [
        sum(a - 1.0 <= b <= a - 1.0 + SHOWN for b in one.onsets)
        for one in map(ticks_of, runs)
        for a in one.onsets
    ]
    assert len(excerpt.onsets) == max(counts)
    assert excerpt.onsets.min() >= 0.0
    assert excerpt.onsets.max() <= SHOWN
    assert excerpt.t.shape == excerpt.v_t.shape == excerpt.p.shape


def test_ground_becomes_known_with_the_time_slid(runs):
    for means in foresight_curves(runs).grounds.values():
        known = means[np.isfinite(means)]
        assert known.size
        assert known[-1] > 0.95
        assert ((known >= 0.0) & (known <= 1.0)).all()


def test_ground_is_the_mean_of_at_least_three_trials(runs):
    two = [run for run in runs if run.trial.surface == "rocky"][:2]
    (means,) = foresight_curves(two).grounds.values()
    assert np.isnan(means).all()


def test_trials_without_slips_are_drawn_too(runs):
    calm = [
        replace(run, trial=replace(run.trial, onsets=np.zeros(0), ends=np.zeros(0)))
        for run in runs
    ]
    curves = foresight_curves(calm)
    assert curves.excerpt is None
    assert np.isnan(curves.warned).all()
    assert (curves.seen == 0.0).all()
    figure = foresight_figure(curves, is_simulated=True)
    assert figure.picture.png.startswith(b"\x89PNG")
    assert "alarm" not in figure.caption


def test_trials_of_an_unknown_rig_say_nothing(runs):
    blind = [
        replace(
            run,
            states=tuple(
                state._replace(
                    flags=int(ForesightFlag.OTHER_RIG),
                    slip_probability=np.nan,
                    terrains=(np.nan,) * len(state.terrains),
                )
                for state in run.states
            ),
        )
        for run in runs
    ]
    curves = foresight_curves(blind)
    assert np.isnan(curves.foreseen).all()
    assert all(np.isnan(means).all() for means in curves.grounds.values())
    # what is left is that no slip had an alarm
    assert (curves.warned == 0.0).all()
    calm = [run for run in blind if not run.trial.onsets.size]
    assert calm
    assert foresight_figure(foresight_curves(calm), is_simulated=False) is None


def test_the_figure_states_what_it_shows(runs):
    curves = foresight_curves(runs)
    figure = foresight_figure(curves, is_simulated=True, with_pdf=True)
    assert figure.picture.key == "foresight"
    assert figure.picture.pdf.startswith(b"%PDF")
    assert f"{curves.warned[10]:.0%} of the slips" in figure.caption
