"""Trials as foreseen by what other trials taught."""

from collections.abc import Callable, Iterable, Mapping, Sequence

from analysis.breakaway import BreakAwayModel
from analysis.foresight.engine import Foresight
from analysis.foresight.model import ForesightModel
from analysis.foresight.ticks import ForesightRun
from analysis.foresight.training import FOLDS, fit_foresight
from analysis.foresight.watching import WatchedTrial


def hold_out(
    trials: Sequence[WatchedTrial],
    break_away: Mapping[str, BreakAwayModel],
    progress: Callable[[], object] = lambda: None,
) -> list[ForesightRun]:
    """Return every trial as foreseen by what was learnt from the other folds.

    Trials of one fold are every fifth of their terrain.
    """
    folds = hold_out_models(trials, progress)
    return [
        run for model, tested in folds for run in foresee(model, tested, break_away)
    ]


def hold_out_models(
    trials: Sequence[WatchedTrial], progress: Callable[[], object] = lambda: None
) -> list[tuple[ForesightModel, list[WatchedTrial]]]:
    """Return the model of every fold with the trials that it has not seen.

    Folds whose other trials teach nothing are left out. `progress` is called after
    every fold.
    """
    folds: list[tuple[ForesightModel, list[WatchedTrial]]] = []
    for tested, rest in folds_of(trials):
        model = fit_foresight(rest)
        progress()
        if model is not None:
            folds.append((model, tested))
    return folds


def folds_of(
    trials: Sequence[WatchedTrial],
) -> list[tuple[list[WatchedTrial], list[WatchedTrial]]]:
    """Return (tested, all others) of every fold that has a trial."""
    numbered = _numbered(trials)
    parts = [
        (
            [trial for number, trial in numbered if number % FOLDS == fold],
            [trial for number, trial in numbered if number % FOLDS != fold],
        )
        for fold in range(FOLDS)
    ]
    return [(tested, rest) for tested, rest in parts if tested and rest]


def _numbered(trials: Sequence[WatchedTrial]) -> list[tuple[int, WatchedTrial]]:
    counts: dict[str, int] = {}
    numbered: list[tuple[int, WatchedTrial]] = []
    for trial in trials:
        number = counts.get(trial.terrain, 0)
        counts[trial.terrain] = number + 1
        numbered.append((number, trial))
    return numbered


def foresee(
    model: ForesightModel,
    trials: Iterable[WatchedTrial],
    break_away: Mapping[str, BreakAwayModel],
) -> list[ForesightRun]:
    """Return trials as foreseen by a model, sample by sample."""
    threshold = model.slip.threshold if model.slip is not None else 1.0
    surfaces = tuple(law.surface for law in model.ground.laws)
    runs: list[ForesightRun] = []
    for trial in trials:
        foresight = Foresight(model, break_away, trial.rig)
        states = [foresight.push(sample) for sample in trial.samples]
        seen = tuple(state for state in states if state is not None)
        runs.append(ForesightRun(trial, seen, threshold, model.terrains, surfaces))
    return runs
