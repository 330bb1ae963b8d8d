"""Sensitivity to analysis choices: a study repeated with one choice changed."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from acquisition.errors import SettingsError
from analysis.data.inertia import WINDOW
from analysis.data.load import Frame, RecordedTrial
from analysis.data.prepare import PrepareOptions
from analysis.data.series import TractionSeries
from analysis.report.cell_texts import paired_cell
from analysis.report.page_model import Section
from analysis.report.section import ReportSection, ReportTable
from analysis.study.metrics import PairedComparison, compare
from analysis.study.models import (
    GP_NN,
    GP_NN_TUSTIN,
    GP_SE_TUSTIN,
    PAPER_MODELS,
    TITLES,
    TUSTIN,
)
from analysis.study.study import Study, StudyOptions
from analysis.study.terrain_fit import mean_of
from analysis.tustin.model import TustinForm

VALUES = {
    "smoothing": "an odd number of samples, e.g. smoothing=15",
    "window": "slowest:fastest in m/s, e.g. window=0.01:0.2",
    "lag": "delay of the force, -50 to 50 ms, e.g. lag=20",
    "frame": "sole or terrain",
    "inertia": "removed (the force that accelerates the foot) or kept",
    "drift": "interpolated (between the tares) or first (the tare before the trial)",
    "kernel": "as_printed (eq. 5 without 1 +) or default",
    "static_friction": "proportional (F_s = f_s F_n) or constant",
}
_LATEST_MS = 50.0
_MEASURES = (("mae", "N"), ("nlpd", "nat"))


@dataclass(frozen=True, slots=True)
class StudyVariant:
    """One changed analysis choice.

    Attributes:
        key: name of the choice.
        value: its value, as given.
        models: names of the models that it affects.
        frame: frame onto which forces are projected.
        lag: lag of the forces to compensate [s].
        change: function from the options of the study to those of the repeated one.
        is_interpolated: the sensor's zero is interpolated between two tares.
        is_inertia_removed: the inertial force of the foot is removed.
        remark: effect on the trials in words.
    """

    key: str
    value: str
    models: tuple[str, ...]
    change: Callable[[StudyOptions], StudyOptions] = lambda options: options
    frame: Frame = "terrain"
    lag: float = 0.0
    is_interpolated: bool = False
    is_inertia_removed: bool = False
    remark: str = ""

    @property
    def text(self) -> str:
        """The choice as given: KEY=VALUE."""
        return f"{self.key}={self.value}"

    def series(self, trial: RecordedTrial | TractionSeries) -> TractionSeries:
        """Apply the choice to a trial.

        Raises:
            SettingsError: the choice needs a recording, but the trial is a table.
        """
        if isinstance(trial, RecordedTrial):
            chosen = trial.with_interpolated_tare() if self.is_interpolated else trial
            chosen = chosen.without_inertia() if self.is_inertia_removed else chosen
            series = chosen.series(self.frame)
        elif self.frame == "terrain" and not (
            self.is_interpolated or self.is_inertia_removed
        ):
            series = trial
        else:
            raise SettingsError(
                f"--what-if {self.text}: tables have no frame, tares or mass.",
                hint="It is a choice of recorded trials: traction report.",
            )
        return series.with_lag_removed(self.lag) if self.lag else series

    def with_remark(
        self, trials: Iterable[RecordedTrial | TractionSeries]
    ) -> StudyVariant:
        """Add a remark on the effect of the choice on the trials."""
        if not self.is_inertia_removed:
            return self
        forces = [t.inertial_force() for t in trials if isinstance(t, RecordedTrial)]
        largest = np.median([np.linalg.norm(f.force, axis=1).max() for f in forces])
        noise = np.median([f.uncertainty for f in forces])
        return replace(
            self,
            remark=f" The foot's inertial force was at most {largest:.2f} N (median of "
            f"trials), with a standard uncertainty of {noise:.2f} N per component from "
            f"the scatter of the positions; changes within {WINDOW * 1e3:.0f} ms are "
            "not resolved.",
        )

    def options(self, before: StudyOptions) -> StudyOptions:
        """Return the options of the repeated study, with only the affected models."""
        models = tuple(name for name in self.models if name in before.fit.models)
        fit = replace(before.fit, models=models, draws=0)
        return self.change(replace(before, fit=fit))


def parse_choice(text: str) -> StudyVariant:
    """Parse a choice KEY=VALUE.

    Raises:
        SettingsError: unknown key or value; the hint lists the valid ones.
    """
    key, _, value = (part.strip() for part in text.partition("="))
    if key not in VALUES:
        raise SettingsError(
            f"--what-if {text[:60]!r}: unknown choice {key[:30]!r}.", hint=_listed()
        )
    try:
        return _PARSERS[key](value)
    except (ValueError, SettingsError) as error:
        raise SettingsError(
            f"--what-if {text[:60]!r}: {value[:30]!r} is not a value of {key}.",
            hint=f"Give {VALUES[key]}.",
        ) from error


def _listed() -> str:
    return "The choices are: " + "; ".join(
        f"{key} ({value})" for key, value in VALUES.items()
    )


def _smoothing(value: str) -> StudyVariant:
    width = int(value)
    return _of_samples("smoothing", value, lambda p: replace(p, smoothing=width))


def _window(value: str) -> StudyVariant:
    slowest, fastest = parse_window(value)
    return _of_samples(
        "window", value, lambda p: replace(p, slowest=slowest, fastest=fastest)
    )


def parse_window(value: str) -> tuple[float, float]:
    """Parse a window `slowest:fastest` [m/s].

    Raises:
        ValueError: not two finite numbers.
    """
    slowest, fastest = (float(part) for part in value.split(":"))
    if not (math.isfinite(slowest) and math.isfinite(fastest)):
        raise ValueError(value)
    return slowest, fastest


def _of_samples(
    key: str, value: str, prepare: Callable[[PrepareOptions], PrepareOptions]
) -> StudyVariant:
    """Make a choice of training samples; the test samples remain those of the study."""
    prepare(PrepareOptions())  # refuses invalid values before the study starts

    def change(options: StudyOptions) -> StudyOptions:
        target = options.target or options.prepare
        return replace(options, prepare=prepare(options.prepare), target=target)

    return StudyVariant(key, value, PAPER_MODELS, change)


def _lag(value: str) -> StudyVariant:
    late_ms = float(value)
    if not abs(late_ms) <= _LATEST_MS:
        raise ValueError(value)
    return StudyVariant("lag", value, PAPER_MODELS, lag=late_ms * 1e-3)


def _frame(value: str) -> StudyVariant:
    frames: Mapping[str, Frame] = {"sole": "sole", "terrain": "terrain"}
    if value not in frames:
        raise ValueError(value)
    return StudyVariant("frame", value, PAPER_MODELS, frame=frames[value])


def _drift(value: str) -> StudyVariant:
    is_interpolated = _one_of(value, "interpolated", "first")
    return StudyVariant(
        "drift",
        value,
        PAPER_MODELS,
        is_interpolated=is_interpolated,
    )


def _inertia(value: str) -> StudyVariant:
    is_inertia_removed = _one_of(value, "removed", "kept")
    return StudyVariant(
        "inertia", value, PAPER_MODELS, is_inertia_removed=is_inertia_removed
    )


def _kernel(value: str) -> StudyVariant:
    printed = _one_of(value, "as_printed", "default")
    return StudyVariant(
        "kernel",
        value,
        (GP_NN, GP_NN_TUSTIN),
        lambda o: replace(o, fit=replace(o.fit, is_nn_as_printed=printed)),
    )


def _static_friction(value: str) -> StudyVariant:
    form = (
        TustinForm(static="proportional")
        if _one_of(value, "proportional", "constant")
        else TustinForm()
    )
    return StudyVariant(
        "static_friction",
        value,
        (TUSTIN, GP_SE_TUSTIN, GP_NN_TUSTIN),
        lambda o: replace(o, fit=replace(o.fit, form=form)),
    )


def _one_of(value: str, yes: str, no: str) -> bool:
    if value not in {yes, no}:
        raise ValueError(value)
    return value == yes


_PARSERS: Mapping[str, Callable[[str], StudyVariant]] = {
    "smoothing": _smoothing,
    "window": _window,
    "lag": _lag,
    "frame": _frame,
    "inertia": _inertia,
    "drift": _drift,
    "kernel": _kernel,
    "static_friction": _static_friction,
}


def comparison_table(choice: StudyVariant, before: Study, after: Study) -> ReportTable:
    """Compare the errors of both studies per terrain and model, trial by trial."""
    rows = [
        [
            terrain,
            TITLES[model],
            *(
                cell
                for key, _ in _MEASURES
                for cell in _cells(before, after, (terrain, model, key))
            ),
        ]
        for terrain in before.terrains
        for model in choice.models
        if terrain in after.terrains
    ]
    heads = [
        head
        for key, unit in _MEASURES
        for head in (f"{key.upper()} [{unit}]", choice.text, "difference")
    ]
    return ReportTable(
        name=f"What if {choice.text}?",
        header=("terrain", "model", *heads),
        rows=rows,
        note="The original study and its repetition under the choice, with the same "
        "points and the same held-out trials. Means over trials; difference ± its "
        "standard error over the trials that both have, below zero is better under "
        "the choice; p by the exact permutation test over signs. Smoothing and "
        "window change the training samples; tests use the samples of the original "
        "study. Frame, lag, drift and inertia change the data themselves, including "
        "the test samples." + choice.remark,
        section=ReportSection.CHANGED,
    )


def plain_choice(choice: StudyVariant, before: Study, after: Study) -> dict[str, Any]:
    """Return the comparison as plain values for fits.json."""
    return {
        "choice": choice.text,
        "remark": choice.remark.strip(),
        "terrains": {
            terrain: {
                model: {
                    key: _numbers(before, after, (terrain, model, key))
                    for key, _ in _MEASURES
                }
                for model in choice.models
            }
            for terrain in before.terrains
            if terrain in after.terrains
        },
        "units": dict(_MEASURES),
    }


Measure = tuple[str, str, str]  # terrain, model, measure


def _pair(before: Study, after: Study, measure: Measure) -> PairedComparison | None:
    terrain, model, key = measure
    first, second = (s.terrains[terrain].scores(model, key) for s in (before, after))
    return compare(first, second)


def _numbers(before: Study, after: Study, measure: Measure) -> dict[str, Any]:
    terrain, model, key = measure
    paired = _pair(before, after, measure)
    return {
        "before": mean_of(before.terrains[terrain].scores(model, key)),
        "after": mean_of(after.terrains[terrain].scores(model, key)),
        "paired": None if paired is None else paired._asdict(),
    }


def _cells(before: Study, after: Study, measure: Measure) -> list[str]:
    numbers = _numbers(before, after, measure)
    means = [numbers["before"], numbers["after"]]
    texts = ["–" if mean is None else f"{mean:.3f}" for mean in means]
    return [*texts, paired_cell(_pair(before, after, measure))]


SECTION = Section(ReportSection.CHANGED)  # its tables come with the choices
