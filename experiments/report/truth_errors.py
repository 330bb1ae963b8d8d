"""Errors of simulated trials against their truth."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from acquisition.errors import TrialFileError
from acquisition.trial_file.reader import TrialReader
from analysis.data.load import RecordedTrial
from analysis.data.prepare import moving_average
from analysis.report.force_uncertainty import (
    TaredTrial,
    uncertainties_of,
    uncertainty_of,
)
from analysis.report.reduced_trial import ReducedTrial
from analysis.report.section import ReportSection, ReportTable
from analysis.study.study import Study
from analysis.study.terrain_fit import TerrainResult

_FEWEST = 50  # common cycles, or the truth file is of another trial
_WIDTH = 11  # samples of the moving average, as for the models
_PREFIX = "true:"  # prefix of the parameters in a truth file


@dataclass(frozen=True, slots=True)
class TruthErrors:
    """Errors of one trial, after the same smoothing of measurement and truth.

    Attributes:
        v_t: root mean square error [m/s].
        F_t: mean absolute error [N].
        F_n: mean absolute error [N].
        means: signed mean errors of F_t and F_n over the trial [N].
        parameters: true parameters of the simulated ground [SI], by name.
    """

    v_t: float
    F_t: float
    F_n: float
    means: tuple[float, float] = (0.0, 0.0)
    parameters: Mapping[str, float] = field(default_factory=dict[str, float])


def compare_with_truth(trial: RecordedTrial) -> TruthErrors | None:
    """Return the errors of a trial against its truth file; None without one."""
    path = trial.path.with_name(trial.path.stem + ".truth.mcap")
    if not path.exists():
        return None
    try:
        reader = TrialReader(path)
        truth = reader.truth().data
    except TrialFileError:
        return None
    if not len(truth):
        return None
    host_ns = trial.cycles["host_ns"]
    inside = (host_ns >= truth["host_ns"][0]) & (host_ns <= truth["host_ns"][-1])
    if np.count_nonzero(inside) < _FEWEST:
        return None
    t, t_true = host_ns[inside].astype(float), truth["host_ns"].astype(float)
    true = [np.interp(t, t_true, truth["traction"][:, k]) for k in range(3)]
    error = _smooth(trial.traction[inside]) - _smooth(np.column_stack(true))
    return TruthErrors(
        v_t=float(np.sqrt(np.nanmean(error[:, 0] ** 2))),
        F_t=float(np.nanmean(np.abs(error[:, 1]))),
        F_n=float(np.nanmean(np.abs(error[:, 2]))),
        means=(float(np.nanmean(error[:, 1])), float(np.nanmean(error[:, 2]))),
        parameters=_parameters(reader.metadata.get("trial", {})),
    )


def _parameters(metadata: Mapping[str, str]) -> dict[str, float]:
    """Return the true parameters in a trial's metadata."""
    parameters: dict[str, float] = {}
    for key, text in metadata.items():
        if key.startswith(_PREFIX):
            try:
                parameters[key.removeprefix(_PREFIX)] = float(text)
            except ValueError:
                continue
    return parameters


