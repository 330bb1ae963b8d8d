"""Cost of the fits, compared with scikit-learn and 20-start least squares.

The peers get three starts and one linear-algebra thread each. Fits alternate, so that
other load on the machine affects all of them alike. Times are medians over rounds.
"""

import argparse
import json
import statistics
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from scipy.optimize import least_squares
from sklearn.gaussian_process import GaussianProcessRegressor
from threadpoolctl import threadpool_limits

from acquisition.linear_algebra import keep_heap
from analysis.data.prepare import PrepareOptions, prepare_trial
from analysis.data.samples import SampleTable
from analysis.gp.arcsine import Arcsine
from analysis.gp.likelihood import Likelihood
from analysis.gp.noise import ConstantNoise
from analysis.gp.regression import fit_gp
from analysis.tables.loading import load_tables
from analysis.tustin.model import TustinBounds, TustinParameters, fit_tustin, predict
from benchmarks import peer_gpy, peer_tinygp
from benchmarks.peer_sklearn import KERNELS, fit_sklearn, sklearn_kernel, three_starts
from benchmarks.rows import BenchRow, not_installed
from benchmarks.study_race import SLICE, race

Fitter = Callable[[np.ndarray, np.ndarray], Callable[[Sequence[np.ndarray]], float]]

EVALUATION = "one SE evaluation, n = 300"  # row name
_POINTS = 300
_STARTS_OF_TUSTIN = 20
_ROUNDS = 3  # repeats of every fold of the short race
_GOALS = {"evaluation": 5.0, "SE fit": 4.0, "NN fit": 2.0, "Tustin fit": 10.0}


def load_rows() -> SampleTable:
    """Return the kept samples of three trials on stones."""
    return SampleTable.of(
        [prepare_trial(s, PrepareOptions()) for s in load_tables([SLICE])["S0"]]
    )


def chosen(rows: SampleTable) -> tuple[np.ndarray, np.ndarray]:
    """Draw 300 rows; return their standardised inputs and centred outputs."""
    index = np.random.default_rng(0).choice(rows.count, _POINTS, replace=False)
    X, y = rows.inputs[index], rows.F_t[index]
    return (X - X.mean(axis=0)) / X.std(axis=0), y - y.mean()


def many_starts(rows: SampleTable) -> float:
    """Return the smallest sum of squares of 20-start bounded least squares."""
    pairs = np.array([pair for _, pair in TustinBounds().items()])
    low, high = pairs.T.copy()
    for k in (2, 3):
        low[k], high[k] = np.log(pairs[k])

    def residual(x: np.ndarray) -> np.ndarray:
        parameters = TustinParameters(*[*x[:2], *np.exp(x[2:4]), x[4]])
        return predict(parameters, rows.F_n, rows.v_t) - rows.F_t

    rng = np.random.default_rng(1)
    starts = rng.uniform(low, high, (_STARTS_OF_TUSTIN, 5))
    return min(
        2.0 * least_squares(residual, x, bounds=(low, high)).cost for x in starts
    )


def time_alternating(
    ours: Callable[[], object], other: Callable[[], object], rounds: int
) -> tuple[float, float]:
    """Run two functions in turn; return the median processor time of each [s]."""
    durations: tuple[list[float], list[float]] = ([], [])
    for _ in range(rounds):
        for function, times in zip((ours, other), durations, strict=True):
            before = time.process_time()
            function()
            times.append(time.process_time() - before)
    return statistics.median(durations[0]), statistics.median(durations[1])


class SpeedComparison(NamedTuple):
    """A fit to be timed against the same fit by another library.

    Attributes:
        name: printed name.
        ours: our fit; returns the optimum it reached.
        other: the other library's fit, likewise.
        rounds: number of repeats of both.
    """

    name: str
    ours: Callable[[], float]
    other: Callable[[], float]
    rounds: int

    def measured(self) -> dict[str, object]:
        """Return both times, their ratio and both optima."""
        ours, other = time_alternating(self.ours, self.other, self.rounds)
        return {
            "part": self.name,
            "ours_ms": 1e3 * ours,
            "other_ms": 1e3 * other,
            "ratio": other / ours,
            "goal": _GOALS.get(self.name),
            "reached": self.ours(),
            "other_reached": self.other(),
        }


def parts(rounds: int) -> list[SpeedComparison]:
    """Return the comparisons of single fits."""
    rows = load_rows()
    X, y = chosen(rows)
    starts = {part: three_starts(part, X, y) for part in KERNELS}

    def sklearn_likelihood(part: str) -> float:
        model: Any = fit_sklearn(part, X, y, starts[part])
        return float(model.log_marginal_likelihood_value_)

    return [
        evaluation(X, y, 10 * rounds),
        SpeedComparison(
            "SE fit",
            lambda: fit_gp(X, y).lml,
            lambda: sklearn_likelihood("SE fit"),
            rounds,
        ),
        SpeedComparison(
            "NN fit",
            lambda: fit_gp(X, y, Arcsine()).lml,
            lambda: sklearn_likelihood("NN fit"),
            rounds,
        ),
        SpeedComparison(
            "Tustin fit",
            lambda: fit_tustin(rows.F_n, rows.v_t, rows.F_t).sse,
            lambda: many_starts(rows),
            rounds,
        ),
    ]


