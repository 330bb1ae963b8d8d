"""A study repeated under a choice that the paper leaves open, and both side by side."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

from acquisition import SettingsError
from analysis.data import Frame, RecordedTrial, TractionSeries
from analysis.figures import ReportSection
from analysis.report.further_tables import paired_cell
from analysis.report.page_model import ReportTable
from analysis.study import (
    FITTERS,
    GP_NN,
    GP_NN_TUSTIN,
    GP_SE_TUSTIN,
    TITLES,
    TUSTIN,
    PairedComparison,
    Study,
    StudyOptions,
    compare,
    mean_of,
)
from analysis.tustin import TustinForm

VALUES = {
    "smoothing": "an odd number of samples, e.g. smoothing=15",
    "window": "slowest:fastest in m/s, e.g. window=0.01:0.2",
    "frame": "sole or terrain",
    "drift": "interpolated (between the tares) or first (the tare before the trial)",
    "kernel": "as_printed (eq. 5 without 1 +) or default",
    "static_friction": "proportional (F_s = f_s F_n) or constant",
}
_WIDEST = 501  # samples of smoothing: a second
_MEASURES = (("mae", "N"), ("nlpd", "log N"))


@dataclass(frozen=True, slots=True)
class StudyVariant:
    """One choice made otherwise.

    Attributes:
        key: which one.
        value: how, as given.
        models: names of the models that it touches.
        frame: the frame that forces are projected on.
        change: from the options of the study to those of the repeated one.
        is_interpolated: the sensor's zero lies on a line between two tares.
    """

    key: str
    value: str
    models: tuple[str, ...]
    frame: Frame
    change: Callable[[StudyOptions], StudyOptions]
    is_interpolated: bool = False

    @property
    def text(self) -> str:
        """The choice as it was given."""
        return f"{self.key}={self.value}"

    def series(self, trial: RecordedTrial) -> TractionSeries:
        """Return what the models get of a trial under the choice."""
        chosen = trial.interpolated() if self.is_interpolated else trial
        return chosen.series(self.frame)

    def options(self, before: StudyOptions) -> StudyOptions:
        """Return the options of the repeated study, only of the models it touches."""
        fit = replace(before.fit, models=self.models, draws=0)
        return self.change(replace(before, fit=fit))


def parse_choice(text: str) -> StudyVariant:
    """Return the choice in `text`: KEY=VALUE.

    Raises:
        SettingsError: an unknown key or value; the hint lists what there is.
    """
    key, _, value = (part.strip() for part in text.partition("="))
    if key not in VALUES:
        raise SettingsError(
            f"--what-if {text[:60]!r}: there is no choice {key[:30]!r}.", hint=_listed()
        )
    try:
        return _PARSERS[key](value)
    except (ValueError, SettingsError) as error:
        raise SettingsError(
            f"--what-if {text[:60]!r}: {value[:30]!r} is no value of {key}.",
            hint=f"Give {VALUES[key]}.",
        ) from error


def side_by_side(choice: StudyVariant, before: Study, after: Study) -> ReportTable:
    """Return errors of both studies per terrain and model, trial by trial."""
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
        note="The study as it is, then repeated under the choice, with the same points "
        "and the same trials left out. Means over trials; difference ± its standard "
        "error over the trials that both have, below zero is better under the choice; "
        "p by all patterns of signs. Choices that change which samples are kept are "
        "tested on other samples.",
        section=ReportSection.CHANGED,
    )


def plain_choice(choice: StudyVariant, before: Study, after: Study) -> dict[str, Any]:
    """Return the comparison as plain values for fits.json."""
    return {
        "choice": choice.text,
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


Place = tuple[str, str, str]  # terrain, model, measure


def _pair(before: Study, after: Study, place: Place) -> PairedComparison | None:
    terrain, model, key = place
    first, second = (s.terrains[terrain].scores(model, key) for s in (before, after))
    return compare(first, second)


def _numbers(before: Study, after: Study, place: Place) -> dict[str, Any]:
    terrain, model, key = place
    paired = _pair(before, after, place)
    return {
        "before": mean_of(before.terrains[terrain].scores(model, key)),
        "after": mean_of(after.terrains[terrain].scores(model, key)),
        "paired": None if paired is None else paired._asdict(),
    }


def _cells(before: Study, after: Study, place: Place) -> list[str]:
    numbers = _numbers(before, after, place)
    means = [numbers["before"], numbers["after"]]
    texts = ["–" if mean is None else f"{mean:.3f}" for mean in means]
    return [*texts, paired_cell(_pair(before, after, place))]


def _listed() -> str:
    return "The choices are: " + "; ".join(
        f"{key} ({value})" for key, value in VALUES.items()
    )


def _smoothing(value: str) -> StudyVariant:
    width = int(value)
    if not 1 <= width <= _WIDEST:
        raise ValueError(value)
    return _of_samples(
        "smoothing", value, lambda o: replace(o.prepare, smoothing=width)
    )


def _window(value: str) -> StudyVariant:
    slowest, fastest = (float(part) for part in value.split(":"))
    if not (math.isfinite(slowest) and math.isfinite(fastest)):
        raise ValueError(value)
    return _of_samples(
        "window",
        value,
        lambda o: replace(o.prepare, slowest=slowest, fastest=fastest),
    )


def _of_samples(
    key: str, value: str, prepare: Callable[[StudyOptions], Any]
) -> StudyVariant:
    prepare(StudyOptions())  # refused here, not in the middle of a study
    return StudyVariant(
        key,
        value,
        tuple(FITTERS),
        "terrain",
        lambda options: replace(options, prepare=prepare(options)),
    )


def _frame(value: str) -> StudyVariant:
    frames: Mapping[str, Frame] = {"sole": "sole", "terrain": "terrain"}
    if value not in frames:
        raise ValueError(value)
    return StudyVariant(
        "frame", value, tuple(FITTERS), frames[value], lambda options: options
    )


def _drift(value: str) -> StudyVariant:
    is_interpolated = _one_of(value, "interpolated", "first")
    return StudyVariant(
        "drift",
        value,
        tuple(FITTERS),
        "terrain",
        lambda options: options,
        is_interpolated=is_interpolated,
    )


def _kernel(value: str) -> StudyVariant:
    printed = _one_of(value, "as_printed", "default")
    return StudyVariant(
        "kernel",
        value,
        (GP_NN, GP_NN_TUSTIN),
        "terrain",
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
        "terrain",
        lambda o: replace(o, fit=replace(o.fit, form=form)),
    )


def _one_of(value: str, yes: str, no: str) -> bool:
    if value not in {yes, no}:
        raise ValueError(value)
    return value == yes


_PARSERS: Mapping[str, Callable[[str], StudyVariant]] = {
    "smoothing": _smoothing,
    "window": _window,
    "frame": _frame,
    "drift": _drift,
    "kernel": _kernel,
    "static_friction": _static_friction,
}
