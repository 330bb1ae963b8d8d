"""Do predictive bands hold for trials that no model has seen? Takes minutes.

python -m studies.predictive_bands STUDY... [--jobs 2] [--starts 20] [--terrains S0,TF]
python -m studies.predictive_bands STUDY... --many

A study is a table of trials (npz) or a folder of recorded sessions. Every trial is left
out once. Printed are, for stones and plates, NLPD of the noise chosen by earlier
reports, of a trial effect with normal noise alone and of the model of a new trial, its
coverage, and how many of its fits end at the best of so many starts.
"""

import argparse
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from analysis.data.load import load_trial
from analysis.data.prepare import PrepareOptions, prepare_trial
from analysis.data.samples import PooledSamples, SampleTable, TrainingSet
from analysis.data.series import TractionSeries
from analysis.data.tables import load_tables
from analysis.data.terrain_kinds import FLAT, terrain_kind
from analysis.gp.kernels import SquaredExponential
from analysis.gp.likelihood import Likelihood
from analysis.gp.search import climb_from, spread
from analysis.study.crossval import FoldTask, choose_rows, plan_folds
from analysis.study.jobs import run_tasks
from analysis.study.metrics import Score, score
from analysis.study.models import GP_SE_NOISE, GP_SE_TRIAL, FitOptions, ModelFitter
from analysis.study.new_trial import NORMAL, NewTrialFit, NewTrialModel
from analysis.study.skew import warped
from experiments.session.store import list_sessions

BEFORE, EFFECT, NEW = "noise chosen", "trial effect alone", "new trial"
TITLES = (BEFORE, EFFECT, NEW)
BANDS = (("coverage50", 0.50), ("coverage90", 0.90), ("coverage95", 0.95))
MANY_ROWS = 900  # of a fit to the trials of other studies
SAME_TOP = 1e-3  # of the log likelihood
LEAST_GAIN = 0.10  # nat, on stones over the noise chosen
NO_WORSE = 0.01  # nat: a difference below is noise with twenty trials
LEAST_HITS = 0.95  # of the fits that end at the best of all starts


@dataclass(frozen=True)
class Task:
    """A fold, and how many random starts its fit is held against."""

    fold: FoldTask
    starts: int


@dataclass(frozen=True)
class Outcome:
    """Scores of one fold by model, the family chosen, and what the search missed."""

    terrain: str
    scores: dict[str, Score]
    family: str
    shaped: bool
    missed: float


def run_fold(task: Task) -> Outcome:
    fold = task.fold
    training = TrainingSet(fold.training, fold.lengths, choose_rows(fold))
    fitter = ModelFitter(training, fold.options)
    new = fitter.fit(GP_SE_TRIAL)
    assert isinstance(new, NewTrialModel)
    models = {
        BEFORE: fitter.fit(GP_SE_NOISE),
        EFFECT: NewTrialFit(training, None, families=(NORMAL,)).fit(
            SquaredExponential()
        ),
        NEW: new,
    }
    own = fold.own
    scores = {
        name: score(own.F_t, model.predict(own.F_n, own.v_t))
        for name, model in models.items()
    }
    missed = (
        best_of(new, training, task.starts) - new.process.lml if task.starts else 0.0
    )
    return Outcome(
        fold.terrain, scores, new.choice.chosen, new.shape is not None, missed
    )


def best_of(model: NewTrialModel, training: TrainingSet, starts: int) -> float:
    """Return the best likelihood of so many random starts."""
    gp = model.process
    rows = training.rows.take(np.sort(training.chosen))
    outputs = warped(rows.F_t, model.c) - gp.offset
    likelihood = Likelihood(gp.kernel, gp.noise, gp.X, outputs, gp.trials)

    sd = float(outputs.std())
    rng = np.random.default_rng(0)
    centre = np.concatenate(
        [
            np.log([sd, *spread(gp.X)]),
            gp.noise.start(sd),
        ]
    )
    begun = centre + rng.normal(0.0, 1.0, (starts, centre.size))
    return max(climb_from(likelihood, [start]).lml for start in begun)


