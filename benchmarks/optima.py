"""Do the fits of a study reach the best of twenty starts? Every fold, every model.

Twenty starts for each: half anywhere in the box of the search, half where fits usually
end. A fit of a Gaussian process is as good if its log likelihood is at most 1e-3 lower,
a Tustin fit if its sum of squares is at most 1e-4 larger.
"""

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from scipy.optimize import minimize

from analysis.data.series import Array
from analysis.gp.kernels import Kernel
from analysis.gp.likelihood import Likelihood
from analysis.gp.noise import ConstantNoise
from analysis.gp.search import posterior_search
from analysis.study.crossval import FoldTask
from analysis.study.jobs import run_tasks
from analysis.study.models import PAPER_MODELS, TUSTIN
from benchmarks.beside_sklearn import KERNELS
from benchmarks.fit import SLICE, many_starts
from benchmarks.study_race import FITS, folds_of, given

_STARTS = 20
_LIKELIHOOD = 1e-3
_SQUARES = 1e-4  # of their sum


class RawRecord(NamedTuple):
    """What one fit reached beside the best of twenty starts.

    Attributes:
        place: terrain and fold.
        model: its name.
        ours: log likelihood, or minus the sum of squares.
        best: the same of the best of twenty.
        is_as_good: ours is within the tolerance.
        evaluations: how often our search evaluated the likelihood.
    """

    place: str
    model: str
    ours: float
    best: float
    is_as_good: bool
    evaluations: int


def examine(task: FoldTask) -> list[RawRecord]:
    """Return what the five models of one fold reached."""
    rows = given(task)
    sse, best = rows.curve.sse, many_starts(task.training)
    place = f"{task.terrain} fold {task.fold + 1}"
    found = [RawRecord(place, TUSTIN, -sse, -best, sse <= (1.0 + _SQUARES) * best, 0)]
    for name, (part, _) in FITS.items():
        kernel, r = KERNELS[part], rows.outputs[name]
        ours = posterior_search(kernel, ConstantNoise(), rows.X, r)
        best = twenty(kernel, rows.X, r, task.fold)
        is_as_good = ours.lml >= best - _LIKELIHOOD
        spent = sum(start.evaluations for start in ours.starts)
        found.append(RawRecord(place, name, ours.lml, best, is_as_good, spent))
    return found


def twenty(kernel: Kernel, X: Array, r: Array, seed: int) -> float:
    """Return the largest log likelihood that twenty starts reach."""
    likelihood = Likelihood(kernel, ConstantNoise(), X, r)
    sd = float(r.std())
    box = np.vstack([kernel.bounds(sd, np.ones(2)), ConstantNoise().bounds(sd)])
    middle = np.log([sd, *np.ones(box.shape[0] - 2), 0.5 * sd])
    near = np.clip(np.column_stack([middle - 2.3, middle + 2.3]).T, *box.T)
    rng = np.random.default_rng(seed)
    half = _STARTS // 2
    starts = [
        *rng.uniform(*box.T, (half, box.shape[0])),
        *rng.uniform(*near, (half, box.shape[0])),
    ]
    return max(climb(likelihood, start, box) for start in starts)


def climb(likelihood: Likelihood, start: Array, box: Array) -> float:
    """Return the log likelihood that one start reaches with all rows."""
    found = minimize(
        lambda theta: [-part for part in likelihood(theta)],
        start,
        jac=True,
        method="L-BFGS-B",
        bounds=box,
        options={"gtol": 1e-5, "ftol": 2e-9},
    )
    return -float(found.fun)


def summary(found: Sequence[RawRecord]) -> list[str]:
    """Return what to print: shares, then every fit that missed the optimum."""
    processes = [one for one in found if one.model != TUSTIN]
    groups = {
        name: [one for one in found if one.model == name] for name in PAPER_MODELS
    }
    lines = [
        f"{name}: {sum(one.is_as_good for one in group)} of {len(group)} fits at the "
        f"best of {_STARTS} starts, {sum(one.evaluations for one in group)} evaluations"
        for name, group in {**groups, "all Gaussian processes": processes}.items()
    ]
    return lines + [
        f"  missed: {one.place} {one.model}: {one.ours:.4f}, best {one.best:.4f}"
        for one in found
        if not one.is_as_good
    ]


def main() -> None:
    """Examine every fold and print the shares."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("trials", type=Path, nargs="?", default=SLICE, help="npz")
    parser.add_argument("--jobs", type=int, default=1)
    arguments = parser.parse_args()
    found = run_tasks(examine, folds_of(arguments.trials), arguments.jobs)
    for line in summary([one for fold in found for one in fold]):
        print(line)


if __name__ == "__main__":
    main()
