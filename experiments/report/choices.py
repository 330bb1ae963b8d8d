"""Choices of an analysis, from the command line."""

import argparse
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import chain

from acquisition import SettingsError
from analysis.data import PrepareOptions, RecordedTrial, TractionSeries
from analysis.report import StudyVariant, parse_choice, parse_window
from analysis.study import ResultStore, Study, run_study
from analysis.tustin import TustinBounds
from experiments.operator import Console
from experiments.report.progress import fitting


@dataclass(frozen=True, slots=True)
class AnalysisChoices:
    """What a person chose otherwise.

    Attributes:
        prepare: smoothing, thinning and window.
        bounds: box of the Tustin fit.
        variants: what the study is repeated under.
    """

    prepare: PrepareOptions = field(default_factory=PrepareOptions)
    bounds: TustinBounds = field(default_factory=TustinBounds)
    variants: tuple[StudyVariant, ...] = ()


def analysis_choices(args: argparse.Namespace) -> AnalysisChoices:
    """Return the choices of `experiments.arguments.add_analysis`.

    Raises:
        SettingsError: one of them is no choice.
    """
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
    return AnalysisChoices(prepare, bounds, variants)


def _parse_bounds(text: str) -> Mapping[str, tuple[float, float]]:
    """Return the ranges in `b=-50:50,v_s=0.001:0.5`."""
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


def repeat_study(
    study: Study,
    trials: Mapping[str, Sequence[RecordedTrial | TractionSeries]],
    choices: Sequence[StudyVariant],
    console: Console,
    store: ResultStore | None = None,
) -> list[tuple[StudyVariant, Study]]:
    """Return a study of the same trials under each choice."""
    others: list[tuple[StudyVariant, Study]] = []
    for choice in choices:
        console.say(f"What if {choice.text}: fitting ...")
        series = {name: [choice.series(t) for t in ts] for name, ts in trials.items()}
        options = choice.options(study.options)
        with fitting(console) as progress:
            other = run_study(series, options, study.simulated, progress, store)
        others.append((choice.remarked(chain(*trials.values())), other))
    return others
