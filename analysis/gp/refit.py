"""Fits that begin where another fit ended: what is so alike needs no whole search.

Other outputs over the same rows, another noise, other rows of the same terrain.
"""

from dataclasses import replace

import numpy as np

from analysis.data.series import Array
from analysis.gp.likelihood import Likelihood
from analysis.gp.noise import Noise
from analysis.gp.regression import GaussianProcess
from analysis.gp.search import climb_from, distinct_tops

_SIZES = frozenset({"sf", "sn", "sc"})  # in the unit of the outputs
_VANISHED = 2.0  # below where a search begins: a spread there has no slope to leave by


def refit_gp(
    process: GaussianProcess,
    y: Array,
    noise: Noise | None = None,
) -> GaussianProcess:
    """Return a process of other outputs or noise over the same rows.

    For what is so alike that its tops are nearly known: the search climbs from where
    the starts of `process` ended.

    Args:
        process: what to begin with.
        y: training outputs, shape (n,).
        noise: by default that of `process`; parameters that it does not share with it
            begin where they do in any search.
    """
    wanted = noise or process.noise
    names = (*process.kernel.names, *process.noise.names)
    own = dict(zip(wanted.names, wanted.start(float(np.std(y))).tolist(), strict=True))
    starts = []
    for theta in distinct_tops(process.kernel, process.starts):
        known = own | dict(zip(names, theta.tolist(), strict=True))
        for name, value in own.items():
            if name.rpartition("_")[2] in _SIZES:
                known[name] = max(known[name], value - _VANISHED)
        order = (*process.kernel.names, *wanted.names)
        starts.append(np.array([known[name] for name in order]))
    offset = float(y.mean()) if process.offset else 0.0
    likelihood = Likelihood(
        process.kernel, wanted, process.X, y - offset, process.trials
    )
    # another noise may have its best top elsewhere
    optimum = climb_from(likelihood, starts, is_searched=noise is not None)
    alpha, jitter = likelihood.weights(optimum.theta)
    return replace(
        process,
        noise=wanted,
        theta=optimum.theta,
        alpha=alpha,
        offset=offset,
        lml=optimum.lml,
        starts=optimum.starts,
        jitter=jitter,
        at_bound=optimum.at_bound,
    )
