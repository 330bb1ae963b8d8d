"""Measurement limits of the rig compared with the model errors."""

from collections.abc import Callable, Sequence

import numpy as np

from analysis.report.cell_texts import number_text
from analysis.report.page_model import ReportContext, Section
from analysis.report.results import StudyResults
from analysis.report.section import ReportSection, ReportTable
from analysis.report.sections.rig_health.health import RigTrial

_SATURATED = 1e-9  # share of saturated cycles above which it is reported
_LIMITS_NOTE = (
    "Measurable: largest traction within the sensor's ranges, given the lever arm of "
    "the foot; a dash if the ranges are unknown: it is then at least the largest "
    "observed value, provided that no sample was out of range. "
    "Uncertainty: standard uncertainty of a trial's mean F_t and F_n, "
    "from the changes between the tares of its session; interpolating the zero "
    "between two tares (drift=interpolated) reduces it by a fifth. "
    "Floor: lower bound on the mean absolute error of any model, from tare changes "
    "and the noise of smoothed F_t at rest, or from the noise alone if the session "
    "has one tare. "
    "Drag: Coulomb friction of the joints as felt by the pushing hand, "
    "from the recorded friction calibration, less the compensation; "
    "without a calibration, from the arm model. F_t and F_n are measured at the wrist, "
    "below the joints, and v_t at the joints: joint friction does not bias the models "
    "but limits the loads and speeds that are reached. Medians over trials."
)


def limits_table(results: StudyResults) -> ReportTable:
    """Return the table of measurement limits and model errors by terrain."""
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
                number_text(_median(trials, lambda trial: trial.measurable_F_t), 0),
                number_text(floor),
                number_text(_median(trials, lambda trial: trial.tare_bracket)),
                number_text(_median(trials, lambda trial: trial.force_uncertainty)),
                number_text(min(errors, default=None)),
                number_text(ratio, 1),
                number_text(_median(trials, lambda trial: trial.load_bias)),
                number_text(_median(trials, lambda trial: trial.drag)),
            )
        )
    return ReportTable(
        "Limits of the rig and results",
        (
            "terrain",
            "largest |F_t| observed [N]",
            "measurable [N]",
            "sensor floor [N]",
            "tare drift [N]",
            "uncertainty of mean F_t, F_n [N]",
            "smallest error of any model [N]",
            "error over floor",
            "F_n above set load [N]",
            "joint drag [N]",
        ),
        rows,
        note=_LIMITS_NOTE,
        section=ReportSection.MEASUREMENT_LIMITS,
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


def _tables(results: StudyResults, _: ReportContext) -> list[ReportTable]:
    return [limits_table(results)] if results.rig else []


SECTION = Section(ReportSection.MEASUREMENT_LIMITS, _tables)
