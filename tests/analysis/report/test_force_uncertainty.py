"""The uncertainty estimated from tares agrees with uncertainty errors of forces."""

from types import SimpleNamespace

import numpy as np
import pytest

from analysis.data.tare_bracket import TareBracket
from analysis.report.force_uncertainty import (
    ForceUncertainty,
    tare_changes,
    uncertainties_of,
)

STEP, EVERY = 0.1, 250  # s; steps from one tare to the next
TARE, FIRST, LAST = 10, 40, 190  # steps: length of a tare, start and end of a trial


def paths(step):
    """Return 600 sessions of a zero [N] over eleven tares, shape (600, n)."""
    rng = np.random.default_rng(4)
    return step(rng.standard_normal((600, 11 * EVERY)))


def random_drift(time):
    keep = np.exp(-STEP / time)

    def walk(noise):
        values = np.empty_like(noise)
        values[:, 0] = noise[:, 0]
        for k in range(1, noise.shape[1]):
            values[:, k] = keep * values[:, k - 1] + np.sqrt(1 - keep**2) * noise[:, k]
        return 0.22 * values

    return walk


def random_walk(noise):
    """Return a zero that drifts as a random walk."""
    return 0.02 * np.cumsum(noise, axis=1)


def errors(zero):
    """Return the rms errors of samples and trial means with either zero [N]."""
    trials = zero.reshape(len(zero), 11, EVERY)
    tares = trials[:, :, :TARE].mean(axis=2)
    inside = trials[:, :-1, FIRST:LAST]
    share = (np.arange(FIRST, LAST) - TARE / 2) / EVERY
    first, change = tares[:, :-1, None], np.diff(tares, axis=1)[:, :, None]
    rms_errors = {}
    for name, error in (
        ("", inside - first),
        ("interpolated_", inside - first - share * change),
    ):
        rms_errors[f"{name}sample"] = np.sqrt(np.mean(error**2))
        rms_errors[f"{name}mean"] = np.sqrt(np.mean(error.mean(axis=2) ** 2))
    return rms_errors, ForceUncertainty(10, float(np.sqrt(np.mean(change**2))))


KINDS = ("sample", "mean", "interpolated_sample", "interpolated_mean")


@pytest.mark.parametrize("kind", KINDS)
def test_tares_predict_the_error_of_a_fast_wandering_zero(kind):
    rms_errors, predicted = errors(paths(random_drift(3.0)))
    assert getattr(predicted, kind) == pytest.approx(rms_errors[kind], rel=0.12)


@pytest.mark.parametrize("kind", KINDS)
def test_a_slowly_wandering_zero_is_never_underestimated(kind):
    rms_errors, predicted = errors(paths(random_walk))
    assert rms_errors[kind] < getattr(predicted, kind)


@pytest.mark.parametrize("kind", KINDS)
def test_a_steady_wander_is_overestimated_at_most_twofold(kind):
    rms_errors, predicted = errors(paths(random_walk))
    assert getattr(predicted, kind) < 2.0 * rms_errors[kind]


def trial(bias, change=None, session="S001"):
    """Return a stub of a trial with its tares only."""
    bracket = None
    if change is not None:
        biases = np.stack([np.full(6, bias), np.full(6, bias + change)])
        bracket = TareBracket((-2.0, 20.0), biases)
    return SimpleNamespace(
        payload=SimpleNamespace(bias=np.full(6, bias)),
        bracket=bracket,
        metadata={"trial": {"session": session}},
        path=SimpleNamespace(parent=SimpleNamespace(parent=SimpleNamespace(name="a"))),
    )


def test_the_next_tare_counts_even_across_a_rejected_trial():
    changes = tare_changes([trial(0.1, change=0.3), trial(0.9)])
    assert changes[0] == pytest.approx(np.full(3, 0.3))
    assert changes[1] is None


def test_without_brackets_the_tares_of_the_next_trials_are_used():
    trials = [trial(0.1), trial(0.4), trial(5.0, session="S002")]
    assert tare_changes(trials)[0] == pytest.approx(np.full(3, 0.3))
    (name,) = uncertainties_of(trials)
    assert name.endswith("S001")
    assert uncertainties_of(trials)[name].change == pytest.approx(0.3)


def test_the_uncertainty_floor_combines_tare_change_and_noise():
    uncertainty = ForceUncertainty(10, 0.3)
    assert uncertainty.floor(0.0) == pytest.approx(0.3 * np.sqrt(2 / np.pi))
    assert uncertainty.floor(0.4) == pytest.approx(0.5 * np.sqrt(2 / np.pi))
