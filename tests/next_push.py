"""Does the advised push teach more than a random one? Takes a quarter of an hour.

python -m tests.next_push POOL [--terrains S0,TF] [--seeds 10]

POOL is a folder of simulated trials, made where it is missing: on every terrain a point
foot is pushed eight times at each of nine aims, three speeds of the hand by three
angles, with an operator's scatter on top. A seed plays a session of ten trials several
ways, each drawing from the same trials: by the advice for the grid, for the firm and
fast corner and for break-away, into the emptiest cell, at random, always as usual.

Printed are, by terrain and in all, the trials until the target is known as well as
after ten random ones, NLPD of left-out trials, and what stopping at "enough" costs.
"""

import argparse
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from analysis.data import (
    CoverageGrid,
    PreparedTrial,
    PrepareOptions,
    coverage,
    prepare_trial,
)
from analysis.data.series import TractionSeries
from analysis.next_push import Knowledge, PushRecord, advise, push_record, stopping_of
from analysis.next_push.advice import AIMS
from analysis.next_push.stopping import points_of, slip_information
from fakes.plant.push import Pace
from tests.fakes.point_foot import GROUNDS, PointFoot

SPEEDS, ANGLES = (0.02, 0.04, 0.075), (-3.0, 5.0, 14.0)  # m/s, degrees
SPREAD = 3.0  # of the angle between trials [degrees]
PER_AIM, TESTED = 8, 2  # trials of an aim, of which so many are left out
TRIALS = 10  # of a session
FIRST = (0, 1, 0, 1, 2, 1, 0, 1, 0)  # worth of aims: the middle one, then beside it
TARGETS = ("grid", "corner", "break-away")
SAVED = {"grid": 0.05, "corner": 0.08}  # shares of the trials, at least
NOISE = 0.02  # log N; NLPD after as many trials may differ by this
MOST_REGRET = 0.02  # log N

Pool = Sequence[Sequence[PreparedTrial]]  # trials by aim
Choice = Callable[[Sequence[PushRecord], np.random.Generator], Sequence[float]]


def make_pool(folder: Path, terrain: str, per_aim: int = PER_AIM) -> Pool:
    """Return trials of a terrain by aim, in the order of `AIMS`, from disk or new."""
    path = folder / f"{terrain}.npz"
    if not path.is_file():
        folder.mkdir(parents=True, exist_ok=True)
        columns = {}
        for place, (angle, speed) in enumerate(hands()):
            pace = Pace(speed=speed, press_deg=angle, press_spread_deg=SPREAD)
            for k in range(per_aim):
                run = PointFoot(terrain, 1000 + place, k, pace).run()
                columns[f"{place}-{k}"] = np.array([run.t, run.v_t, run.F_n, run.F_t])
        np.savez(path, **columns)
    with np.load(path) as file:
        return [
            [
                prepare_trial(
                    TractionSeries(terrain, f"{a}-{k}", *file[f"{a}-{k}"]),
                    PrepareOptions(),
                )
                for k in range(per_aim)
            ]
            for a in range(len(AIMS))
        ]


def hands() -> list[tuple[float, float]]:
    """Return angle [degrees] and speed [m/s] of the hand at every aim."""
    return [(angle, speed) for angle in ANGLES for speed in SPEEDS]


@dataclass(frozen=True)
class Session:
    """One session played: what was known after every trial.

    Attributes:
        sd: of the function on grid and corner [N], by trial, and the information
            about break-away [nats], by target.
        nlpd: of left-out trials, by trial [log N].
        enough: after how many trials it was enough, by target; all where never.
    """

    sd: Mapping[str, np.ndarray]
    nlpd: np.ndarray
    enough: Mapping[str, int]

    def regret(self, target: str) -> float:
        """What stopping costs in NLPD over all trials."""
        return float(self.nlpd[self.enough[target] - 1] - self.nlpd[-1])


