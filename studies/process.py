"""Does a sampled ground look like the recorded one? Takes half an hour.

python -m studies.process POOL [--terrains S0,TF] [--sets 5] [--tested 100]
python -m studies.process POOL --events

POOL is a folder of simulated trials, made where it is missing: on every terrain a point
foot is pushed in five training sets of ten trials and in a hundred trials that are only
tested. Seeds are those that nothing was chosen by.

Of every training set a generator is fitted and run along the tested trials, beside
independent rows of the bands and an Ornstein-Uhlenbeck residual in way and time.
Printed are energy and variogram score, events and the test of sticks of 20 s.
`--events` fits nothing: it says how often the interval of a value of events and
mobilisation by one training set holds that by another.
"""

import argparse
import json
import sys
import time
from collections.abc import Mapping, Sequence
from itertools import permutations
from pathlib import Path

import numpy as np
from scipy.optimize import minimize
from scipy.special import ndtr, ndtri
from threadpoolctl import threadpool_limits

from analysis.data.prepare import PreparedTrial, PrepareOptions, prepare_trial
from analysis.data.series import Array, TractionSeries
from analysis.findings.mobilisation import mobilisation_of
from analysis.study.new_trial import NewTrialModel
from analysis.terrains.generator import Draws
from analysis.terrains.generator_fit import (
    band_model,
    clipped,
    fit_generator,
    held_drift,
)
from analysis.terrains.process_rows import STEP, ProcessTrial, every_process_trial
from analysis.terrains.process_scores import (
    PLATE_DROP,
    STONES_DROP,
    correlation_time,
    energy_score,
    events_of,
    ks_distance,
    variogram_score,
)
from tests.fakes.point_foot import GROUNDS, PointFoot

FIRST, TESTED_SEED = 4801, 4900  # seeds of the first training set and the tested ones
PER_SET, PATHS, COUNTED = 10, 16, 4  # trials, paths of a trial, those with events
SCORES = tuple(np.linspace(-4.0, 4.0, 65).tolist())  # normal scores of the bands
Outcome = dict[str, float]


def load_pool(folder: Path, terrain: str, seed: int, count: int) -> list[ProcessTrial]:
    """Return trials of a terrain as processes; see `load_trials`."""
    return list(every_process_trial(load_trials(folder, terrain, seed, count)))


def load_trials(
    folder: Path, terrain: str, seed: int, count: int
) -> list[PreparedTrial]:
    """Return trials of a terrain, from the disk or simulated and put there."""
    path = folder / f"{terrain}-{seed}.npz"
    if not path.is_file():
        folder.mkdir(parents=True, exist_ok=True)
        made = {f"{k:03d}": simulate(terrain, seed, k) for k in range(count)}
        np.savez(path, allow_pickle=False, **made)
    with np.load(path, allow_pickle=False) as stored:
        tables = [stored[key].astype(float) for key in sorted(stored)[:count]]
    series = [
        TractionSeries(terrain, f"{seed}-{k}", np.round(x[:, 0], 6), *x[:, 1:].T)
        for k, x in enumerate(tables)
    ]
    return [prepare_trial(s, PrepareOptions()) for s in series]


def simulate(terrain: str, seed: int, k: int) -> np.ndarray:
    """Return one trial as columns t, v_t, F_n, F_t, shape (n, 4)."""
    s = PointFoot(terrain, seed, k).run()
    return np.column_stack([s.t, s.v_t, s.F_n, s.F_t]).astype(np.float32)


