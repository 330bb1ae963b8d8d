"""Choices of a report: its analysis and further options."""

import argparse
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

from acquisition.errors import SettingsError
from analysis.data.prepare import PrepareOptions
from analysis.report.sections.sensitivity import (
    StudyVariant,
    parse_choice,
    parse_window,
)
from analysis.study.cluster import require_guarded
from analysis.study.models import REPORTED, FitOptions, parse_models
from analysis.tustin.model import TustinBounds


@dataclass(frozen=True, slots=True)
class AnalysisChoices:
    """Choices of the analysis.

    Attributes:
        prepare: smoothing, thinning and window.
        bounds: bounds of the Tustin fit.
        models: names of the models.
        variants: choices under which the study is repeated.
    """

    prepare: PrepareOptions = field(default_factory=PrepareOptions)
    bounds: TustinBounds = field(default_factory=TustinBounds)
    models: tuple[str, ...] = REPORTED
    variants: tuple[StudyVariant, ...] = ()


@dataclass(frozen=True, slots=True)
class ReportRequest:
    """Options of a report.

    Attributes:
        seed: seed of the training points of the Gaussian processes.
        terrains: names in the matrix's order; none for tables.
        scheduler: address of a Dask scheduler; None = this machine.
        choices: settings of the analysis.
        missing: messages on missing or changed kept trials.
        covariates: names of the columns to test.
        out: folder of the report; None = that of the session, or `data`/study.
        with_pdf: write figures as PDF, too.
    """

    seed: int
    terrains: Sequence[str] = ()
    scheduler: str | None = None
    choices: AnalysisChoices = field(default_factory=AnalysisChoices)
    missing: Sequence[str] = ()
    covariates: Sequence[str] = ()
    out: Path | None = None
    with_pdf: bool = False

    def sorted(self, names: Iterable[str]) -> list[str]:
        """Return `names` in the matrix's order, others last by name."""
        rank = {name: i for i, name in enumerate(self.terrains)}
        return sorted(names, key=lambda name: (rank.get(name, len(rank)), name))

    @property
    def fit(self) -> FitOptions:
        """Options of the fits."""
        return FitOptions(
            self.choices.bounds, seed=self.seed, models=self.choices.models
        )


def analysis_choices(args: argparse.Namespace) -> AnalysisChoices:
    """Return the choices from the options of `add_analysis_options`.

    Raises:
        SettingsError: an option is invalid.
    """
    if args.scheduler is not None:
        require_guarded(args.scheduler)
    prepare = PrepareOptions()
    if args.smooth is not None:
        prepare = replace(prepare, smoothing=args.smooth)
    if args.every is not None:
        prepare = replace(prepare, downsample=args.every)
    if args.window is not None:
        try:
            slowest, fastest = parse_window(args.window)
        except ValueError as error:
            raise SettingsError(
                f"--window {args.window[:40]!r}: not two velocities.",
                hint="Write e.g. --window 0.005:0.2",
            ) from error
        prepare = replace(prepare, slowest=slowest, fastest=fastest)
    bounds = TustinBounds(**_parse_bounds(args.bounds or ""))
    variants = tuple(parse_choice(text) for text in args.what_if)
    models = REPORTED if args.models is None else parse_models(args.models)
    return AnalysisChoices(prepare, bounds, models, variants)


def _parse_bounds(text: str) -> Mapping[str, tuple[float, float]]:
    """Parse ranges such as `b=-50:50,v_s=0.001:0.5`."""
    names = [name for name, _ in TustinBounds().items()]
    bounds: dict[str, tuple[float, float]] = {}
    for part in filter(None, text.split(",")):
        name, _, value = (piece.strip() for piece in part.partition("="))
        try:
            if name not in names:
                raise ValueError(name)
            bounds[name] = parse_window(value)
        except ValueError as error:
            raise SettingsError(
                f"--bounds {text[:60]!r}: {part[:30]!r} is not a range of a parameter.",
                hint=f"Write e.g. --bounds b=-50:50; the names are {', '.join(names)}.",
            ) from error
    return bounds
