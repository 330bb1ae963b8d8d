"""Tables about the rig: how it behaved, and what it could have seen."""

from collections.abc import Callable, Sequence

import numpy as np

from analysis.figures import ReportSection
from analysis.findings import RigTrial, StudyResults
from analysis.report.page_model import ReportTable

_SATURATED = 1e-9  # share of cycles

_REACH_NOTE = (
    "Measurable: by the sensor's ranges and the lever of the foot; – where it "
    "did not say them: without a sample out of range it is at least what was seen. "
    "Uncertainty: standard uncertainty of a trial's mean F_t and F_n, "
    "from the changes between the tares of its session; "
    "with the zero between two tares (drift=interpolated) "
    "it is four fifths of that. Floor: mean |error| of smoothed "
    "F_t by these changes and by the noise at rest, which no model can be better than; "
    "by the noise alone where a session has one tare only. "
    "Drag: what the joints' Coulomb friction takes from the hand's push if they "
    "rub as the arm model says. It is not in F_t, which is measured below them, "
    "but tilts the push, so that it biases F_n. Medians over trials."
)


def rig_tables(results: StudyResults) -> list[ReportTable]:
    """Return rig health by trial and its reach by terrain; none without a rig."""
    return [health(results.rig), reach(results)] if results.rig else []


def health(rig: Sequence[RigTrial]) -> ReportTable:
    """Return one line per trial."""
    return ReportTable(
        "Rig health by trial",
        (
            "trial",
            "period, median [ms]",
            "longest [ms]",
            "missed",
            "force sample's age, 5 to 95% [ms]",
            "tare x, y, z [N]",
            "change of tare [N]",
            "joint 7 [mrad]",
            "pucks [°C]",
            "motors [°C]",
            "mean |F_y| moving [N]",
        ),
        [
            (
                f"{trial.terrain} {trial.name}",
                f"{trial.period:.3f}",
                f"{trial.longest_gap:.2f}",
                str(trial.missed),
                f"{trial.skew[0]:.2f} to {trial.skew[2]:.2f}",
                ", ".join(f"{value:.2f}" for value in trial.tare),
                _number(trial.tare_bracket),
                f"{trial.joint7:.1f}",
                _range(trial.puck_degc),
                _range(trial.motor_degc),
                _number(trial.lateral),
            )
            for trial in rig
        ],
        note="Age: how much earlier the force was sampled than the joints answered. "
        "Change of tare: distance to the offset of the next tare, which "
        "brackets the drift of the sensor. – where it is not known.",
        section=ReportSection.HEALTH,
    )


def reach(results: StudyResults) -> ReportTable:
    """Return for every terrain what the rig could have seen, beside the errors."""
    rows = []
    for name, result in results.study.terrains.items():
        trials = [trial for trial in results.rig if trial.terrain == name]
        if not trials:
            continue
        errors = [
            mae
            for model in results.study.options.fit.models
            if (mae := result.mae(model)) is not None
        ]
        floor = _median(trials, lambda trial: trial.floor)
        ratio = min(errors) / floor if errors and floor else None
        rows.append(
            (
                name,
                _largest(trials),
                _number(_median(trials, lambda trial: trial.measurable_F_t), 0),
                _number(floor),
                _number(_median(trials, lambda trial: trial.tare_bracket)),
                _number(_median(trials, lambda trial: trial.force_uncertainty)),
                _number(min(errors, default=None)),
                _number(ratio, 1),
                _number(_median(trials, lambda trial: trial.load_bias)),
                _number(_median(trials, lambda trial: trial.drag)),
            )
        )
    return ReportTable(
        "Limits of the rig beside its results",
        (
            "terrain",
            "largest |F_t| seen [N]",
            "measurable [N]",
            "sensor floor [N]",
            "drift of the tare [N]",
            "uncertainty of mean F_t, F_n [N]",
            "best model's error [N]",
            "error over floor",
            "F_n above set load [N]",
            "drag of the joints [N]",
        ),
        rows,
        note=_REACH_NOTE,
        section=ReportSection.REACH,
    )


def _largest(trials: Sequence[RigTrial]) -> str:
    largest = max(trial.largest_F_t for trial in trials)
    share = float(np.mean([trial.saturated for trial in trials]))
    if share > _SATURATED:
        return f"{largest:.1f}, out of range in {share:.2%} of cycles"
    return f"{largest:.1f}, none out of range"


def _median(
    trials: Sequence[RigTrial], measure: Callable[[RigTrial], float | None]
) -> float | None:
    values = [value for trial in trials if (value := measure(trial)) is not None]
    return float(np.median(values)) if values else None


def _number(value: float | None, digits: int = 2) -> str:
    return "–" if value is None else f"{value:.{digits}f}"


def _range(values: Sequence[float]) -> str:
    if not values:
        return "–"
    low, high = min(values), max(values)
    return f"{low:.0f}" if low == high else f"{low:.0f} to {high:.0f}"
