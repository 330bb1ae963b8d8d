"""What do other terrains tell about one? Takes minutes.

python -m studies.terrain_relatives STUDY... [--draws 3] [--jobs 2] [--terrains S0,TF]

A study is a table of trials (npz) or a folder of recorded sessions. Of every terrain
three trials are known, in so many draws; its other trials are predicted from them and
from all other terrains, from them alone, and from the other terrains alone. Printed are
NLPD of the three beside that of the terrain's own nine-trial fit on the same trials,
and the share of samples in the 90 % band where the terrain was never recorded.
"""

import argparse
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from analysis.data.prepare import PrepareOptions, prepare_trial
from analysis.data.series import TractionSeries
from analysis.study.crossval import plan_folds, run_fold
from analysis.study.jobs import run_tasks
from analysis.study.models import GP_SE_TRIAL, FitOptions
from analysis.study.relatives import (
    RelativesOutcome,
    grounds_of,
    plan_relatives,
    run_relatives,
)
from studies.predictive_bands import load_study

OPTIONS = FitOptions(models=(GP_SE_TRIAL,), draws=0)
MOST_BEHIND_OWN = 0.05  # nat, the nine-trial fit before the joint one
MOST_LOSS = 0.03  # nat, to the three trials alone
LEAST_GAIN = 0.05  # nat, mean over the stones
INCLINE_BAND = (0.85, 0.95)  # share of samples in a band of 90 %


@dataclass(frozen=True)
class Figures:
    """One terrain: means over its draws [nat], the band of it never recorded."""

    terrain: str
    is_plate: bool
    joint: float
    alone: float
    nine: float
    chosen: float
    unseen: float
    unseen_band: float
    uses_relatives: float
    latent_below: float

    @property
    def gain(self) -> float:
        return self.alone - self.joint


def nlpd(outcome: RelativesOutcome, which: str) -> float:
    return float(np.mean([score.nlpd for score in getattr(outcome, which)]))


def nine_trial_fits(
    trials: Mapping[str, Sequence[TractionSeries]], jobs: int
) -> dict[tuple[str, int], float]:
    """Return the NLPD of every trial left out of its terrain's own fit."""
    prepared = {
        n: [prepare_trial(s, PrepareOptions()) for s in group]
        for n, group in trials.items()
    }
    folds, _ = plan_folds(prepared, OPTIONS)
    results = run_tasks(run_fold, folds, jobs)
    return {(r.terrain, r.fold): r.models[GP_SE_TRIAL].score.nlpd for r in results}


def compare(
    trials: Mapping[str, Sequence[TractionSeries]], jobs: int, draws: int
) -> list[Figures]:
    prepared = {
        n: [prepare_trial(s, PrepareOptions()) for s in group]
        for n, group in trials.items()
    }
    grounds, nine = grounds_of(trials), nine_trial_fits(trials, jobs)
    tasks = [
        task
        for draw in range(draws)
        for task in plan_relatives(prepared, grounds, OPTIONS, draw)
    ]
    outcomes = [o for o in run_tasks(run_relatives, tasks, jobs) if o is not None]
    figures = []
    for terrain, ground in grounds.items():
        own = [o for o in outcomes if o.terrain == terrain]
        if not own:
            continue
        tested = [nine[terrain, k] for o in own for k in o.tested]
        mean = {
            which: float(np.mean([nlpd(o, which) for o in own]))
            for which in ("joint", "alone", "chosen", "unseen")
        }
        bands = [score.coverage90 for o in own for score in o.unseen]
        figures.append(
            Figures(
                terrain,
                ground.is_plate,
                **mean,
                nine=float(np.mean(tested)),
                unseen_band=float(np.mean(bands)),
                uses_relatives=float(np.mean([o.uses_relatives for o in own])),
                latent_below=max(o.dissipation.latent for o in own),
            )
        )
    return figures


def table(figures: Sequence[Figures]) -> list[str]:
    """Return the lines of a study."""
    lines = [
        "terrain  joint  alone   nine  joint-nine  alone-joint  used  "
        "unseen  its 90 %  f < 0"
    ]
    lines += [
        f"{f.terrain:7} {f.joint:6.3f} {f.alone:6.3f} {f.nine:6.3f} "
        f"{f.joint - f.nine:+11.3f} {f.gain:+12.3f} {f.uses_relatives:5.2f} "
        f"{f.unseen:7.3f} {f.unseen_band:9.3f} {f.latent_below:6.4f}"
        for f in figures
    ]
    return lines


def shortfalls(figures: Sequence[Figures]) -> list[str]:
    """Return what a study misses of what is wanted on stones."""
    stones = [f for f in figures if not f.is_plate]
    missed = []
    for f in stones:
        if f.joint - f.nine > MOST_BEHIND_OWN:
            missed.append(f"{f.terrain}: {f.joint - f.nine:+.3f} to nine trials")
        if -f.gain > MOST_LOSS:
            missed.append(f"{f.terrain}: {-f.gain:+.3f} to three trials alone")
    gain = float(np.mean([f.gain for f in stones]))
    if gain < LEAST_GAIN:
        missed.append(f"stones: mean gain {gain:.3f}")
    low, high = INCLINE_BAND
    held = left_out_incline(figures)
    if not low <= held <= high:
        missed.append(f"left-out incline: 90 % band holds {held:.3f}")
    return missed


def left_out_incline(figures: Sequence[Figures]) -> float:
    """Return the 90 % band's share on the inclines between known ones (10 degrees)."""
    return float(np.mean([f.unseen_band for f in figures if f.terrain.endswith("10")]))


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.split("\n", 1)[0])
    parser.add_argument("studies", nargs="+", type=Path)
    parser.add_argument("--draws", type=int, default=3)
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--terrains", default="")
    args = parser.parse_args()
    is_met = True
    for path in args.studies:
        trials = load_study(path)
        wanted = args.terrains.split(",") if args.terrains else list(trials)
        figures = compare({n: trials[n] for n in wanted}, args.jobs, args.draws)
        sys.stdout.write(f"== {path.name}\n" + "\n".join(table(figures)) + "\n")
        stones = [f for f in figures if not f.is_plate]
        gain = float(np.mean([f.gain for f in stones]))
        sys.stdout.write(
            f"stones: mean gain over three trials alone {gain:+.3f}; "
            f"left-out 10 degrees: 90 % band {left_out_incline(figures):.3f}\n"
        )
        missed = shortfalls(figures)
        sys.stdout.write("".join(f"MISSED {t}\n" for t in missed) or "all limits met\n")
        sys.stdout.flush()
        is_met = is_met and not missed
    return 0 if is_met else 1


if __name__ == "__main__":
    sys.exit(main())
