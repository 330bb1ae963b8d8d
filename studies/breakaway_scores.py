"""Break-away models on trials left out: `python -m studies.breakaway_scores FILE`.

Trial k of every terrain is left out at a time, the family is chosen inside the other
trials, and the pushes of the trials left out are held against what was predicted. A
push that held at P says nothing of larger forces: whether a push broke away below r is
known of slips and of pushes that went beyond r, and each counts 1/G, G the probability
(Kaplan and Meier's) of not having been censored before.

Beside it stands the force in motion: P(F_t at 0.005 m/s < r) by a Gaussian process.
"""

import argparse
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from analysis.breakaway.fitting import fit_break_away
from analysis.breakaway.model import BreakAwayModel
from analysis.breakaway.pushes import FootPush, find_pushes
from analysis.breakaway.recorded import BreakAwayOptions
from analysis.breakaway.survival import kaplan_meier, pit_distance
from analysis.data.prepare import PreparedTrial, PrepareOptions, prepare_trial
from analysis.data.samples import TrainingSet
from analysis.data.tables import load_tables
from analysis.data.terrain_kinds import groups_of, terrain_kind
from analysis.study.models import GP_SE, FitOptions, ModelFitter

REQUIRED = np.arange(2.0, 20.5, 1.0)  # N
BINS = 10
LEAST_G = 0.05
SLOWEST = 0.005  # m/s
Trials = Mapping[str, Sequence[PreparedTrial]]
Risk = Callable[[np.ndarray, np.ndarray], np.ndarray]


@dataclass(frozen=True, slots=True)
class Predicted:
    """A push and the risk that a model which has not seen its trial gives, by force."""

    terrain: str
    push: FootPush
    risks: np.ndarray  # of REQUIRED
    pit: float


@dataclass(frozen=True, slots=True)
class Scores:
    slips: int
    held: int
    brier: float
    calibration_error: float
    pit: float

    @property
    def pit_limit(self) -> float:
        return 1.36 / np.sqrt(max(self.slips, 1))


def rounds(trials: Trials) -> range:
    return range(max(len(group) for group in trials.values()))


def without(trials: Trials, k: int) -> dict[str, list[PreparedTrial]]:
    return {
        name: [trial for i, trial in enumerate(group) if i != k]
        for name, group in trials.items()
    }


def from_rest(trials: Trials, kinds: Mapping[str, str]) -> list[Predicted]:
    """Return every push with the risk of the break-away model of the other trials."""
    predicted = []
    for k in rounds(trials):
        models = fit_break_away(without(trials, k), kinds, BreakAwayOptions(draws=0))
        for name, group in trials.items():
            if k < len(group) and name in models:
                predicted += _predict(name, group[k], _risk(models[name]))
    return predicted


def in_motion(trials: Trials, points: int) -> list[Predicted]:
    """Return the same by the force in motion at the slowest velocity."""
    from scipy.special import ndtr

    predicted = []
    for k in rounds(trials):
        for name, group in without(trials, k).items():
            if k >= len(trials[name]):
                continue
            training = TrainingSet.of(group, points, k)
            model = ModelFitter(training, FitOptions()).fit(GP_SE)

            def risk(required: np.ndarray, F_n: np.ndarray, gp=model) -> np.ndarray:
                answer = gp.predict(F_n, np.full(F_n.size, SLOWEST))
                return ndtr((required - answer.mean) / answer.sd)

            predicted += _predict(name, trials[name][k], risk)
    return predicted


def _risk(model: BreakAwayModel) -> Risk:
    return model.risks


def _predict(name: str, trial: PreparedTrial, risk: Risk) -> list[Predicted]:
    return [
        Predicted(
            name,
            push,
            risk(REQUIRED, np.full(REQUIRED.size, push.F_n)),
            float(risk(np.array([push.peak]), np.array([push.F_n]))[0]),
        )
        for push in find_pushes(trial)
    ]


def score(predicted: Sequence[Predicted]) -> Scores:
    """Return the scores of predictions, weighted for censoring."""
    peak = np.array([p.push.peak for p in predicted])
    is_held = np.array([p.push.is_held for p in predicted])
    risks = np.array([p.risks for p in predicted])
    weights, is_below = censoring_weights(peak, is_held, REQUIRED)
    brier = (weights * (risks - is_below) ** 2).sum() / weights.sum()
    return Scores(
        slips=int((~is_held).sum()),
        held=int(is_held.sum()),
        brier=float(brier),
        calibration_error=calibration_error(risks, is_below, weights),
        pit=pit_distance(np.array([p.pit for p in predicted]), is_held),
    )