def load_study(path: Path) -> dict[str, list[TractionSeries]]:
    """Return the trials of a table or of a folder of recorded sessions, by terrain."""
    if path.is_file():
        return {name: list(series) for name, series in load_tables([path]).items()}
    trials: dict[str, list[TractionSeries]] = {}
    for session in list_sessions(path):
        series = [load_trial(file).series() for file in session.kept_trials()]
        trials.setdefault(session.terrain, []).extend(series)
    if not trials:
        sys.exit(f"{path} - expected a table, or a folder with a folder `sessions`.")
    return trials


def evaluate(
    trials: dict[str, list[TractionSeries]], jobs: int, starts: int
) -> list[Outcome]:
    prepared = {
        name: [prepare_trial(series, PrepareOptions()) for series in group]
        for name, group in trials.items()
    }
    folds, _ = plan_folds(prepared, FitOptions(draws=0))
    return run_tasks(run_fold, [Task(fold, starts) for fold in folds], jobs)


def many_known(
    studies: Sequence[dict[str, list[TractionSeries]]], terrain: str
) -> list[float]:
    """Return the NLPD of every study's trials by a fit to those of all others."""
    samples = []
    for study in studies:
        own = [prepare_trial(series, PrepareOptions()) for series in study[terrain]]
        pool = PooledSamples.of({terrain: own}, {terrain: range(len(own))})
        samples.append([pool.trial(terrain, k) for k in range(len(own))])
    found = []
    for tested in samples:
        rest = [trial for group in samples if group is not tested for trial in group]
        rows, rng = SampleTable.joined(rest), np.random.default_rng(0)
        chosen = rng.choice(rows.count, min(MANY_ROWS, rows.count), replace=False)
        lengths = tuple(trial.count for trial in rest)
        training = TrainingSet(rows, lengths, np.sort(chosen))
        model = NewTrialFit(training, None).fit(SquaredExponential())
        found.append(
            np.mean(
                [
                    score(trial.F_t, model.predict(trial.F_n, trial.v_t)).nlpd
                    for trial in tested
                ]
            )
        )
    return [float(value) for value in found]


def print_many(paths: Sequence[Path]) -> None:
    studies = [load_study(path) for path in paths]
    sys.stdout.write(f"NLPD by the trials of others: {', '.join(map(str, paths))}\n")
    whole = []
    for terrain in studies[0]:
        whole.append(many_known(studies, terrain))
        kind = terrain_kind(terrain, [s.stones for s in studies[0][terrain]])
        values = "  ".join(f"{value:.3f}" for value in whole[-1])
        sys.stdout.write(f"{terrain:4} {kind:8} {values}\n")
        if kind == FLAT:
            whole.pop()
        sys.stdout.flush()
    values = "  ".join(f"{value:.3f}" for value in np.mean(whole, axis=0))
    sys.stdout.write(f"stones        {values}\n")


def of_kind(
    outcomes: Sequence[Outcome],
    trials: dict[str, list[TractionSeries]],
    *,
    plates: bool,
) -> list[Outcome]:
    kinds = {
        n: terrain_kind(n, [s.stones for s in group]) for n, group in trials.items()
    }
    return [o for o in outcomes if (kinds[o.terrain] == FLAT) == plates]


def mean(outcomes: Sequence[Outcome], model: str, key: str) -> float:
    return float(np.mean([getattr(o.scores[model], key) for o in outcomes]))


def coverages(outcomes: Sequence[Outcome], model: str) -> str:
    return "/".join(f"{mean(outcomes, model, key):.3f}" for key, _ in BANDS)


