"""Are advised trials worth more than ten of every terrain? Takes an hour.

python -m studies.advice [--seeds 1-20] [--given 64]

On the paper's eight terrains a point foot is pushed: twenty trials of each to choose
from, six to judge by. The plan of the paper takes ten of each, 80. The advice begins
with three of each and takes, four at a time, a trial of the cells where one more is
expected to tell most (`analysis.study.next_cell`). Printed is the log density of the
judged trials under the model of all terrains, mean over trials, after 80 trials of the
plan, after so many of the advice, and after as many spread evenly.
"""

import argparse
import sys
from collections.abc import Mapping, Sequence

import numpy as np

from analysis.data.prepare import PreparedTrial, PrepareOptions, prepare_trial
from analysis.data.samples import SampleTable
from analysis.gp.ground import Ground
from analysis.study.all_ground import TerrainRows, fit_all_ground
from analysis.study.next_cell import forecast_matrix
from tests.fakes.point_foot import GROUNDS, PointFoot

POOL, JUDGED = 20, 6  # trials of a terrain to choose from, and to judge by
PLAN, FIRST, AT_ONCE = 10, 3, 4  # of a terrain; of a terrain; of all
EVERY = 3  # samples of a trial that is judged
Counts = Mapping[str, int]
Pool = Mapping[str, Sequence[PreparedTrial]]


def ground_of(name: str) -> Ground:
    """Return a terrain of the paper as the model of all terrains takes it."""
    stones, foot, incline = GROUNDS[name]
    size = "flat" if stones == "none" else stones
    return Ground(name, size, incline, (("foot", foot),))


def simulated(seed: int, first: int, count: int) -> Pool:
    """Return prepared trials of every terrain, from a number on."""
    return {
        name: [
            prepare_trial(PointFoot(name, seed, first + k).run(), PrepareOptions())
            for k in range(count)
        ]
        for name in GROUNDS
    }


def of_each(pool: Pool, count: int) -> dict[str, int]:
    """Return the same number of trials of every terrain."""
    return dict.fromkeys(pool, count)


def density(pool: Pool, taken: Counts, judged: Pool) -> float:
    """Return the log density of the judged trials given the first ones of the pool."""
    model = fit_all_ground(
        [
            TerrainRows(ground_of(name), tuple(SampleTable.of([t]) for t in chosen))
            for name, trials in pool.items()
            if (chosen := [t for t in trials[: taken[name]] if t.kept])
        ]
    )
    found: list[float] = []
    for name, trials in judged.items():
        for trial in trials:
            table = SampleTable.of([trial])
            table = table.take(np.arange(0, table.count, EVERY))
            if table.count:
                told = model.predict(ground_of(name), table.inputs)
                found.append(float(told.log_density(table.F_t).mean()))
    return float(np.mean(found))


def advised(pool: Pool, given: int) -> dict[str, int]:
    """Return how many trials of every terrain were taken by the advice."""
    taken = of_each(pool, FIRST)
    grounds = {name: ground_of(name) for name in pool}
    while sum(taken.values()) < given:
        trials = {name: pool[name][: taken[name]] for name in pool}
        forecast = forecast_matrix(trials, grounds, list(grounds.values()))
        assert forecast is not None
        ranked = sorted(forecast.cells, key=lambda cell: -cell.gain)
        left = [cell.terrain for cell in ranked if taken[cell.terrain] < POOL]
        for name in left[: min(AT_ONCE, given - sum(taken.values()))]:
            taken[name] += 1
    return taken


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--seeds", default="1-20", help="first-last (1-20)")
    parser.add_argument("--given", type=int, default=64, help="trials advised (64)")
    args = parser.parse_args()
    first, _, last = args.seeds.partition("-")
    gains: list[tuple[float, float]] = []
    for seed in range(int(first), int(last or first) + 1):
        pool, judged = simulated(seed, 0, POOL), simulated(seed, POOL, JUDGED)
        planned = density(pool, of_each(pool, PLAN), judged)
        even = density(pool, of_each(pool, args.given // len(pool)), judged)
        taken = advised(pool, args.given)
        told = density(pool, taken, judged)
        gains.append((told - planned, told - even))
        counts = " ".join(f"{name} {count}" for name, count in taken.items())
        print(
            f"seed {seed}: plan {planned:.3f}, {args.given} advised {told:.3f}, "
            f"{args.given} evenly {even:.3f} nat   ({counts})",
            flush=True,
        )
    over_plan, over_even = np.mean(gains, axis=0)
    error = np.std(np.array(gains)[:, 0], ddof=1) / np.sqrt(len(gains))
    print(
        f"{args.given} advised trials over {PLAN * len(GROUNDS)} planned ones: "
        f"{over_plan:+.4f} ± {error:.4f} nat; over {args.given} spread evenly: "
        f"{over_even:+.4f} nat"
    )
    return 0 if over_plan >= 0.0 else 1


if __name__ == "__main__":
    sys.exit(main())