class Residual:
    """The normal scores of a trial as an Ornstein-Uhlenbeck process in way and time."""

    def __init__(self, model: NewTrialModel, trials: Sequence[ProcessTrial]) -> None:
        self._model = model
        made = [model.predict(*clipped(t)) for t in trials]
        self.eta = float(
            np.mean([np.mean(m.between / (m.between + m.within)) for m in made])
        )
        q = [
            ndtri(np.clip(m.cdf(t.F_t), 1e-4, 1.0 - 1e-4))
            for m, t in zip(made, trials, strict=True)
        ]

        def cost(theta: Array) -> float:
            value = 0.0
            for scores, trial in zip(q, trials, strict=True):
                rho = self.rho(trial, theta)
                left = 1.0 - rho**2
                far = scores[1:] - rho * scores[:-1]
                value += float(np.sum(0.5 * np.log(left) + 0.5 * far**2 / left))
            return value

        box = [(np.log(0.02), np.log(20.0)), (np.log(1e-3), np.log(10.0))]
        self.theta = minimize(
            cost, np.log([1.0, 0.02]), method="L-BFGS-B", bounds=box
        ).x

    @staticmethod
    def rho(trial: ProcessTrial, theta: Array) -> Array:
        tau, length = np.exp(theta)
        way = STEP * np.abs(trial.v_t[1:])
        return np.minimum(np.exp(-STEP / tau - way / length), 1.0 - 1e-6)

    def sample(
        self, trial: ProcessTrial, rng: np.random.Generator, *, is_white: bool
    ) -> Array:
        """Return paths, shape (16, T); white: every row by itself."""
        T = trial.F_t.size
        e = rng.standard_normal((PATHS, T))
        if not is_white:
            rho = self.rho(trial, self.theta)
            for i in range(1, T):
                e[:, i] = rho[i - 1] * e[:, i - 1]
                e[:, i] += np.sqrt(1 - rho[i - 1] ** 2) * rng.standard_normal(PATHS)
            level = rng.standard_normal((PATHS, 1))
            e = np.sqrt(self.eta) * level + np.sqrt(1.0 - self.eta) * e
        forces = self._model.predict(*clipped(trial)).quantiles(ndtr(np.array(SCORES)))
        at = np.clip(
            np.interp(e, SCORES, np.arange(len(SCORES))), 0, len(SCORES) - 1.01
        )
        k = at.astype(int)
        columns = np.arange(T)
        return forces[k, columns] + (at - k) * (
            forces[k + 1, columns] - forces[k, columns]
        )


def judged(
    paths: Sequence[Array], trials: Sequence[ProcessTrial], least: float
) -> Outcome:
    """Return how like the recorded trials the paths are."""
    true = events_of([t.F_t for t in trials], trials, least)
    made = events_of([p[:COUNTED] for p in paths], trials, least)
    pairs = list(zip(paths, trials, strict=True))
    recorded = np.concatenate([t.F_t for t in trials])
    times = [
        correlation_time(f)
        for f in ([t.F_t for t in trials], [p[:COUNTED] for p in paths])
    ]
    off = [abs(p.mean() - t.F_t.mean()) for p, t in pairs]
    return {
        "ES": float(np.mean([energy_score(p, t.F_t) for p, t in pairs])),
        "VS": float(np.mean([variogram_score(p, t.F_t) for p, t in pairs])),
        "slips": _ratio(made.slips_per_metre, true.slips_per_metre) - 1.0,
        "drops": _ratio(made.drops_per_metre, true.drops_per_metre) - 1.0,
        "KS way": ks_distance(made.ways, true.ways),
        "KS drop": ks_distance(made.drops, true.drops),
        "KS impulse": ks_distance(made.impulses, true.impulses),
        "sd": float(np.std(np.concatenate([p.ravel() for p in paths])) / recorded.std())
        - 1.0,
        "time": times[1] / times[0] - 1.0,
        "off": float(np.max(off)),
    }


def _ratio(made: float, true: float) -> float:
    return made / true if true > 0.0 else 1.0


def one(
    pool: Path, terrain: str, number: int, tested: Sequence[ProcessTrial]
) -> dict[str, Outcome]:
    """Return the outcome of one training set by the way forces are drawn."""
    trials = load_pool(pool, terrain, FIRST + number, PER_SET)
    least = PLATE_DROP if terrain.startswith("T") else STONES_DROP
    started = time.process_time()
    generator = fit_generator(trials, seed=0, least=least)
    seconds = time.process_time() - started
    if generator is None:
        return {}
    residual = Residual(band_model(trials, 0), trials)
    rng = np.random.default_rng(number)
    longest = max(t.F_t.size for t in tested)
    draws = Draws.of(number, PATHS * len(tested), longest, generator.trials)
    drawn: dict[str, list[Array]] = {
        "rows": [residual.sample(t, rng, is_white=True) for t in tested],
        "OU": [residual.sample(t, rng, is_white=False) for t in tested],
        "generator": generator.run([(t.F_n, t.v_t) for t in tested], draws),
    }
    found = {name: judged(paths, tested, least) for name, paths in drawn.items()}
    found["generator"] |= {
        "fit": seconds,
        "experts": generator.size,
        "held": held_drift(generator, trials, 1),
    }
    return found


