"""Does the advised push teach more than a random one? Takes a quarter of an hour.

python -m studies.next_push POOL [--terrains S0,TF] [--seeds 10]

POOL is a folder of simulated trials, made where it is missing: on every terrain a point
foot is pushed seven times at each of nine aims, three speeds of the hand by three
angles, with an operator's scatter on top. A seed plays a session of ten trials several
ways, each drawing from the same trials: by the advice for the grid, for the firm and
fast corner and for break-away, into the emptiest cell, at random, always as usual.

Printed are, by terrain and in all, the trials until the target is known as well as
after ten random ones, NLPD of left-out trials, and what stopping at "enough" costs.
"""

import argparse
import json
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from analysis.data.prepare import PreparedTrial, PrepareOptions, prepare_trial
from analysis.next_push.advice import advise
from analysis.next_push.aims import AIMS
from analysis.next_push.knowledge import Knowledge
from analysis.next_push.records import PushRecord, push_record
from analysis.next_push.stopping import points_of, slip_information, stopping_of
from fakes.plant.push import Pace
from tests.fakes.point_foot import GROUNDS, PointFoot

SPEEDS, ANGLES = (0.02, 0.04, 0.075), (-3.0, 5.0, 14.0)  # m/s, degrees
SPREAD = 3.0  # of the angle between trials [degrees]
PER_AIM, TESTED = 7, 2  # trials of an aim, of which so many are left out
TRIALS = 10  # of a session
FIRST = (0, 1, 0, 1, 2, 1, 0, 1, 0)  # worth of aims: the middle one, then beside it
TARGETS = ("grid", "corner", "break-away")
SAVED = {"grid": 0.05, "corner": 0.08}  # shares of the trials, at least
NOISE = 0.02  # nat; NLPD after as many trials may differ by this
CORNER = (5.0, 0.045)  # N, m/s from which on a sample belongs to the corner
SPEED_EDGES, LOAD_EDGES = (0.0, 0.01, 0.05, 0.2, 9.0), (-9.0, 2.0, 5.0, 10.0, 99.0)
MOST_REGRET = 0.02  # nat

Choice = Callable[[Sequence[PushRecord], np.random.Generator], Sequence[float]]


@dataclass(frozen=True)
class PoolTrial:
    """What is needed of one simulated trial: its record, every fifth kept sample."""

    record: PushRecord
    rows: np.ndarray  # F_n, v_t, F_t; shape (m, 3)

    @classmethod
    def of(cls, trial: PreparedTrial) -> "PoolTrial":
        record = push_record(trial)
        assert record is not None
        return cls(record, np.column_stack([trial.F_n, trial.v_t, trial.F_t])[::5])


Pool = Sequence[Sequence[PoolTrial]]  # trials by aim, in the order of AIMS


def make_pool(folder: Path, terrain: str, per_aim: int = PER_AIM) -> Pool:
    """Return trials of a terrain by aim, from the disk or simulated and put there."""
    path = folder / f"{terrain}.json"
    if not path.is_file():
        folder.mkdir(parents=True, exist_ok=True)
        pool = [
            [PoolTrial.of(simulate(terrain, aim, k)) for k in range(per_aim)]
            for aim in range(len(AIMS))
        ]
        plain = [
            [(t.record.plain(), t.rows.tolist()) for t in trials] for trials in pool
        ]
        path.write_text(json.dumps(plain))
    plain = json.loads(path.read_text())
    return [
        [
            PoolTrial(record, np.array(rows))
            for fields, rows in trials
            if (record := PushRecord.from_plain(fields)) is not None
        ]
        for trials in plain
    ]


def simulate(terrain: str, aim: int, k: int) -> PreparedTrial:
    """Return the trial `k` of a hand at an aim; loads come first in `AIMS`."""
    angle, speed = divmod(aim, len(SPEEDS))
    pace = Pace(speed=SPEEDS[speed], press_deg=ANGLES[angle], press_spread_deg=SPREAD)
    seed = 1000 + speed * len(ANGLES) + angle
    return prepare_trial(PointFoot(terrain, seed, k, pace).run(), PrepareOptions())


