"""Trials sampled along recorded paths resemble held-out recordings."""

import numpy as np
import pytest

import traction as tr
from benchmarks.path_samples import FAR, NEAR, compare_samples, energy_score

BEST_OF_INDEPENDENT = 0.98
NEARLY = 0.1  # of a correlation


def test_the_energy_score_of_one_row_is_the_crps():
    draws = np.random.default_rng(1).standard_normal((4000, 1))
    # of a standard normal at 0: 2 phi(0) - 1 / sqrt(pi)
    expected = 2.0 / np.sqrt(2.0 * np.pi) - 1.0 / np.sqrt(np.pi)
    assert energy_score(draws, np.zeros(1)) == pytest.approx(expected, abs=0.02)


@pytest.mark.shared_data
@pytest.mark.slow
@pytest.mark.timeout(600)
def test_sampled_trials_resemble_held_out_recordings(shared_data):
    tables = tr.load_tables(shared_data / "rehearsal_trials.npz")
    trials = [trial for name in ("S10", "B0", "TF") for trial in tables.on(name)]
    for found in compare_samples(trials):
        assert found.energy_ratio < BEST_OF_INDEPENDENT, found
        for lag, recorded, drawn in zip(
            (NEAR, FAR), found.recorded, found.drawn, strict=True
        ):
            assert drawn == pytest.approx(recorded, abs=NEARLY), (found, lag)
