"""Does a foot slip on a contact law as on the ground that it was fitted to?

python -m studies.contact_law POOL [--terrains S0,B15] [--sets 5] [--trials 20]
python -m studies.contact_law POOL --no-creep
python -m studies.contact_law POOL --stances
python -m studies.contact_law POOL --numbers [--figure FILE]

POOL is the folder of simulated trials of `studies.process`, made where it is missing.
To every training set of ten trials a law is fitted. The simulated hand then pushes a
point foot in stepped time over the law, `--trials` times a training set, and over a
constant coefficient of friction; normal forces are those of the simulated bed, which
is drawn anew. Both are held against the hundred tested trials of the simulated ground.
`--no-creep` leaves creep out of the law. `--stances` runs the stance task on simulated
ground and law with the same policies. `--numbers` says what the laws are made of, and
how often the interval of a number by one training set holds that by another;
`--figure` draws a push over each ground.
"""

import argparse
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from itertools import permutations
from multiprocessing import get_context
from pathlib import Path
from typing import NamedTuple

import numpy as np

from analysis.data.events import find_slips
from analysis.data.prepare import PreparedTrial, PrepareOptions, prepare_trial
from analysis.data.series import Array
from analysis.figures.style import FORCE_LABEL, panel_grid, render, styled
from analysis.stance.interface import StanceRequest, risk_tables
from analysis.stance.outcomes import StanceTotals, totals
from analysis.stance.policies import POLICIES
from analysis.stance.sequence import SoleView, StancePlan
from analysis.terrains.contact_fit import constant_friction, fit_contact_law
from analysis.terrains.contact_law import ContactLaw, ContactNumbers
from analysis.terrains.process_rows import process_trials
from analysis.terrains.process_scores import STONES_DROP, events_of, ks_distance
from fakes.ground.law_ground import LawGround, TractionLaw
from studies.process import FIRST, PER_SET, TESTED_SEED, load_pool, load_trials
from tests.fakes.point_foot import PointFoot
from tests.fakes.stance_bench import (
    TRAVEL,
    StanceBench,
    learn_break_away,
    stances,
    taught,
)

STONES = ("S0", "S10", "S15", "B0", "B10", "B15")
DRIVEN_SEED = 4950  # of beds and hands, apart from the tested ones
TESTED = 100


STANCE_SEED, BEDS, STANCES, PEAK, RISK = 4970, 10, 25, 6.0, 0.1  # N; share of slips


class CoulombLaw:
    """A constant coefficient of friction, as simulators use it."""

    def __init__(self, mu: float) -> None:
        self._mu = mu

    def step(self, dt: float, x: float, v: float, F_n: float) -> float:
        """Return F_t [N]."""
        del dt, x
        return self._mu * F_n * min(max(v / 0.01, -1.0), 1.0)

    def capacity(self, F_n: float) -> float:
        """Return mu F_n [N]."""
        return self._mu * F_n


class KnownBench(StanceBench):
    """A bed under a foot that knows its terrain, with the traction of a law."""

    def __init__(
        self, law: ContactLaw | None, terrain: str, seed: int, trial: int
    ) -> None:
        super().__init__(terrain, seed, trial)
        self._known = {terrain: 1.0}
        if law is not None:
            self.ground = LawGround(self.ground, law.begin(trial))

    def view(self, shares: Mapping[str, float]) -> SoleView:
        """Return what the foot feels, and where it knows to be."""
        del shares
        return super().view(self._known)


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


class Pushes(NamedTuple):
    """What is to be pushed over: the law of a training set."""

    pool: Path
    terrain: str
    number: int
    trials: int
    has_creep: bool


def law_of(pool: Path, terrain: str, number: int) -> ContactLaw:
    """Return the law of a training set."""
    law = fit_contact_law(load_pool(pool, terrain, FIRST + number, PER_SET), 0)
    if law is None:
        raise SystemExit(f"{terrain}: no law, too few releases.")
    return law


def one(work: Pushes) -> tuple[Driven, Driven]:
    """Return pushes over the law of a training set, and over constant friction."""
    pool, terrain, number, trials, has_creep = work
    law = law_of(pool, terrain, number)
    if not has_creep:
        law = replace(law, numbers=law.numbers._replace(creep=0.0))
    mu = constant_friction(load_pool(pool, terrain, FIRST + number, PER_SET))
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


def stood(work: tuple[Path, str]) -> list[tuple[str, StanceTotals, StanceTotals]]:
    """Return stances on the simulated ground and on a law, by policy.

    What avoid-slip knows of the terrain was learnt on the simulated ground.
    """
    pool, terrain = work
    law = law_of(pool, terrain, 0)
    tables = risk_tables(learn_break_away({terrain: taught(terrain, STANCE_SEED)}))
    request, rows = StanceRequest(PEAK, RISK), []
    for name in ("none", "constant-mu", "avoid-slip"):
        plan = StancePlan(POLICIES[name], request, STANCES, TRAVEL, 0.0, tables)
        true, made = (
            totals(
                stances(terrain, plan, STANCE_SEED, BEDS, None, partial(KnownBench, x)),
                request,
            )
            for x in (None, law)
        )
        assert true is not None
        assert made is not None
        rows.append((name, true, made))
    return rows


