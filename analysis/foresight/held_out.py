"""Trials as foreseen by what other trials taught."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import overload

from analysis.breakaway.model import BreakAwayModel
from analysis.foresight.engine import Foresight
from analysis.foresight.model import ForesightModel
from analysis.foresight.scores import GroundAnswers, ground_answers
from analysis.foresight.ticks import ForesightRun
from analysis.foresight.training import FOLDS, fit_foresight
from analysis.foresight.watching import WatchedTrial


@dataclass(frozen=True, slots=True, eq=False)
class LearningTask:
    """Trials that teach, and others to prove it on.

    Attributes:
        taught: what is learnt from.
        tested: what is foreseen by that.
        break_away: models by terrain.
    """

    taught: Sequence[WatchedTrial]
    tested: Sequence[WatchedTrial]
    break_away: Mapping[str, BreakAwayModel]


@dataclass(frozen=True, slots=True, eq=False)
class Learnt:
    """What trials have taught, and what that is worth on others.

    Attributes:
        model: what was learnt; None where they teach nothing.
        runs: the trials tested, as foreseen by it.
        answers: how it tells surfaces apart in them.
    """

    model: ForesightModel | None
    runs: tuple[ForesightRun, ...]
    answers: GroundAnswers


class LearningTasks(Sequence[LearningTask]):
    """A study's trials: all of them to learn from, then every fold held out.

    Args:
        trials: the trials.
        break_away: models by terrain.
    """

    def __init__(
        self, trials: Sequence[WatchedTrial], break_away: Mapping[str, BreakAwayModel]
    ) -> None:
        self._trials, self._break_away = tuple(trials), break_away

    def __len__(self) -> int:
        """Return one more than the number of folds."""
        return 1 + len(folds_of(self._trials))

    @overload
    def __getitem__(self, index: int) -> LearningTask: ...
    @overload
    def __getitem__(self, index: slice) -> list[LearningTask]: ...
    def __getitem__(self, index: int | slice) -> LearningTask | list[LearningTask]:
        """Return all trials as the first task, behind it those that test a fold."""
        parts = [([], self._trials), *folds_of(self._trials)]
        tasks = [LearningTask(rest, tested, self._break_away) for tested, rest in parts]
        return tasks[index]

    def outline(self, index: int) -> object:
        """Return the number of the task."""
        return index


Run = Callable[[Callable[[LearningTask], Learnt], LearningTasks], Sequence[Learnt]]


def run_here(
    function: Callable[[LearningTask], Learnt], tasks: LearningTasks
) -> Sequence[Learnt]:
    """Return the function of every task, one after the other."""
    return [function(task) for task in tasks]


def learn(task: LearningTask) -> Learnt:
    """Return what trials teach, and others as foreseen by that; a pure function."""
    model = fit_foresight(task.taught)
    if model is None:
        return Learnt(None, (), GroundAnswers())
    return Learnt(
        model=model,
        runs=tuple(foresee(model, task.tested, task.break_away)),
        answers=ground_answers(model.ground, task.tested),
    )


def hold_out(
    trials: Sequence[WatchedTrial], break_away: Mapping[str, BreakAwayModel]
) -> list[ForesightRun]:
    """Return every trial as foreseen by what was learnt from the other folds."""
    tasks = LearningTasks(trials, break_away)
    return [run for task in tasks[1:] for run in learn(task).runs]


def folds_of(
    trials: Sequence[WatchedTrial],
) -> list[tuple[list[WatchedTrial], list[WatchedTrial]]]:
    """Return (tested, all others) of every fold that has both.

    Trials of one fold are every fifth of their terrain.
    """
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
