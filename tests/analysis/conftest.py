"""Recorded slices and data shared by the tests of the analysis."""

import json
from pathlib import Path

import numpy as np
import pytest

from analysis.data.series import TractionSeries
from analysis.study.models import FitOptions
from analysis.study.study import StudyOptions, run_study
from analysis.tables.loading import load_tables

DATA = Path(__file__).parent.parent / "data"
SMALL_FIT = FitOptions(gp_points=60, draws=20)


@pytest.fixture(scope="session", autouse=True)
def _one_thread():
    """Keep linear algebra to one thread: more of them lose time on small matrices."""
    from threadpoolctl import threadpool_limits

    with threadpool_limits(1):
        yield


@pytest.fixture(scope="session")
def vectors():
    return json.loads((DATA / "gp_vectors.json").read_text())


@pytest.fixture(scope="session")
def slice_path():
    return DATA / "rehearsal_slice.npz"


@pytest.fixture(scope="session")
def slice_trials(slice_path):
    return load_tables([slice_path])


@pytest.fixture(scope="session")
def small_study(slice_trials):
    # 60 points instead of 300: all five models in a few seconds
    options = StudyOptions(fit=SMALL_FIT, n_jobs=1)
    return run_study(slice_trials, options, simulated=True, with_break_away=True)


@pytest.fixture(scope="session")
def make_series():
    """Make a trial from a velocity; forces follow a known law with a little noise."""

    def make(v_t, *, terrain="S0", name="made", F_n=None, seed=0):
        v_t = np.asarray(v_t, dtype=float)
        rng = np.random.default_rng(seed)
        t = 0.002 * np.arange(v_t.size)
        if F_n is None:
            F_n = 4.0 + 1.5 * np.sin(1.7 * t + seed)
        F_t = 0.6 * F_n + 3.0 * np.exp(-np.abs(v_t) / 0.03) + rng.normal(0, 0.1, t.size)
        return TractionSeries(terrain, name, t, v_t, F_n, F_t)

    return make


@pytest.fixture(scope="session")
def moving():
    """Return a velocity that wanders through the window, 0.01 to 0.15 m/s."""
    return 0.08 + 0.07 * np.sin(np.arange(3000) * 0.004)
