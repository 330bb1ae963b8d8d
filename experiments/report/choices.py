"""Choices of a report: its sessions, its analysis and further options."""

import argparse
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import chain
from pathlib import Path

from acquisition.errors import SessionError, SettingsError
from analysis.data.load import RecordedTrial
from analysis.data.prepare import PrepareOptions
from analysis.data.series import TractionSeries
from analysis.report.sections.sensitivity import (
    StudyVariant,
    parse_choice,
    parse_window,
)
from analysis.study.cluster import require_guarded
from analysis.study.models import REPORTED, FitOptions, parse_models
from analysis.study.store import ResultStore
from analysis.study.study import Study, run_study
from analysis.tustin.model import TustinBounds
from experiments.messages import CATALOGUE
from experiments.operator.console import WARNING, Console
from experiments.report.progress import fitting
from experiments.session.kept_files import check_kept
from experiments.session.reducer import replay
from experiments.session.store import SessionFolder, find_session, list_sessions


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


def repeat_study(
    study: Study,
    trials: Mapping[str, Iterable[RecordedTrial | TractionSeries]],
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
        others.append((choice.with_remark(chain(*trials.values())), other))
    return others


def folder_of(
    sessions: Sequence[SessionFolder], data: Path, request: ReportRequest
) -> Path:
    """Return the folder of a report: a session's own, or that of the study."""
    own = sessions[0].path if len(sessions) == 1 else data / "study"
    return request.out or own


def choose_sessions(
    data: Path, names: Sequence[str], *, every: bool
) -> list[SessionFolder]:
    """Return the sessions to report, of one kind only.

    Raises:
        SessionError: none are named or found, or live and simulated ones are mixed.
    """
    if bool(names) == every:
        hint = "For example: traction report S012"
        raise SessionError("Name the sessions to report, or use --all.", hint=hint)
    if every:
        sessions = [s for s in list_sessions(data) if replay(s.events()).kept]
    else:
        sessions = [find_session(data, name) for name in dict.fromkeys(names)]
    if not sessions:
        hint = "Record some: traction run S0 --fake --fast"
        raise SessionError(f"There are no kept trials in {data}.", hint=hint)
    simulated = [s for s in sessions if s.is_simulated]
    if simulated and len(simulated) < len(sessions):
        message, values = CATALOGUE["mixed"], {"session": simulated[0].id}
        what, hint = (t.format_map(values) for t in (message.what, message.do))
        raise SessionError(what, hint=hint)
    return sessions


def report_missing(
    sessions: Sequence[SessionFolder], console: Console, *, allow_missing: bool
) -> list[str]:
    """Print and return messages on missing or changed kept trials.

    Raises:
        KeptDataError: there are such trials, and `allow_missing` is false.
    """
    deviations = check_kept(sessions, allow_missing=allow_missing)
    texts = [f"Not as in the journal: {deviation.text()}." for deviation in deviations]
    for text in texts:
        console.problem(f"{WARNING} {text}")
    return texts
