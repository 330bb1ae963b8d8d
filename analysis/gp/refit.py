"""Fits that begin where another fit ended: what is so alike needs no whole search.

Other outputs over the same rows, another noise, other rows of the same terrain.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from analysis.data.series import Array
from analysis.gp.approach import objective_of
from analysis.gp.kernels import Kernel
from analysis.gp.likelihood import Likelihood
from analysis.gp.low_rank import near_over
from analysis.gp.noise import Noise
from analysis.gp.regression import GaussianProcess
from analysis.gp.search import climb_from, distinct_tops

_SIZES = frozenset({"sf", "sn", "sc", "sp", "so"})  # in the unit of the outputs
_VANISHED = 2.0  # below where a search begins: a spread there has no slope to leave by


def refit_gp(
    process: GaussianProcess,
    y: Array,
    ratio: float = 1.0,
    noise: Noise | None = None,
) -> GaussianProcess:
    """Return a process of other outputs or noise over the same rows.

    For what is so alike that its tops are nearly known: the search climbs from where
    the starts of `process` ended.

    Args:
        process: what to begin with.
        y: training outputs, shape (n,).
        ratio: standard deviation of `y` over that of the outputs of `process`.
        noise: by default that of `process`; parameters that it does not share with it
            begin where they do in any search.
    """
    model = (process.kernel, noise or process.noise)
    names = (*process.kernel.names, *process.noise.names)
    size = [float(name.rpartition("_")[2] in _SIZES) for name in names]
    own = dict(
        zip(model[1].names, model[1].start(float(np.std(y))).tolist(), strict=True)
    )
    starts = []
    for theta in distinct_tops(process.kernel, process.starts):
        moved = theta + np.log(ratio) * np.array(size)
        known = own | dict(zip(names, moved.tolist(), strict=True))
        for name, value in own.items():
            if name.rpartition("_")[2] in _SIZES:
                known[name] = max(known[name], value - _VANISHED)
        wanted = (*process.kernel.names, *model[1].names)
        starts.append(np.array([known[name] for name in wanted]))
    return _climbed(process, model, y, starts, is_searched=noise is not None)


def _climbed(
    process: GaussianProcess,
    model: tuple[Kernel, Noise],
    y: Array,
    starts: Sequence[Array],
    *,
    is_searched: bool = False,
) -> GaussianProcess:
    """Return the process of outputs y that climbs from `starts` lead to.

    Where it `is_searched` for other tops, too, one more start is chosen.
    """
    offset = float(y.mean()) if process.offset else 0.0
    likelihood = Likelihood(model, process.X, y - offset, process.trials)
    objective = objective_of(likelihood, near_over(likelihood))
    exact = objective.value if is_searched else None
    sd = float(np.std(y - offset))
    optimum = climb_from(model, objective, process.X, sd, starts, exact)
    alpha, jitter = likelihood.weights(optimum.theta)
    return replace(
        process,
        noise=model[1],
        theta=optimum.theta,
        alpha=alpha,
        offset=offset,
        lml=optimum.lml,
        starts=optimum.starts,
        jitter=jitter,
        at_bound=optimum.at_bound,
    )