def table(name: str, outcomes: Sequence[Outcome]) -> list[str]:
    """Return the lines of one group of folds."""
    lines = [f"{name}: {len(outcomes)} trials"]
    for model in TITLES:
        values = [
            f"{mean(outcomes, model, key):.3f}" for key in ("nlpd", "crps", "mae")
        ]
        lines.append(
            f"  {model:20} NLPD {values[0]}  CRPS {values[1]}  MAE {values[2]}  "
            f"50/90/95 {coverages(outcomes, model)}"
        )
    families = [o.family for o in outcomes]
    lines.append(
        f"  {', '.join(f'{f} {families.count(f)}' for f in sorted(set(families)))}; "
        f"a shape on {sum(o.shaped for o in outcomes)}"
    )
    for terrain in dict.fromkeys(o.terrain for o in outcomes):
        own = [o for o in outcomes if o.terrain == terrain]
        errors = [mean(own, NEW, key) - nominal for key, nominal in BANDS]
        nlpds = ", ".join(f"{mean(own, model, 'nlpd'):.3f}" for model in TITLES)
        lines.append(
            f"  {terrain:4} NLPD {nlpds}  new trial off by "
            f"{'/'.join(f'{e:+.3f}' for e in errors)}"
        )
    return lines


def shortfalls(stones: Sequence[Outcome], plates: Sequence[Outcome]) -> list[str]:
    """Return what the bands and densities of a whole study miss."""
    missed = []
    for name, group, limits in (
        ("stones", stones, (0.03, 0.02, 0.02)),
        ("plates", plates, (0.05, 0.05, 0.05)),
    ):
        errors = [mean(group, NEW, key) - nominal for key, nominal in BANDS]
        pairs = [(name, e, limit) for e, limit in zip(errors, limits, strict=True)]
        # a plate's trials differ so much that ten of them leave 0.05 of a share open
        for terrain in dict.fromkeys(o.terrain for o in group if group is stones):
            own = [o for o in group if o.terrain == terrain]
            pairs += [(terrain, mean(own, NEW, key) - q, 0.05) for key, q in BANDS]
        missed += [
            f"{group}: a band is off by {error:+.3f} (limit {limit})"
            for group, error, limit in pairs
            if abs(error) > limit
        ]
    gain = mean(stones, BEFORE, "nlpd") - mean(stones, NEW, "nlpd")
    loss = mean(plates, NEW, "nlpd") - mean(plates, EFFECT, "nlpd")
    if gain < LEAST_GAIN:
        missed.append(f"stones: NLPD gains {gain:.3f} (limit {LEAST_GAIN})")
    if loss > NO_WORSE:
        missed.append(f"plates: NLPD loses {loss:.3f} to the effect alone")
    return missed


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.split("\n", 1)[0])
    parser.add_argument("studies", nargs="+", type=Path)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--starts", type=int, default=0)
    parser.add_argument("--terrains", default="")
    parser.add_argument("--many", action="store_true")
    args = parser.parse_args()
    if args.many:
        print_many(args.studies)
        return 0
    say, is_met = sys.stdout.write, True
    for path in args.studies:
        trials = load_study(path)
        wanted = args.terrains.split(",") if args.terrains else list(trials)
        trials = {name: trials[name] for name in wanted}
        outcomes = evaluate(trials, args.jobs, args.starts)
        say(f"== {path.name}\n")
        for name, is_plate in (("stones", False), ("plates", True)):
            if group := of_kind(outcomes, trials, plates=is_plate):
                say("\n".join(table(name, group)) + "\n")
        if {len(trials[name]) for name in wanted} == {10} and len(wanted) == 8:
            groups = (of_kind(outcomes, trials, plates=p) for p in (False, True))
            missed = shortfalls(*groups)
            is_met = is_met and not missed
            say("".join(f"MISSED {text}\n" for text in missed) or "all limits met\n")
        if args.starts:
            hits = np.mean([o.missed < SAME_TOP for o in outcomes])
            say(f"best of {args.starts} starts reached in {hits:.1%} of the fits, ")
            say(f"missed by at most {max(o.missed for o in outcomes):.3f}\n")
            is_met = is_met and bool(hits >= LEAST_HITS)
        sys.stdout.flush()
    return 0 if is_met else 1


if __name__ == "__main__":
    sys.exit(main())