@dataclass(frozen=True)
class Session:
    """One session played: what was known after every trial, by target.

    Attributes:
        sd: of the function at the target [N], rms; for break-away the geometric mean
            of the standard deviations of its two parameters.
        nlpd: of left-out samples of the target [nat]; for break-away what the two
            parameters add to it.
        enough: after how many trials it was enough; all where never.
    """

    sd: Mapping[str, np.ndarray]
    nlpd: Mapping[str, np.ndarray]
    enough: Mapping[str, int]

    def regret(self, target: str) -> float:
        """What stopping costs in NLPD over all trials."""
        curve = self.nlpd[target]
        return float(curve[self.enough[target] - 1] - curve[-1])


def play(
    pool: Pool, kind: str, choose: Choice, theta: np.ndarray, seed: int
) -> Session:
    """Return a session of ten trials; a seed leaves out and draws the same trials."""
    rng = np.random.default_rng(seed)
    orders = [rng.permutation(len(trials)).tolist() for trials in pool]
    left = [pool[a][o.pop()].rows for a, o in enumerate(orders) for _ in range(TESTED)]
    records: list[PushRecord] = []
    sd: dict[str, list[float]] = {target: [] for target in TARGETS}
    nlpd: dict[str, list[float]] = {target: [] for target in TARGETS}
    enough: dict[str, int] = {}
    while len(records) < TRIALS:
        worth = np.array(choose(records, rng), dtype=float)
        is_there = np.array([bool(order) for order in orders])
        aim = int(np.argmax(np.where(is_there, worth, -np.inf)))
        trial = pool[aim][orders[aim].pop()]
        records.append(replace(trial.record, aim=AIMS[aim]))
        known, fitted = Knowledge.at(records, theta), Knowledge.of(records, kind)
        for target in TARGETS:
            sd[target].append(spread_of(known, target))
            nlpd[target].append(density(fitted, target, left))
            stopping = stopping_of(records, kind, target)
            if stopping is not None and stopping.is_enough:
                enough.setdefault(target, len(records))
    ends = {target: enough.get(target, TRIALS) for target in TARGETS}
    curves = [{k: np.array(v) for k, v in each.items()} for each in (sd, nlpd)]
    return Session(curves[0], curves[1], ends)


def spread_of(known: Knowledge, target: str) -> float:
    if target == "break-away":
        return float(
            np.exp(-0.25 * np.linalg.slogdet(slip_information(known.records))[1])
        )
    return float(np.sqrt(known.function(points_of(target))[1].mean()))


def density(known: Knowledge, target: str, left: Sequence[np.ndarray]) -> float:
    """Return the NLPD of left-out samples, each trial with the same weight [nat]."""
    if target == "break-away":
        left_open = np.linalg.inv(slip_information(known.records))
        ends = np.array([[1.0, 1.0], np.log([0.5, 2.0])])  # at 1.75 and 7 N
        return float(0.5 * np.einsum("ie,ij,je->e", ends, left_open, ends).mean())
    each = []
    for trial in left:
        is_firm, is_fast = trial[:, 0] > CORNER[0], trial[:, 1] > CORNER[1]
        rows = trial[is_firm & is_fast] if target == "corner" else trial
        if len(rows):
            mean, variance = known.new_trial(rows[:, :2])
            far = (rows[:, 2] - mean) ** 2 / variance
            each.append(0.5 * float(np.mean(far + np.log(2.0 * np.pi * variance))))
    return float(np.mean(each)) if each else 0.0


def emptiest(pool: Pool) -> Choice:
    """Return the choice of the aim whose trials lie in the emptiest cells."""
    cells = [sum(cells_of(trial.rows) for trial in trials) for trials in pool]

    def choose(
        records: Sequence[PushRecord], rng: np.random.Generator
    ) -> Sequence[float]:
        if not records:
            return FIRST
        counts = sum(
            cells_of(np.column_stack([r.F_n, r.v_t])) / r.F_n.size for r in records
        )
        missing = 1.0 / (counts + 0.02 * len(records))
        return [float((c / np.sum(c) * missing).sum()) for c in cells]

    return choose