def censoring_weights(
    peak: np.ndarray, is_held: np.ndarray, required: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return weights and whether it broke away below, shapes (pushes, forces).

    A push that held below the force in question has no weight.
    """
    censoring = kaplan_meier(peak, ~is_held)
    G_own = np.maximum(1.0 - censoring.share_below(peak - 1e-9), LEAST_G)
    G_force = np.maximum(1.0 - censoring.share_below(required), LEAST_G)
    is_beyond = peak[:, None] >= required
    is_below = ~is_beyond & ~is_held[:, None]
    weights = np.where(is_below, 1.0 / G_own[:, None], is_beyond / G_force)
    return weights, is_below.astype(float)


def calibration_error(
    risks: np.ndarray, is_below: np.ndarray, weights: np.ndarray
) -> float:
    """Return the mean of |predicted - seen| over ten bins of the predicted risk."""
    bin_index = np.minimum((risks * BINS).astype(int), BINS - 1).ravel()
    total = np.bincount(bin_index, weights.ravel(), BINS)
    off = np.bincount(bin_index, (weights * (risks - is_below)).ravel(), BINS)
    return float(np.abs(off).sum() / total.sum())


def load(path: Path) -> dict[str, list[PreparedTrial]]:
    tables = load_tables([path])
    return {
        name: [prepare_trial(s, PrepareOptions()) for s in series]
        for name, series in tables.items()
    }


def kinds_of(trials: Trials) -> dict[str, str]:
    return {name: terrain_kind(name) for name in trials}


def table(trials: Trials, points: int) -> list[tuple[str, str, Scores]]:
    """Return (terrain or group, model, scores), pooled stones first."""
    kinds = kinds_of(trials)
    surface = groups_of(kinds)["surface"]
    rows = []
    for title, predicted in (
        ("from rest", from_rest(trials, kinds)),
        ("in motion", in_motion(trials, points)),
    ):
        pooled = [p for p in predicted if surface[p.terrain] == "rocky"]
        groups = {"stones": pooled} | {
            name: [p for p in predicted if p.terrain == name] for name in trials
        }
        rows += [(n, title, score(group)) for n, group in groups.items() if group]
    order = ["stones", *trials]
    return sorted(rows, key=lambda row: order.index(row[0]))


def verdicts(rows: Sequence[tuple[str, str, Scores]]) -> list[tuple[str, bool]]:
    """Return what the pooled stones have to meet, and whether they do."""
    by_model = {model: scores for name, model, scores in rows if name == "stones"}
    rest, motion = by_model["from rest"], by_model["in motion"]
    gain = 1.0 - rest.brier / motion.brier
    return [
        (
            f"calibration error {rest.calibration_error:.3f} <= 0.03",
            rest.calibration_error <= 0.03,
        ),
        (
            f"PIT distance {rest.pit:.3f} <= {rest.pit_limit:.3f}",
            rest.pit <= rest.pit_limit,
        ),
        (
            f"Brier {rest.brier:.3f}, {gain:.0%} below {motion.brier:.3f} (>= 15 %)",
            gain >= 0.15,
        ),
    ]


def main(words: Sequence[str] | None = None) -> int:
    """Print the scores; return 1 where pooled stones miss a figure."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("files", nargs="+", type=Path, help="npz tables of trials")
    parser.add_argument("--points", type=int, default=300, help="of the process")
    args = parser.parse_args(words)
    is_met = True
    for path in args.files:
        rows = table(load(path), args.points)
        print(path.name)
        print("terrain  model      slips held  Brier  calibration error  PIT (limit)")
        for name, model, s in rows:
            print(
                f"{name:8} {model:10} {s.slips:5} {s.held:4}  {s.brier:.3f}  "
                f"{s.calibration_error:17.3f}  {s.pit:.3f} ({s.pit_limit:.3f})"
            )
        for text, holds in verdicts(rows):
            print(f"{'met' if holds else 'MISSED'}: {text}")
            is_met = is_met and holds
    return int(not is_met)


if __name__ == "__main__":
    sys.exit(main())