def _smooth(values: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.column_stack([moving_average(column, _WIDTH) for column in values.T])


_NAMES = {
    "mu_k": "μ_k, sliding friction",
    "mu_s": "F_s = μ_s F_n at the median F_n [N]",
    "v_S": "v_S, Stribeck velocity [m/s]",
    "b": "b, viscous [kg/s]",
}
_RECOVERED = {"mu_k": "mu", "mu_s": "F_s", "v_S": "v_s", "b": "b"}


def truth_tables(
    study: Study,
    trials: Mapping[str, Sequence[ReducedTrial]],
    truths: Mapping[Path, TruthErrors],
) -> list[ReportTable]:
    """Return tables of measured and recovered values against the truth, if known.

    Args:
        study: study with the recovered parameters.
        trials: trials by terrain.
        truths: errors against the truth files, by path of the trial.
    """
    errors = {
        name: [(t.name, truths[t.path]) for t in group if t.path in truths]
        for name, group in trials.items()
    }
    if not any(errors.values()):
        return []
    scores = _scores([t for group in trials.values() for t in group], truths)
    predicted = [_predicted(scores)] if len(scores) else []
    return [_measured(errors), *predicted, _recovered(study, errors)]


def z_scores(trials: Sequence[RecordedTrial]) -> NDArray[np.float64]:
    """Errors of mean F_t and F_n divided by their standard uncertainty, shape (n, 2).

    One row per trial with a truth file in a session with two tares.
    """
    truths = {trial.path: compare_with_truth(trial) for trial in trials}
    return _scores(
        trials, {path: errors for path, errors in truths.items() if errors is not None}
    )


def _scores(
    trials: Sequence[TaredTrial], truths: Mapping[Path, TruthErrors]
) -> NDArray[np.float64]:
    uncertainties = uncertainties_of(trials)
    pairs = [(uncertainty_of(t, uncertainties), truths.get(t.path)) for t in trials]
    rows = [
        [mean / uncertainty.mean for mean in error.means]
        for uncertainty, error in pairs
        if uncertainty and error
    ]
    return np.array(rows, dtype=np.float64).reshape(-1, 2)


def _predicted(scores: NDArray[np.float64]) -> ReportTable:
    return ReportTable(
        "Uncertainty of the forces against the truth",
        ("mean of a trial", "trials", "rms of error / uncertainty", "largest"),
        [_scored(name, scores[:, k]) for k, name in enumerate(("F_t", "F_n"))],
        note="Simulated trials only. The uncertainty is the one by the changes between "
        "tares, which a real session has too; where it is right, the rms is 1.",
        section=ReportSection.MEASUREMENT_LIMITS,
    )


def _scored(name: str, scores: NDArray[np.float64]) -> tuple[str, ...]:
    rms, largest = np.sqrt(np.mean(scores**2)), np.abs(scores).max()
    return name, str(scores.size), f"{rms:.2f}", f"{largest:.1f}"


def _measured(errors: Mapping[str, list[tuple[str, TruthErrors]]]) -> ReportTable:
    return ReportTable(
        "Measured against true",
        ("trial", "v_t, rms [mm/s]", "F_t, mean |error| [N]", "F_n, mean |error| [N]"),
        [
            (
                f"{terrain} {name}",
                f"{error.v_t * 1e3:.2f}",
                f"{error.F_t:.2f}",
                f"{error.F_n:.2f}",
            )
            for terrain, of_terrain in errors.items()
            for name, error in of_terrain
        ],
        note="Simulated trials only; after the same smoothing on both.",
        section=ReportSection.MEASUREMENT_LIMITS,
    )


def _recovered(
    study: Study, errors: Mapping[str, list[tuple[str, TruthErrors]]]
) -> ReportTable:
    rows = [
        row
        for terrain, of_terrain in errors.items()
        for row in _rows(study.terrains[terrain], [error for _, error in of_terrain])
    ]
    return ReportTable(
        "True and recovered parameters",
        ("terrain", "parameter", "true, mean (range)", "Tustin, all trials"),
        rows,
        note="A simulated plate follows eq. (1) with δ_s = 2 and a static force that "
        "grows with F_n. A bed of stones has no Tustin parameters: its own are given, "
        "and only curves can be compared. In brackets the 95% interval.",
        section=ReportSection.MEASUREMENT_LIMITS,
    )


def _rows(
    result: TerrainResult, errors: Sequence[TruthErrors]
) -> list[tuple[str, ...]]:
    names = dict.fromkeys(name for error in errors for name in error.parameters)
    rows: list[tuple[str, ...]] = []
    for name in names:
        values = np.array([e.parameters[name] for e in errors if name in e.parameters])
        if name == "mu_s":
            loads = [trial.F_n for trial in result.trials if trial.kept]
            values = values * (np.median(np.concatenate(loads)) if loads else np.nan)
        true = f"{values.mean():.3g}"
        if np.ptp(values) > 0:
            true += f" ({values.min():.3g} to {values.max():.3g})"
        title = _NAMES.get(name, name)
        rows.append((result.terrain, title, true, _fitted(result, name)))
    return rows


def _fitted(result: TerrainResult, name: str) -> str:
    whole, key = result.whole, _RECOVERED.get(name)
    if whole.fit is None or key is None:
        return "no counterpart" if key is None else "no fit"
    text = f"{getattr(whole.fit.parameters, key):.3g}"
    if key in whole.intervals:
        low, high = whole.intervals[key]
        text += f" ({low:.3g} to {high:.3g})"
    return text