def numbers_of(pool: Path, terrains: Sequence[str], sets: int) -> list[str]:
    """Return the numbers of laws, and how often intervals hold those of other sets."""
    held: dict[str, list[bool]] = {}
    lines = []
    for terrain in terrains:
        laws = [law_of(pool, terrain, k) for k in range(sets)]
        numbers = np.array([list(law.numbers) for law in laws])
        columns = zip(ContactNumbers._fields, numbers.T, strict=True)
        shown = [f"{k} {n.mean():.3g} ± {n.std():.2g}" for k, n in columns]
        lines.append(f"{terrain}: {', '.join(shown)}")
        for first, second in permutations(laws, 2):
            for name, (_, lower, upper) in first.intervals.items():
                is_held = lower <= getattr(second.numbers, name) <= upper
                held.setdefault(name, []).append(is_held)
    lines += [f"{name}: held {np.mean(hits):.0%}" for name, hits in held.items()]
    every = np.mean([hit for hits in held.values() for hit in hits])
    return [*lines, f"all: {every:.0%}"]


def drawn(pool: Path, terrain: str) -> bytes:
    """Return a picture of the same hand over ground, law and constant friction, PNG."""
    law = law_of(pool, terrain, 0)
    mu = constant_friction(load_pool(pool, terrain, FIRST, PER_SET))
    grounds = {
        "simulated ground": None,
        "contact law": law.begin(0),
        f"constant friction, {mu:.2f}": CoulombLaw(mu),
    }
    with styled():
        figure, axes = panel_grid(3, 1.6, most_columns=1)
        for ax, (name, one_law) in zip(axes, grounds.items(), strict=True):
            foot = PointFoot(terrain, DRIVEN_SEED, 0)
            if one_law is not None:
                foot.ground = LawGround(foot.ground, one_law)
            smooth = prepare_trial(foot.run(), PrepareOptions()).smooth
            ax.plot(smooth.t, smooth.F_t, color="black", lw=0.6)
            ax.set_title(name, loc="left")
            ax.set_ylim(-2.0, 24.0)
            ax.set_xlim(0.0, 12.0)
        figure.supxlabel("time [s]", fontsize=8)
        figure.supylabel(FORCE_LABEL, fontsize=8)
        return render("contact_law", figure, True).png


def main() -> int:
    """Print the tables."""
    parser = argparse.ArgumentParser(description="A contact law in the hand's loop.")
    parser.add_argument("pool", type=Path)
    parser.add_argument("--terrains", default=",".join(STONES))
    parser.add_argument("--sets", type=int, default=5)
    parser.add_argument("--trials", type=int, default=20)
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--stances", action="store_true")
    parser.add_argument("--no-creep", action="store_true")
    parser.add_argument("--numbers", action="store_true")
    parser.add_argument("--figure", type=Path)
    args = parser.parse_args()
    names = args.terrains.split(",")
    if args.figure:
        args.figure.write_bytes(drawn(args.pool, names[0]))
    if args.numbers:
        sys.stdout.write("\n".join(numbers_of(args.pool, names, args.sets)) + "\n")
        return 0
    with get_context("spawn").Pool(args.jobs) as processes:
        if args.stances:
            work = [(args.pool, name) for name in names]
            for name, rows in zip(names, processes.imap(stood, work), strict=True):
                for policy, true, made in rows:
                    sys.stdout.write(
                        f"{name:4}{policy:12} slips {true.slips:.3f} "
                        f"({true.low:.2f}-{true.high:.2f}), law {made.slips:.3f} "
                        f"({made.slips - true.slips:+.3f})  traction "
                        f"{true.traction:.2f} N, law {made.traction:.2f} N\n"
                    )
                sys.stdout.flush()
            return 0
        for name in names:
            true = driven(load_trials(args.pool, name, TESTED_SEED, TESTED))
            sys.stdout.write(
                f"{name}: simulated ground, slips {true.slips:.1f}/m, peak "
                f"{true.peak:.1f} N, mean {true.force:.1f} N\n"
            )
            work = [
                Pushes(args.pool, name, k, args.trials, not args.no_creep)
                for k in range(args.sets)
            ]
            for k, (made, constant) in enumerate(processes.imap(one, work), 1):
                sys.stdout.write(f"  set {k}, law    {compared(made, true)}\n")
                sys.stdout.write(f"  set {k}, mu     {compared(constant, true)}\n")
                sys.stdout.flush()
    return 0


if __name__ == "__main__":
    sys.exit(main())
