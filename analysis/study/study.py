"""A study: preparation, cross-validation, fits and comparison of all terrains."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from acquisition.errors import SettingsError
from acquisition.wording import counted
from analysis.data.events import find_slips
from analysis.data.plausibility import FEWEST, doubt_summary, doubts_of
from analysis.data.prepare import (
    MINIMUM_KEPT,
    PreparedTrial,
    PrepareOptions,
    prepare_trial,
)
from analysis.data.quality import PULLED, PULLED_WARNING
from analysis.data.samples import SampleTable
from analysis.data.series import TractionSeries
from analysis.data.terrain_kinds import Value, terrain_incline, terrain_kind
from analysis.study.break_away_fit import (
    BreakAwayOptions,
    BreakAwayTask,
    fit_planned,
    plan_break_away,
)
from analysis.study.crossval import (
    FoldResult,
    Prepared,
    notes_on_groups,
    plan_folds,
    run_fold,
)
from analysis.study.metrics import standard_error
from analysis.study.models import NEW_TRIAL, FitOptions
from analysis.study.slip_risk import BreakAwayModel
from analysis.study.store import ResultStore
from analysis.study.tasks import Batch, Progress, Workers, run_batches
from analysis.study.terrain_fit import (
    PooledTustinFit,
    TerrainResult,
    TerrainTask,
    fit_terrain,
    mean_of,
)
from analysis.study.trial_components import (
    ComponentsTask,
    TimedRows,
    TrialComponents,
    fit_components,
)

_NAMED = 10  # trials listed in one warning
_LOADED = 5.0  # N below which F_t/F_n is uninformative on any ground
_PLOUGHING = 1.5  # upper quartile of F_t/F_n; a single layer of stones stays below


@dataclass(frozen=True, slots=True)
class StudyOptions:
    """Options of a study.

    Attributes:
        prepare: smoothing, thinning and window.
        target: preparation of the test samples; None = as `prepare`. It lets studies
            with different smoothing be compared on the same test samples.
        fit: bounds, number of points and seed.
        n_jobs: worker processes; None = one per core. Does not affect the results.
        scheduler: address of a Dask scheduler; None = this machine. Does not affect the
            results.
    """

    prepare: PrepareOptions = field(default_factory=PrepareOptions)
    target: PrepareOptions | None = None
    fit: FitOptions = field(default_factory=FitOptions)
    n_jobs: int | None = None
    scheduler: str | None = None


@dataclass(frozen=True, slots=True)
class Study:
    """Results of an analysis.

    Attributes:
        simulated: the trials were simulated.
        options: options of the study.
        terrains: results by terrain, in the order given.
        notes: failures with their reasons.
        warnings: reasons to doubt results.
        break_away: break-away models by terrain; empty if not requested.
    """

    simulated: bool
    options: StudyOptions
    terrains: Mapping[str, TerrainResult]
    notes: tuple[str, ...]
    warnings: tuple[str, ...]
    break_away: Mapping[str, BreakAwayModel] = field(
        default_factory=dict[str, BreakAwayModel]
    )

    @property
    def kinds(self) -> dict[str, str]:
        """Kind of every terrain by name."""
        return {name: result.kind for name, result in self.terrains.items()}

    @property
    def groups(self) -> list[str]:
        """Notes on terrains whose folds leave out groups of trials."""
        return notes_on_groups(
            {
                name: [k for fold in result.folds for k in fold.left_out]
                for name, result in self.terrains.items()
            }
        )

    def cross(self, model: str) -> dict[str, dict[str, float | None]]:
        """Return mean absolute errors [N] by training terrain and tested terrain."""
        return {
            name: {
                tested: result.mae(model)
                if tested == name
                else _cross_mae(result, model, tested)
                for tested in self.terrains
            }
            for name, result in self.terrains.items()
            if result.models(model)
        }

    def cross_errors(self, model: str) -> dict[str, dict[str, float | None]]:
        """Return the standard errors [N] of `cross` over the tested trials."""
        return {
            name: {
                tested: standard_error(
                    result.maes(model)
                    if tested == name
                    else _foreign_errors(result, model, tested)
                )
                for tested in self.terrains
            }
            for name, result in self.terrains.items()
            if result.models(model)
        }


def run_study(
    trials: Mapping[str, Sequence[TractionSeries]],
    options: StudyOptions,
    simulated: bool,
    progress: Progress | None = None,
    store: ResultStore | None = None,
    *,
    with_break_away: bool = False,
) -> Study:
    """Analyse all trials.

    Args:
        trials: recorded trials by terrain.
        options: options of the study.
        simulated: the trials were simulated; marks every product.
        progress: called with (finished fits, all fits).
        store: cache of earlier results, so that an interrupted study resumes.
        with_break_away: also fit break-away models.

    Raises:
        SettingsError: there is no trial.
    """
    _require_trials(trials)
    prepared = _prepared(trials, options.prepare)
    targets = _prepared(trials, options.target) if options.target else prepared
    planned, notes = plan_folds(prepared, options.fit, targets)
    further = _further(trials)
    notes += _notes_on_inputs(further)
    components = [] if further else _components(prepared, options.fit)
    from_rest = [_break_away(trials, prepared, options)] if with_break_away else []
    batches = (
        Batch(fit_planned, from_rest),  # first, because it takes longest
        Batch(run_fold, planned),
        Batch(fit_components, components),
        Batch(fit_terrain, _wholes(prepared, options)),
    )
    workers = Workers(options.n_jobs, options.scheduler)
    break_away, folds, fitted, wholes = run_batches(batches, workers, progress, store)
    by_terrain = {
        task.terrain: fit for task, fit in zip(components, fitted, strict=True)
    }
    notes += [note for fold in folds for note in fold.notes]
    results = {
        name: _result(trials[name], prepared[name], folds, whole, by_terrain.get(name))
        for name, whole in zip(prepared, wholes, strict=True)
    }
    doubtful = (*_contradictions(trials), *notes_of_tables(trials))
    return Study(
        simulated,
        options,
        results,
        notes=tuple(notes),
        warnings=(*doubtful, *_all_warnings(results, options)),
        break_away=break_away[0] if break_away else {},
    )


def _break_away(
    trials: Mapping[str, Sequence[TractionSeries]],
    prepared: Prepared,
    options: StudyOptions,
) -> BreakAwayTask:
    kinds = {name: _kind(name, recorded) for name, recorded in trials.items()}
    return plan_break_away(prepared, kinds, BreakAwayOptions(seed=options.fit.seed))


def _kind(terrain: str, recorded: Sequence[TractionSeries]) -> str:
    return terrain_kind(terrain, [series.stones for series in recorded])


def _result(
    recorded: Sequence[TractionSeries],
    kept: tuple[PreparedTrial, ...],
    folds: Sequence[FoldResult],
    whole: PooledTustinFit,
    components: TrialComponents | None,
) -> TerrainResult:
    """Assemble the result of one terrain, with its own folds."""
    terrain = whole.terrain
    return TerrainResult(
        terrain=terrain,
        kind=_kind(terrain, recorded),
        trials=kept,
        slips=tuple(find_slips(trial.smooth) for trial in kept),
        folds=tuple(fold for fold in folds if fold.terrain == terrain),
        whole=whole,
        components=components,
        incline_deg=terrain_incline(terrain, [s.incline_deg for s in recorded]),
        factors=_factors(recorded),
        units={n: unit for series in recorded for n, unit in series.units.items()},
    )


def _factors(recorded: Sequence[TractionSeries]) -> dict[str, Value]:
    """Return the factors of a terrain from its recordings.

    Contradictory factors are set to None (does not apply).
    """
    factors: dict[str, Value] = {}
    for series in recorded:
        for name, value in series.factors.items():
            factors[name] = value if factors.get(name, value) == value else None
    return factors


def _require_trials(trials: Mapping[str, Sequence[TractionSeries]]) -> None:
    if not any(trials.values()):
        raise SettingsError("There is no trial to analyse.", hint="Record some first.")


def _further(trials: Mapping[str, Sequence[TractionSeries]]) -> tuple[str, ...]:
    """Return the names of inputs in addition to F_n and v_t.

    Raises:
        SettingsError: the trials differ in their inputs.
    """
    named = {tuple(s.further) for recorded in trials.values() for s in recorded}
    if len(named) > 1:
        raise SettingsError(
            "The trials differ in their inputs: "
            + "; ".join(sorted(", ".join(names) or "none" for names in named))
            + ".",
            hint="Give every trial the same inputs.",
        )
    return named.pop()


def _notes_on_inputs(further: Sequence[str]) -> list[str]:
    if not further:
        return []
    names = ", ".join(further)
    return [
        f"Inputs in addition to F_n and v_t: {names}. Curves and surfaces over F_n and "
        "v_t show them at their means; the constant force and Tustin's law do not use "
        "them. Not fitted: the spread of trials."
    ]


def _prepared(
    trials: Mapping[str, Sequence[TractionSeries]], options: PrepareOptions
) -> dict[str, tuple[PreparedTrial, ...]]:
    from threadpoolctl import threadpool_limits

    with threadpool_limits(1):  # the matrices have two rows: threads would lose time
        return {
            terrain: tuple(prepare_trial(series, options) for series in recorded)
            for terrain, recorded in trials.items()
        }


def _components(
    prepared: Mapping[str, Sequence[PreparedTrial]], fit: FitOptions
) -> list[ComponentsTask]:
    """Return a task per terrain, or none without a model of a new trial."""
    if not NEW_TRIAL & set(fit.models):
        return []
    return [
        ComponentsTask(terrain, tuple(TimedRows.of(t) for t in trials if t.kept), fit)
        for terrain, trials in prepared.items()
    ]


def _wholes(
    prepared: Mapping[str, Sequence[PreparedTrial]], options: StudyOptions
) -> list[TerrainTask]:
    return [
        TerrainTask(
            terrain, tuple(SampleTable.of([t]) for t in trials if t.kept), options.fit
        )
        for terrain, trials in prepared.items()
    ]


def _cross_mae(result: TerrainResult, model: str, tested: str) -> float | None:
    return mean_of(_foreign_errors(result, model, tested))


def _foreign_errors(result: TerrainResult, model: str, tested: str) -> list[float]:
    return [e for fold in result.models(model) for e in fold.cross[tested]]


def _contradictions(trials: Mapping[str, Sequence[TractionSeries]]) -> list[str]:
    """Return a warning for every terrain whose trials state different stones."""
    stated = {
        terrain: sorted({series.stones for series in recorded if series.stones})
        for terrain, recorded in trials.items()
    }
    return [
        f"{terrain}: its trials state different stones ({', '.join(sizes)}). It "
        "is treated as a class of its own."
        for terrain, sizes in stated.items()
        if len(sizes) > 1
    ]


def notes_of_tables(trials: Mapping[str, Sequence[TractionSeries]]) -> list[str]:
    """Collect the notes from reading tables, one line per note."""
    names: dict[str, list[str]] = {}
    for recorded in trials.values():
        for series in recorded:
            for note in series.notes:
                names.setdefault(note, []).append(series.name)
    return [
        f"{', '.join(named[:5])}{' and others' if len(named) > 5 else ''}: {note}."
        for note, named in names.items()
    ]


def _doubts(terrains: Iterable[Sequence[PreparedTrial]]) -> list[str]:
    """Collect the doubts about trials, one line per reason."""
    return doubt_summary((t.name, doubts_of(t)) for trials in terrains for t in trials)


def _all_warnings(
    results: Mapping[str, TerrainResult], options: StudyOptions
) -> list[str]:
    is_bounded = options.prepare.container_travel is not None
    doubts = _doubts(result.trials for result in results.values())
    return [
        *doubts,
        *(w for result in results.values() for w in _warnings(result, is_bounded)),
    ]


def _listed(numbers: Sequence[int]) -> str:
    more = len(numbers) - _NAMED
    return ", ".join(map(str, numbers[:_NAMED])) + (f" and {more} more" * (more > 0))


def _warnings(result: TerrainResult, has_container: bool) -> list[str]:
    warnings = []
    if result.pulled_share > PULLED_WARNING:
        warnings.append(
            f"{result.terrain}: F_n <= -{PULLED:g} N, beyond the sensor's error, "
            f"in {result.pulled_share:.1%} of the kept samples (limit "
            f"{PULLED_WARNING:.0%}). Suspect the tare or the plane of the terrain."
        )
    short = [k + 1 for k, t in enumerate(result.trials) if not t.is_countable]
    if short:
        warnings.append(
            f"{result.terrain}: too short to count - under {MINIMUM_KEPT} kept samples"
            f"{', or the container not crossed' if has_container else ''} - in "
            f"{len(short)} of {len(result.trials)} trials, analysed nevertheless "
            f"(trial {_listed(short)})."
        )
    dropped = sum(t.dropped_rows for t in result.trials if not t.is_foreign)
    if dropped:
        rows = counted(dropped, "row")
        warnings.append(f"{result.terrain}: {rows} dropped: not finite.")
    repeated = sum(trial.repeated_rows for trial in result.trials)
    if repeated:
        rows = counted(repeated, "duplicate row")
        warnings.append(f"{result.terrain}: {rows} dropped.")
    warnings += _ploughing(result)
    constant = [name for name in ("F_n", "v_t") if _is_constant(result.trials, name)]
    if constant:
        warnings.append(
            f"{result.terrain}: {' and '.join(constant)} never varies, so its effect "
            "is not identifiable."
        )
    return warnings


def _ploughing(result: TerrainResult) -> list[str]:
    """Warn if the traction of a terrain at high load exceeds friction.

    Only for tables: for own sessions on stones the report shows this in figures.
    """
    if not all(trial.is_foreign for trial in result.trials):
        return []
    F_n, F_t = (
        np.concatenate([getattr(trial, name) for trial in result.trials])
        for name in ("F_n", "F_t")
    )
    loaded = F_n >= _LOADED
    if np.count_nonzero(loaded) < FEWEST:
        return []
    ratio = F_t[loaded] / F_n[loaded]
    low, high = np.quantile(ratio, (0.25, 0.75))
    if high <= _PLOUGHING:
        return []
    return [
        f"{result.terrain}: F_t/F_n is {low:.2f} to {high:.2f} in the middle half of "
        f"the samples with F_n >= {_LOADED:g} N: a foot that ploughs, not friction "
        "alone; mu is a poor summary here."
    ]


def _is_constant(trials: Sequence[PreparedTrial], column: str) -> bool:
    values = np.concatenate([getattr(trial, column) for trial in trials])
    return values.size > 1 and float(np.ptp(values)) == 0.0
