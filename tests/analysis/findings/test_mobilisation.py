"""Loadings and events of a ground whose making is known."""

import numpy as np
import pytest

from analysis.findings.mobilisation import (
    mobilisation_of,
    mobilised,
    weibull_shape,
)
from analysis.terrains.process_rows import STEP, ProcessTrial

STIFFNESS, SPEED = 1500.0, 0.02  # N/m, m/s


def sawtooth(seed, peaks=12, bend=0.0):
    """Return loadings of one stiffness that give way at drawn forces."""
    rng = np.random.default_rng(seed)
    force, v_t = [], []
    for _ in range(peaks):
        top = 6.0 + rng.normal(0.0, 0.8)
        rise = np.arange(0.5, top, STIFFNESS * SPEED * STEP)
        share = (rise - 0.5) / (top - 0.5)
        if bend:
            share = (1.0 - np.exp(-bend * share)) / (1.0 - np.exp(-bend))
        force += [*(0.5 + (top - 0.5) * share), 0.4]
        v_t += [SPEED] * rise.size + [0.3]
    return ProcessTrial(np.full(len(force), 4.0), np.array(v_t), np.array(force))


def test_stiffness_run_out_and_drops_are_those_that_were_made():
    found = mobilisation_of([sawtooth(k) for k in range(8)], 1.5)
    assert found is not None
    values = found.values
    assert values["initial stiffness"].value == pytest.approx(STIFFNESS, rel=0.06)
    assert values["mobilisation way"].value == pytest.approx(6.0 / STIFFNESS, rel=0.1)
    assert values["drop"].value == pytest.approx(5.6, rel=0.08)
    assert values["capacity over load"].value == pytest.approx(1.5, rel=0.05)
    for interval in values.values():
        assert interval.lower < interval.value < interval.upper


def test_straight_loadings_have_no_exponential():
    straight, bent = (
        mobilisation_of([sawtooth(k, bend=b) for k in range(4)], 1.5)
        for b in (0.0, 6.0)
    )
    assert straight is not None
    assert bent is not None
    assert not straight.has_exponential
    assert bent.has_exponential


def test_an_interval_holds_the_value_of_other_trials():
    first = mobilisation_of([sawtooth(k) for k in range(10)], 1.5)
    assert first is not None
    held = []
    for seed in range(1, 15):
        other = mobilisation_of([sawtooth(100 * seed + k) for k in range(10)], 1.5)
        assert other is not None
        drop = first.values["drop"]
        held.append(drop.lower <= other.values["drop"].value <= drop.upper)
    assert np.mean(held) >= 0.7


def test_two_trials_have_no_intervals():
    assert mobilisation_of([sawtooth(1), sawtooth(2)], 1.5) is None


def test_a_trial_without_an_event_says_nothing():
    calm = ProcessTrial(np.full(200, 4.0), np.full(200, 0.02), np.full(200, 3.0))
    assert mobilised(calm, 1.5).drops.size == 0
    assert mobilisation_of([calm] * 5, 1.5) is None


@pytest.mark.parametrize("shape", [0.8, 1.8, 4.0])
def test_the_shape_of_a_weibull_distribution_is_recovered(shape):
    values = np.random.default_rng(0).weibull(shape, 5000)
    assert weibull_shape(values) == pytest.approx(shape, rel=0.05)
