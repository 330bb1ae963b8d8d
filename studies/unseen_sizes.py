"""Do bands hold for a grain size that was never recorded? Takes ten minutes.

python -m studies.unseen_sizes [--seeds 1-5] [--trials 6]

Stones of six sizes lie level and at 10 degrees; a point foot is pushed over them. One
size at a time is taken out, at both inclines, and forecast by the model of all
terrains from the other five: between what was recorded, or one step outside. Printed is
the share of the samples of whole trials inside the 90 % band, mean over trials, and how
wide the bands are beside those of a size that was recorded.
"""

import argparse
import sys
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from analysis.data.prepare import PrepareOptions, prepare_trial
from analysis.data.samples import SampleTable
from analysis.gp.ground import Ground
from analysis.study.all_ground import TerrainRows, fit_all_ground
from analysis.study.next_cell import beyond_recorded
from tests.fakes.point_foot import PointFoot

SIZES = (12.0, 16.0, 22.0, 30.0, 40.0, 54.0)  # mm
INCLINES = (0.0, 10.0)  # degrees
LIMIT = (0.86, 0.94)  # of the mean share inside, sizes between recorded ones
BAND = (0.05, 0.95)
EVERY = 3  # samples of a trial that is judged


@dataclass(frozen=True)
class SizeOutcome:
    """One cell of a size that was taken out.

    Attributes:
        size: of the stones [mm].
        beyond: what the program names as extrapolated.
        shares: of the samples inside the band, by trial.
        wider: median width of the bands over that with the cell recorded.
    """

    size: float
    beyond: tuple[str, ...]
    shares: tuple[float, ...]
    wider: float

    @property
    def is_outside(self) -> bool:
        return self.size in {SIZES[0], SIZES[-1]}


def cell_of(size: float, incline: float, seed: int, trials: int) -> TerrainRows:
    """Return simulated trials on stones of a size [mm] at an incline [degrees]."""
    name, word = f"G{size:g}i{incline:g}", f"{size:g} mm"
    kind = (word, "tread", incline)
    series = (PointFoot(name, seed, k, kind=kind).run() for k in range(trials))
    prepared = (prepare_trial(one, PrepareOptions()) for one in series)
    tables = tuple(SampleTable.of([trial]) for trial in prepared if trial.kept)
    return TerrainRows(Ground(name, word, incline), tables)


def outcomes_of(seed: int, trials: int) -> list[SizeOutcome]:
    """Return what became of every size as it was taken out."""
    cells = {
        (size, incline): cell_of(size, incline, seed, trials)
        for size in SIZES
        for incline in INCLINES
    }
    whole = fit_all_ground(list(cells.values()))
    found: list[SizeOutcome] = []
    for size in SIZES:
        rest = [cell for (other, _), cell in cells.items() if other != size]
        model = fit_all_ground(rest, whole)
        for incline in INCLINES:
            cell = cells[size, incline]
            shares, wider = [], []
            for trial in cell.trials:
                table = trial.take(np.arange(0, trial.count, EVERY))
                inputs = table.inputs
                low, high = model.predict(cell.ground, inputs).quantiles(BAND)
                near = whole.predict(cell.ground, inputs).quantiles(BAND)
                inside = (table.F_t >= low) & (table.F_t <= high)
                shares.append(float(inside.mean()))
                wider.append(float(np.median((high - low) / (near[1] - near[0]))))
            beyond = beyond_recorded(cell.ground, [each.ground for each in rest])
            found.append(
                SizeOutcome(size, beyond, tuple(shares), float(np.median(wider)))
            )
    return found


def show(title: str, outcomes: Sequence[SizeOutcome]) -> float:
    """Print a line about some outcomes; return the mean share inside."""
    shares = np.array([share for each in outcomes for share in each.shares])
    marked = sum("d50" in each.beyond for each in outcomes)
    wider = np.median([each.wider for each in outcomes])
    print(
        f"{title:28} {shares.mean():.3f} inside the 90 % band "
        f"(worst trial {shares.min():.2f}), {wider:.2f} times as wide, "
        f"{marked} of {len(outcomes)} marked as extrapolated"
    )
    return float(shares.mean())


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--seeds", default="1-5", help="first-last (1-5)")
    parser.add_argument("--trials", type=int, default=6, help="of a cell (6)")
    args = parser.parse_args()
    first, _, last = args.seeds.partition("-")
    seeds = range(int(first), int(last or first) + 1)
    every: list[SizeOutcome] = []
    for seed in seeds:
        outcomes = outcomes_of(seed, args.trials)
        show(f"seed {seed}, between", [o for o in outcomes if not o.is_outside])
        every += outcomes
    for size in SIZES:
        show(f"{size:g} mm", [o for o in every if o.size == size])
    between = show("between, all", [o for o in every if not o.is_outside])
    outside = [o for o in every if o.is_outside]
    show("one step outside, all", outside)
    is_marked = all("d50" in o.beyond for o in outside)
    is_wider = np.median([o.wider for o in outside]) > np.median(
        [o.wider for o in every if not o.is_outside]
    )
    return 0 if LIMIT[0] <= between <= LIMIT[1] and is_marked and is_wider else 1


if __name__ == "__main__":
    sys.exit(main())
