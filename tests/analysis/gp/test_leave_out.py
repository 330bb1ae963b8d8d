import numpy as np
import pytest

from analysis.gp.arcsine import Arcsine
from analysis.gp.kernels import SquaredExponential
from analysis.gp.noise import ConstantNoise, LogLinearNoise
from analysis.gp.regression import LeaveOut, fit_gp
from analysis.gp.trial_noise import TrialNoise, TrialRows


@pytest.mark.parametrize("kernel", [SquaredExponential(), Arcsine()])
@pytest.mark.parametrize("within", [ConstantNoise(), LogLinearNoise()])
def test_leaving_rows_out_equals_fitting_without_them(kernel, within):
    rng = np.random.default_rng(0)
    X, trial = rng.uniform(0.5, 5.0, (60, 2)), np.repeat(np.arange(4), 15)
    y = np.sin(X[:, 0]) + rng.normal(size=4)[trial] + rng.normal(0.0, 0.2, 60)
    trials = TrialRows(trial)
    process = fit_gp(X, y, kernel, TrialNoise(within), trials=trials)
    new, leave_out = rng.uniform(0.5, 5.0, (30, 2)), LeaveOut(process)
    for k, rows in enumerate(trials.blocks()):
        kept = trial != k
        others = TrialRows(trial[kept])
        mean, variance = process.given(X[kept], y[kept], others).predict(new)
        prediction = leave_out.predict(rows, new)
        np.testing.assert_allclose(prediction[0], mean, atol=1e-9)
        np.testing.assert_allclose(prediction[1], variance, rtol=1e-8)