def main() -> int:
    parser = argparse.ArgumentParser(description="Sampled ground against trials.")
    parser.add_argument("pool", type=Path)
    parser.add_argument("--terrains", default=",".join(GROUNDS))
    parser.add_argument("--sets", type=int, default=5)
    parser.add_argument("--tested", type=int, default=100)
    parser.add_argument("--events", action="store_true")
    args = parser.parse_args()
    terrains = args.terrains.split(",")
    if args.events:
        sys.stdout.write("\n".join(held_events(args.pool, terrains, args.sets)) + "\n")
        return 0
    every: dict[str, list[dict[str, Outcome]]] = {name: [] for name in terrains}
    with threadpool_limits(1):
        tested = {
            name: load_pool(args.pool, name, TESTED_SEED, 100)[: args.tested]
            for name in terrains
        }
        for number in range(args.sets):
            for name in terrains:
                found = one(args.pool, name, number, tested[name])
                every[name].append(found)
                sys.stdout.write(line(name, number, found) + "\n")
                sys.stdout.flush()
            (args.pool / "outcomes.json").write_text(json.dumps(every))
    sys.stdout.write("\n".join(summary(every)) + "\n")
    return 0


def held_events(pool: Path, terrains: Sequence[str], sets: int) -> list[str]:
    """Return how often intervals of one training set hold the values of another."""
    held: dict[str, list[bool]] = {}
    straight: list[float] = []
    for terrain in terrains:
        least = PLATE_DROP if terrain.startswith("T") else STONES_DROP
        each = [
            mobilisation_of(load_pool(pool, terrain, FIRST + k, PER_SET), least)
            for k in range(sets)
        ]
        known = [one for one in each if one is not None]
        straight += [one.straight for one in known]
        for first, second in permutations(known, 2):
            for name, interval in first.values.items():
                value = second.values[name].value
                is_held = interval.lower <= value <= interval.upper
                held.setdefault(name, []).append(is_held)
    lines = [f"{name}: held {np.mean(hits):.0%}" for name, hits in held.items()]
    every = np.mean([hit for hits in held.values() for hit in hits])
    return [
        f"{', '.join(terrains)}: intervals of one set hold another's value",
        *lines,
        f"all: {every:.0%}",
        f"straight loadings: {min(straight):.0%} to {max(straight):.0%}",
    ]


def summary(every: Mapping[str, Sequence[Mapping[str, Outcome]]]) -> list[str]:
    """Return the lines of all stones and all plates."""
    lines = []
    for kind, is_plate in (("stones", False), ("plates", True)):
        sets = [
            found
            for name, outcomes in every.items()
            for found in outcomes
            if name.startswith("T") == is_plate
        ]
        kept = [found for found in sets if found]
        if not kept:
            continue
        own = [found["generator"] for found in kept]
        energy = [f["generator"]["ES"] / f["rows"]["ES"] for f in kept]
        texture = [f["generator"]["VS"] / f["OU"]["VS"] for f in kept]
        events = ("slips", "drops", "sd", "time")
        parts = [
            f"{kind}: {len(sets)} training sets, {len(sets) - len(kept)} without",
            f"energy score over rows, median {np.median(energy):.2f}, largest "
            f"{max(energy):.2f}; variogram over OU {np.median(texture):.2f}, "
            f"largest {max(texture):.2f}",
            "median of |relative error|: "
            + ", ".join(
                f"{k} {np.median([abs(g[k]) for g in own]):.2f}" for k in events
            ),
            "median of KS: "
            + ", ".join(
                f"{k[3:]} {np.median([g[k] for g in own]):.2f}"
                for k in ("KS way", "KS drop", "KS impulse")
            ),
            f"largest: mean of a trial off {max(g['off'] for g in own):.1f} N, "
            f"held {max(g['held'] for g in own):.2f} N, "
            f"fit {max(g['fit'] for g in own):.1f} s of one core",
        ]
        lines += [parts[0], *(f"  {part}" for part in parts[1:])]
    return lines


def line(terrain: str, number: int, found: Mapping[str, Outcome]) -> str:
    """Return the line of one training set."""
    if not found:
        return f"{terrain:4} set {number + 1}: none is stable"
    g, rows, ou = found["generator"], found["rows"], found["OU"]
    scores = f"ES {g['ES'] / rows['ES']:.2f} (OU {ou['ES'] / rows['ES']:.2f})"
    scores += f"  VS {g['VS'] / ou['VS']:.2f}"
    events = "  ".join(f"{k} {g[k]:+.2f}" for k in ("slips", "drops", "sd", "time"))
    ks = " ".join(f"{g[k]:.2f}" for k in ("KS way", "KS drop", "KS impulse"))
    return (
        f"{terrain:4} set {number + 1}: {g['experts']:.0f} experts  {scores}  "
        f"{events}  KS {ks}  off {g['off']:.1f}  held {g['held']:.2f}  "
        f"fit {g['fit']:.1f} s"
    )


if __name__ == "__main__":
    sys.exit(main())
