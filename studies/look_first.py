"""Does the list of trials to look at first name bad ones, and no sound ones?

python -m studies.look_first [--seeds 1-20] [--trials 10]

A point foot is pushed on four terrains; one study a seed, in which nothing is wrong.
Then one trial of it is spoilt, in a way that is drawn by the seed, and the study made
again: the trial has to be among the first three of the list. Takes ten minutes.
"""

import argparse
import sys
from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np

from analysis.data.series import TractionSeries
from analysis.findings.look_first import OddTrial, look_first
from analysis.study.models import TUSTIN, FitOptions
from analysis.study.study import StudyOptions, run_study
from tests.fakes.point_foot import PointFoot

TERRAINS = ("S0", "B10", "TF", "Tf")
FIRST = 3
OPTIONS = StudyOptions(fit=FitOptions(models=(TUSTIN,), draws=0), n_jobs=1)


def late(series: TractionSeries) -> TractionSeries:
    """Return a trial whose forces are 30 ms late."""
    shift = 15
    return replace(
        series, F_n=np.roll(series.F_n, shift), F_t=np.roll(series.F_t, shift)
    )


def noisy(series: TractionSeries) -> TractionSeries:
    """Return a trial with a loose connector: bursts of 3 N in F_t."""
    rng = np.random.default_rng(series.t.size)
    return replace(series, F_t=series.F_t + rng.normal(0.0, 3.0, series.t.size))


def cut(series: TractionSeries) -> TractionSeries:
    """Return a trial that ends after a third."""
    n = series.t.size // 3
    columns = {k: getattr(series, k)[:n] for k in ("t", "v_t", "F_n", "F_t")}
    return replace(series, **columns)


SPOILT: Mapping[str, Callable[[TractionSeries], TractionSeries]] = {
    "tare of F_t off by 3 N": lambda s: replace(s, F_t=s.F_t + 3.0),
    "tare of F_n off by 3 N": lambda s: replace(s, F_n=s.F_n + 3.0),
    "F_t of the other sign": lambda s: replace(s, F_t=-s.F_t),
    "F_t twice as large": lambda s: replace(s, F_t=2.0 * s.F_t),
    "both forces in half": lambda s: replace(s, F_t=0.5 * s.F_t, F_n=0.5 * s.F_n),
    "velocity in half": lambda s: replace(s, v_t=0.5 * s.v_t),
    "forces 30 ms late": late,
    "loose connector": noisy,
    "a third of the way": cut,
}


def studied(trials: Mapping[str, list[TractionSeries]]) -> list[OddTrial]:
    """Return what the list of a study names."""
    return look_first(run_study(trials, OPTIONS, simulated=True), 0.0)


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--seeds", default="1-20", help="first-last (1-20)")
    parser.add_argument("--trials", type=int, default=10, help="of a terrain (10)")
    args = parser.parse_args()
    first, _, last = args.seeds.partition("-")
    seeds = range(int(first), int(last or first) + 1)
    called, found = 0, 0
    for seed in seeds:
        trials = {
            name: [PointFoot(name, seed, k).run() for k in range(args.trials)]
            for name in TERRAINS
        }
        most = studied(trials)[0]
        called += most.score > 1.0
        rng = np.random.default_rng(seed)
        how = list(SPOILT)[(seed - seeds[0]) % len(SPOILT)]
        terrain, k = TERRAINS[rng.integers(len(TERRAINS))], rng.integers(args.trials)
        spoilt = {name: list(group) for name, group in trials.items()}
        spoilt[terrain][k] = SPOILT[how](spoilt[terrain][k])
        odd = [each for each in studied(spoilt) if each.score > 1.0]
        named = [(each.terrain, each.number) for each in odd[:FIRST]]
        found += (terrain, k + 1) in named
        place = named.index((terrain, k + 1)) + 1 if (terrain, k + 1) in named else "-"
        reason = next((o.reasons[0] for o in odd if o.number == k + 1), "")[:60]
        print(
            f"seed {seed}: sound, farthest {most.score:.2f} of its limit "
            f"({most.terrain}, {most.reasons[0]}); "
            f"{how} on {terrain} {k + 1}: place {place} of {len(odd)} ({reason})",
            flush=True,
        )
    print(
        f"{found} of {len(seeds)} spoilt trials among the first {FIRST}; "
        f"{called} of {len(seeds)} sound studies with a trial named"
    )
    return 0 if found >= 0.9 * len(seeds) and called == 0 else 1


if __name__ == "__main__":
    sys.exit(main())
