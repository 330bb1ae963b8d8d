"""Does a foot slip on a contact law as on the ground that it was fitted to?

python -m studies.contact_law POOL [--terrains S0,B15] [--sets 5] [--trials 25]
python -m studies.contact_law POOL --stances

POOL is the folder of simulated trials of `studies.process`, made where it is missing.
To every training set of ten trials a law is fitted. The simulated hand then pushes a
point foot in stepped time over the law, `--trials` times a training set, and over a
constant coefficient of friction; normal forces are those of the simulated bed, which
is drawn anew. Both are held against the hundred tested trials of the simulated ground.
`--stances` runs the stance task on simulated ground and law with the same policies.
"""

import argparse
import sys
from collections.abc import Callable, Sequence
from multiprocessing import get_context
from pathlib import Path
from typing import NamedTuple

import numpy as np

from analysis.data.events import find_slips
from analysis.data.prepare import PreparedTrial, PrepareOptions, prepare_trial
from analysis.data.series import Array
from analysis.terrains.contact_fit import fit_contact_law
from analysis.terrains.process_rows import process_trials
from analysis.terrains.process_scores import STONES_DROP, events_of, ks_distance
from studies.process import FIRST, PER_SET, TESTED_SEED, load_pool, load_trials
from tests.fakes.law_ground import CoulombLaw, LawGround, TractionLaw
from tests.fakes.point_foot import PointFoot

STONES = ("S0", "S10", "S15", "B0", "B10", "B15")
DRIVEN_SEED = 4950  # of beds and hands, apart from the tested ones
TESTED = 100
_WINDOW = (0.005, 0.2)  # m/s of the coefficient of friction
_LEAST_LOAD = 0.8  # N of the same


class Driven(NamedTuple):
    """What pushes across a ground show.

    Attributes:
        slips: above 0.12 m/s, per metre [1/m].
        peak: mean force before them [N].
        force: mean F_t of whole trials [N].
        drops: falls of force [N].
        ways: way from one to the next [m].
        impulses: over 0.5 s [N s].
    """

    slips: float
    peak: float
    force: float
    drops: Array
    ways: Array
    impulses: Array


def driven(trials: Sequence[PreparedTrial]) -> Driven:
    """Return what pushes show."""
    slips = [slip for trial in trials for slip in find_slips(trial.smooth)]
    rows = process_trials(trials)
    events = events_of([t.F_t for t in rows], rows, STONES_DROP)
    return Driven(
        slips=len(slips) / max(events.way, 1e-9),
        peak=float(np.mean([slip.peak for slip in slips])) if slips else np.nan,
        force=float(np.mean(np.concatenate([t.F_t for t in rows]))),
        drops=events.drops,
        ways=events.ways,
        impulses=events.impulses,
    )


def pushed(
    terrain: str, seed: int, trials: int, law: Callable[[int], TractionLaw]
) -> Driven:
    """Return what pushes over a law show; normal forces are those of its bed."""
    made = []
    for k in range(trials):
        foot = PointFoot(terrain, seed, k)
        foot.ground = LawGround(foot.ground, law(k))
        made.append(prepare_trial(foot.run(), PrepareOptions()))
    return driven(made)


def coefficient(trials: Sequence[PreparedTrial]) -> float:
    """Return the median of F_t over F_n of a foot in motion."""
    rows = process_trials(trials)
    F_n, v_t, F_t = (
        np.concatenate([getattr(t, name) for t in rows])
        for name in ("F_n", "v_t", "F_t")
    )
    is_in = (v_t >= _WINDOW[0]) & (v_t <= _WINDOW[1]) & (F_n >= _LEAST_LOAD)
    return float(np.median(F_t[is_in] / F_n[is_in]))


def one(work: tuple[Path, str, int, int]) -> tuple[Driven, Driven]:
    """Return pushes over the law of a training set, and over constant friction."""
    pool, terrain, number, trials = work
    learnt = load_pool(pool, terrain, FIRST + number, PER_SET)
    law = fit_contact_law(learnt, 0)
    if law is None:
        raise SystemExit(f"{terrain}: no law, too few releases.")
    mu = coefficient(load_trials(pool, terrain, FIRST + number, PER_SET))
    seed = DRIVEN_SEED + number
    return (
        pushed(terrain, seed, trials, law.begin),
        pushed(terrain, seed, trials, lambda _: CoulombLaw(mu)),
    )


def compared(made: Driven, true: Driven) -> str:
    """Return how far pushes over a law are from those over the simulated ground."""
    parts = [
        f"slips {made.slips:5.1f}/m ({made.slips / true.slips - 1.0:+.2f})",
        f"peak {made.peak:4.1f} N ({made.peak / true.peak - 1.0:+.2f})",
        f"mean {made.force:4.1f} N ({made.force / true.force - 1.0:+.2f})",
        *(
            f"{name} {ks_distance(getattr(made, key), getattr(true, key)):.2f}"
            for name, key in (
                ("KS drops", "drops"),
                ("way", "ways"),
                ("impulse", "impulses"),
            )
        ),
    ]
    return "  ".join(parts)


def main() -> int:
    """Print the tables."""
    parser = argparse.ArgumentParser(description="A contact law in the hand's loop.")
    parser.add_argument("pool", type=Path)
    parser.add_argument("--terrains", default=",".join(STONES))
    parser.add_argument("--sets", type=int, default=5)
    parser.add_argument("--trials", type=int, default=25)
    parser.add_argument("--jobs", type=int, default=1)
    args = parser.parse_args()
    with get_context("spawn").Pool(args.jobs) as processes:
        for name in args.terrains.split(","):
            true = driven(load_trials(args.pool, name, TESTED_SEED, TESTED))
            sys.stdout.write(
                f"{name}: simulated ground, slips {true.slips:.1f}/m, peak "
                f"{true.peak:.1f} N, mean {true.force:.1f} N\n"
            )
            work = [(args.pool, name, k, args.trials) for k in range(args.sets)]
            for k, (made, constant) in enumerate(processes.imap(one, work), 1):
                sys.stdout.write(f"  set {k}, law    {compared(made, true)}\n")
                sys.stdout.write(f"  set {k}, mu     {compared(constant, true)}\n")
                sys.stdout.flush()
    return 0


if __name__ == "__main__":
    sys.exit(main())