def play(
    pool: Pool, kind: str, choose: Choice, theta: np.ndarray, seed: int
) -> Session:
    """Return a session of ten trials; a seed leaves out and draws the same trials."""
    rng = np.random.default_rng(seed)
    orders = [rng.permutation(len(of)).tolist() for of in pool]
    tested = [
        push_record(pool[a][order.pop()])
        for a, order in enumerate(orders)
        for _ in range(TESTED)
    ]
    left = [r for r in tested if r is not None]
    records: list[PushRecord] = []
    sd: dict[str, list[float]] = {target: [] for target in TARGETS}
    nlpd, enough = [], {}
    while len(records) < TRIALS:
        worth = np.array(choose(records, rng), dtype=float)
        is_there = np.array([bool(order) for order in orders])
        aim = int(np.argmax(np.where(is_there, worth, -np.inf)))
        record = push_record(pool[aim][orders[aim].pop()], AIMS[aim])
        if record is None:
            continue
        records.append(record)
        known = Knowledge.at(records, theta)
        for target in ("grid", "corner"):
            variance = known.function(points_of(target))[1]
            sd[target].append(float(np.sqrt(variance.mean())))
        information = np.linalg.slogdet(slip_information(records))[1]
        sd["break-away"].append(float(np.exp(-0.25 * information)))
        nlpd.append(density(Knowledge.of(records, kind), left))
        for target in TARGETS:
            told = stopping_of(records, kind, target)
            if told is not None and told.is_enough:
                enough.setdefault(target, len(records))
    ends = {target: enough.get(target, TRIALS) for target in TARGETS}
    return Session({k: np.array(v) for k, v in sd.items()}, np.array(nlpd), ends)


def density(known: Knowledge, left: Sequence[PushRecord]) -> float:
    """Return the NLPD of trials left out, each with the same weight [log N]."""
    each = []
    for record in left:
        mean, variance = known.new_trial(np.column_stack([record.F_n, record.v_t]))
        far = (record.F_t - mean) ** 2 / variance
        each.append(0.5 * float(np.mean(far + np.log(2.0 * np.pi * variance))))
    return float(np.mean(each))


def emptiest(pool: Pool) -> Choice:
    """Return the choice of the aim whose trials lie in the emptiest cell."""
    cells = [coverage(of).counts for of in pool]

    def choose(
        records: Sequence[PushRecord], rng: np.random.Generator
    ) -> Sequence[float]:
        if not records:
            return FIRST
        counts = np.zeros((4, 4))
        for record in records:
            counts += CoverageGrid(coverage_of(record)).shares
        missing = 1.0 / (counts + 0.02 * len(records))
        return [float((c / c.sum() * missing).sum()) for c in cells]

    return choose


def coverage_of(record: PushRecord) -> np.ndarray:
    cells = ((0.0, 0.01, 0.05, 0.2, np.inf), (0.0, 2.0, 5.0, 10.0, np.inf))
    counts, _, _ = np.histogram2d(np.abs(record.v_t), record.F_n, bins=cells)
    return counts.astype(np.int64)


def advised(kind: str, target: str) -> Choice:
    """Return the choice by the advice; the first push is as usual."""

    def choose(
        records: Sequence[PushRecord], rng: np.random.Generator
    ) -> Sequence[float]:
        advice = advise(records, kind, target)
        return FIRST if advice is None else advice.gains

    return choose


def play_all(pool: Pool, kind: str, seeds: int) -> dict[str, list[Session]]:
    """Return the sessions of every way to choose, seed by seed."""
    known = [r for of in pool for t in of[:4] if (r := push_record(t)) is not None]
    theta = Knowledge.of(known, kind).theta
    ways: dict[str, Choice] = {
        "random": lambda records, rng: rng.uniform(size=len(AIMS)),
        "usual": lambda records, rng: FIRST,
        "emptiest": emptiest(pool),
        **{target: advised(kind, target) for target in TARGETS},
    }
    return {
        way: [play(pool, kind, choose, theta, seed) for seed in range(seeds)]
        for way, choose in ways.items()
    }


def trials_for(level: float, curve: np.ndarray) -> float:
    """Return after how many trials a falling curve comes to a level; between trials
    it is a straight line, beyond the last one it goes on as 1 / sqrt(trials).
    """
    reached = np.flatnonzero(curve <= level)
    if not reached.size:
        return float(curve.size * (curve[-1] / level) ** 2)
    k = int(reached[0])
    if k == 0:
        return 1.0
    return float(k + (curve[k - 1] - level) / (curve[k - 1] - curve[k]))


