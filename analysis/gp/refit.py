"""Warm-started fits: similar problems need no full search.

Used for other outputs over the same rows or another noise model.
"""

from dataclasses import replace

import numpy as np

from analysis.data.series import Array
from analysis.gp.likelihood import Likelihood
from analysis.gp.noise import Noise
from analysis.gp.regression import GaussianProcess
from analysis.gp.search import climb_from, distinct_optima

_SIZES = frozenset({"sf", "sn", "sc"})  # in the unit of the outputs
_VANISHED = 2.0  # log units below the usual start at which a spread has no gradient


def refit_gp(
    process: GaussianProcess,
    y: Array,
    noise: Noise | None = None,
) -> GaussianProcess:
    """Refit a process to other outputs or another noise over the same rows.

    For problems so similar that the optima are nearly known: the search climbs from
    the optima of `process`.

    Args:
        process: fitted process to start from.
        y: training outputs, shape (n,).
        noise: by default that of `process`; parameters that `process` lacks start from
            their default.
    """
    noise_model = noise or process.noise
    names = (*process.kernel.names, *process.noise.names)
    initial = noise_model.start(float(np.std(y))).tolist()
    defaults = dict(zip(noise_model.names, initial, strict=True))
    starts = []
    for theta in distinct_optima(process.kernel, process.starts):
        values = defaults | dict(zip(names, theta.tolist(), strict=True))
        for name, value in defaults.items():
            if name.rpartition("_")[2] in _SIZES:
                values[name] = max(values[name], value - _VANISHED)
        order = (*process.kernel.names, *noise_model.names)
        starts.append(np.array([values[name] for name in order]))
    offset = float(y.mean()) if process.offset else 0.0
    likelihood = Likelihood(
        process.kernel, noise_model, process.X, y - offset, process.trials
    )
    # another noise may have its global optimum elsewhere
    optimum = climb_from(likelihood, starts, is_searched=noise is not None)
    alpha, jitter = likelihood.weights(optimum.theta)
    return replace(
        process,
        noise=noise_model,
        theta=optimum.theta,
        alpha=alpha,
        offset=offset,
        lml=optimum.lml,
        starts=optimum.starts,
        jitter=jitter,
        at_bound=optimum.at_bound,
    )