def cells_of(rows: np.ndarray) -> np.ndarray:
    """Return samples per cell of velocity and load, shape (4, 4)."""
    edges = (SPEED_EDGES, LOAD_EDGES)
    return np.histogram2d(rows[:, 1], rows[:, 0], bins=edges)[0]


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
    theta = Knowledge.of([t.record for trials in pool for t in trials[:4]], kind).theta
    ways: dict[str, Choice] = {
        "random": lambda records, rng: rng.uniform(size=len(AIMS)).tolist(),
        "usual": lambda records, rng: FIRST,
        "emptiest": emptiest(pool),
        **{target: advised(kind, target) for target in TARGETS},
    }
    return {
        way: [play(pool, kind, choose, theta, seed) for seed in range(seeds)]
        for way, choose in ways.items()
    }


def trials_for(level: float, curve: np.ndarray) -> float:
    """Return after how many trials a falling curve comes to a level.

    Between trials it is a straight line, beyond the last one it goes on as the inverse
    root of the trials.
    """
    reached = np.flatnonzero(curve <= level)
    if not reached.size:
        return float(curve.size * (curve[-1] / level) ** 2)
    k = int(reached[0])
    if k == 0:
        return 1.0
    return float(k + (curve[k - 1] - level) / (curve[k - 1] - curve[k]))


def saved(sessions: Mapping[str, Sequence[Session]], way: str, target: str) -> float:
    """Return the share of the trials that a way saves over ten random ones.

    Of the mean curves over the seeds: that of one session may take a jump.
    """
    curve, random = (
        np.mean([s.sd[target] for s in sessions[w]], axis=0) for w in (way, "random")
    )
    return 1.0 - trials_for(float(random[-1]), curve) / TRIALS


Every = Mapping[str, Mapping[str, Sequence[Session]]]  # by terrain and way


def table(every: Every) -> list[str]:
    """Return the lines of all terrains."""
    lines = ["trials saved over ten random ones, mean of the terrains and by terrain"]
    for target in TARGETS:
        for way in (target, "emptiest", "usual"):
            each = {n: saved(s, way, target) for n, s in every.items()}
            terrains = "  ".join(f"{n} {v:+.0%}" for n, v in each.items())
            lines.append(f"{target:10} by {way:10} {mean_error(each)}   {terrains}")
    for target in ("grid", "corner"):
        gaps = [f"{J}: {with_error(gap(every, target, J))}" for J in (3, 4, 6, 8, 10)]
        lines.append(f"NLPD of {target}, its advice minus random, {', '.join(gaps)}")
    for target in TARGETS:
        stops = [x.enough[target] for s in every.values() for x in s[target]]
        lost = np.array([x.regret(target) for s in every.values() for x in s[target]])
        terrains = "  ".join(
            f"{n} {np.mean([x.enough[target] for x in s[target]]):.1f}/"
            f"{np.mean([x.regret(target) for x in s[target]]):+.3f}"
            for n, s in every.items()
        )
        lines.append(
            f"enough for {target} after {np.mean(stops):.1f} trials, costs "
            f"{with_error(lost)} nat; {terrains}"
        )
    return lines


def mean_error(each: Mapping[str, float]) -> str:
    values = np.array(list(each.values()))
    error = values.std(ddof=1) / np.sqrt(values.size) if values.size > 1 else 0.0
    return f"{values.mean():+7.1%} ± {error:.1%}"


def with_error(values: np.ndarray) -> str:
    error = values.std(ddof=1) / np.sqrt(values.size) if values.size > 1 else 0.0
    return f"{values.mean():+.3f} ± {error:.3f}"


def gap(every: Every, target: str, trials: int) -> np.ndarray:
    """Return by how much the advice is worse than random pushes, by session."""
    return np.array(
        [
            a.nlpd[target][trials - 1] - b.nlpd[target][trials - 1]
            for s in every.values()
            for a, b in zip(s[target], s["random"], strict=True)
        ]
    )


def shortfalls(every: Every) -> list[str]:
    """Return what is missed of what is wanted."""
    missed = []
    for target, least in SAVED.items():
        share = float(np.mean([saved(s, target, target) for s in every.values()]))
        if share < least:
            missed.append(f"{target}: saves {share:.1%} (wanted {least:.0%})")
        for J in (4, 6, 8, 10):
            worse = gap(every, target, J)
            if worse.mean() > NOISE:
                missed.append(f"{target}: NLPD {worse.mean():+.3f} after {J}")
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