def evaluation_function(X: np.ndarray, y: np.ndarray) -> Callable[[], float]:
    """Return a function that evaluates one likelihood with its gradient."""
    theta = three_starts("SE fit", X, y)[0]
    likelihood = Likelihood(KERNELS["SE fit"], ConstantNoise(), X, y)
    return lambda: likelihood(theta)[0]


def evaluation(X: np.ndarray, y: np.ndarray, rounds: int) -> SpeedComparison:
    """Compare one likelihood evaluation with its gradient against scikit-learn's."""
    theta = three_starts("SE fit", X, y)[0]
    kernel = sklearn_kernel("SE fit", theta, float(y.std()))
    unfitted: Any = GaussianProcessRegressor
    model = unfitted(kernel, alpha=1e-10, optimizer=None).fit(X, y)
    fitted = model.kernel_.theta
    return SpeedComparison(
        "evaluation",
        evaluation_function(X, y),
        lambda: model.log_marginal_likelihood(
            fitted, eval_gradient=True, clone_kernel=False
        )[0],
        rounds,
    )


def rows() -> list[BenchRow]:
    """Return the measurements as table rows."""
    with threadpool_limits(1):
        by_name = {str(part["part"]): part for part in (p.measured() for p in parts(3))}
        peers = [
            peer_row(what, goal, maker)
            for what, goal, maker in (
                ("the same against GPy", 10, peer_gpy.fitter),
                ("the same against tinygp, compiled before", 8, peer_tinygp.fitter),
            )
        ]
    ratio = {name: float(str(part["ratio"])) for name, part in by_name.items()}
    ours_ms = {name: float(str(part["ours_ms"])) for name, part in by_name.items()}
    least_squares_of = "Tustin fit against 20-start least squares"
    equal = "against scikit-learn, three starts"
    return [
        BenchRow(f"SE fit, n = 300, {equal}", ratio["SE fit"], "times", 8, True),
        *peers,
        BenchRow(f"NN fit, n = 300, {equal}", ratio["NN fit"], "times"),
        BenchRow("NN fit, n = 300", ours_ms["NN fit"], "ms", 80),
        BenchRow(EVALUATION, ours_ms["evaluation"], "ms", 1.15),
        BenchRow(
            least_squares_of, ratio["Tustin fit"], "times", 30, is_lower_bound=True
        ),
    ]


def peer_row(what: str, goal: float, maker: Fitter) -> BenchRow:
    """Return the speed-up of our SE fit over a peer's, the likelihood gap as its note.

    Args:
        what: name of the row.
        goal: smallest acceptable ratio of times.
        maker: returns the peer's fit; raises ImportError if it is not installed.
    """
    X, y = chosen(load_rows())
    try:
        fit = maker(X, y)
    except ImportError:
        return not_installed(what, goal)
    starts = three_starts("SE fit", X, y)
    reached = fit(starts)  # untimed: tinygp compiles in the first fit
    ours, other = time_alternating(lambda: fit_gp(X, y), lambda: fit(starts), 3)
    gap = fit_gp(X, y).lml - reached
    note = f"log likelihood {gap:+.3f} relative to its own"
    return BenchRow(what, other / ours, "times", goal, True, note)


def main() -> None:
    """Measure and print one line per part, or JSON."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--json", action="store_true")
    parser.add_argument(
        "--keep-memory",
        action="store_true",
        help="keep memory between fits on all sides, like a study's workers",
    )
    parser.add_argument(
        "--whole",
        type=Path,
        metavar="FILE",
        help="race every fold of these trials (npz), not three folds of a slice; "
        "80 trials on 8 terrains take scikit-learn half an hour",
    )
    parser.add_argument(
        "--share",
        type=float,
        default=1.0,
        help="share of the folds that scikit-learn fits too, drawn at random",
    )
    arguments = parser.parse_args()
    if arguments.keep_heap:
        keep_heap()
    with threadpool_limits(1):
        results: list[dict[str, Any]] = [
            part.measured() for part in parts(arguments.rounds)
        ]
        results.append(
            race(arguments.whole, arguments.share)
            if arguments.whole
            else race(SLICE, rounds=_ROUNDS, is_whole=False)
        )
    if arguments.json:
        print(json.dumps(results, indent=1))
        return
    for part in results:
        goal = f" (goal {part['goal']:g})" if part["goal"] else ""
        print(
            f"{part['part']}: {part['ours_ms']:.2f} ms, other {part['other_ms']:.2f} "
            f"ms, ratio {part['ratio']:.1f}{goal}; reached {part['reached']:.4f}, "
            f"other {part['other_reached']:.4f}"
        )
    for line in results[-1]["notes"]:
        print(f"  {line}")


if __name__ == "__main__":
    main()