def saved(
    sessions: Mapping[str, Sequence[Session]], way: str, target: str
) -> np.ndarray:
    """Return the share of ten trials that a way saves over random ones, by seed."""
    curves = np.array([s.sd[target] for s in sessions["random"]])
    level = float(curves.mean(axis=0)[-1])
    usual = trials_for(level, curves.mean(axis=0))
    return np.array(
        [1.0 - trials_for(level, s.sd[target]) / usual for s in sessions[way]]
    )


def mean_error(values: np.ndarray) -> str:
    error = values.std(ddof=1) / np.sqrt(values.size) if values.size > 1 else 0.0
    return f"{values.mean():+7.1%} ± {error:.1%}"


def table(every: Mapping[str, Mapping[str, Sequence[Session]]]) -> list[str]:
    """Return the lines of all terrains."""
    lines = ["trials saved over random ones, by target; the same for the other ways"]
    for target in TARGETS:
        for way in (target, "emptiest", "usual"):
            each = {n: saved(s, way, target) for n, s in every.items()}
            terrains = "  ".join(f"{n} {v.mean():+.0%}" for n, v in each.items())
            total = mean_error(np.concatenate(list(each.values())))
            lines.append(f"{target:10} by {way:10} {total}   {terrains}")
    for target in ("grid", "corner"):
        gaps = [
            f"{J}: {nlpd_gap(every, target, J).mean():+.3f}" for J in (3, 4, 6, 8, 10)
        ]
        lines.append(f"NLPD, {target} minus random, after trials {', '.join(gaps)}")
    for target in TARGETS:
        stops = np.array([x.enough[target] for s in every.values() for x in s[target]])
        lost = np.array([x.regret(target) for s in every.values() for x in s[target]])
        error = lost.std(ddof=1) / np.sqrt(lost.size)
        terrains = "  ".join(
            f"{n} {np.mean([x.enough[target] for x in s[target]]):.1f}"
            f"/{np.mean([x.regret(target) for x in s[target]]):+.3f}"
            for n, s in every.items()
        )
        lines.append(
            f"enough for {target:10} after {stops.mean():.1f} trials, costs "
            f"{lost.mean():+.3f} ± {error:.3f} log N   {terrains}"
        )
    return lines


def nlpd_gap(
    every: Mapping[str, Mapping[str, Sequence[Session]]], way: str, trials: int
) -> np.ndarray:
    """Return by how much a way is worse than random ones after trials, by session."""
    return np.array(
        [
            a.nlpd[trials - 1] - b.nlpd[trials - 1]
            for s in every.values()
            for a, b in zip(s[way], s["random"], strict=True)
        ]
    )


def shortfalls(every: Mapping[str, Mapping[str, Sequence[Session]]]) -> list[str]:
    """Return what is missed of what is wanted."""
    missed = []
    for target, least in SAVED.items():
        share = float(np.mean([saved(s, target, target) for s in every.values()]))
        if share < least:
            missed.append(f"{target}: saves {share:.1%} (wanted {least:.0%})")
        for J in (4, 6, 10):
            gap = float(nlpd_gap(every, target, J).mean())
            if gap > NOISE:
                missed.append(f"{target}: NLPD {gap:+.3f} to random after {J}")
        cost = np.mean([x.regret(target) for s in every.values() for x in s[target]])
        if cost > MOST_REGRET:
            missed.append(f"{target}: stopping costs {cost:.3f}")
    return missed


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.split("\n", 1)[0])
    parser.add_argument("pool", type=Path)
    parser.add_argument("--terrains", default=",".join(GROUNDS))
    parser.add_argument("--seeds", type=int, default=10)
    args = parser.parse_args()
    every = {}
    for terrain in args.terrains.split(","):
        kind = "flat" if terrain.startswith("T") else "stones"
        every[terrain] = play_all(make_pool(args.pool, terrain), kind, args.seeds)
    sys.stdout.write("\n".join(table(every)) + "\n")
    missed = shortfalls(every)
    sys.stdout.write("".join(f"MISSED {t}\n" for t in missed) or "all limits met\n")
    return int(bool(missed))


if __name__ == "__main__":
    sys.exit(main())
