"""Reports of recorded sessions: trials, study and page."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from shutil import disk_usage

from acquisition.errors import SessionError, TrialFileError
from acquisition.wording import counted
from analysis.data.load import load_trial
from analysis.data.plausibility import doubt_summary
from analysis.data.recorded_factors import stated_factors
from analysis.report.reduced_trial import ReducedTrial, TrialFiles
from analysis.report.sections.rig_health.health import with_tares
from analysis.study.models import FitOptions
from analysis.study.store import MAX_STORE_BYTES, ResultStore
from analysis.study.study import Study, StudyOptions, run_study
from experiments.operator.console import Console
from experiments.report.choices import ReportRequest
from experiments.report.chosen_sessions import folder_of
from experiments.report.commissioned import uncommissioned
from experiments.report.covariates import recorded_columns
from experiments.report.duplicates import TrialDigests
from experiments.report.progress import fitting
from experiments.report.study_report import (
    ReportedStudy,
    report_study,
    require_folder,
)
from experiments.report.tables import cells_table, report_tables, summary_table
from experiments.report.truth_errors import (
    TruthErrors,
    compare_with_truth,
    truth_tables,
)
from experiments.session.data_files import make_empty
from experiments.session.store import FOLDS, SessionFolder

_SHARE_OF_DISK = 4  # results may take one part in so many of the free space


def _load_trials(
    sessions: Sequence[SessionFolder], console: Console
) -> tuple[dict[str, list[ReducedTrial]], dict[Path, TruthErrors], list[str]]:
    """Load kept trials by terrain, oldest session first; truths; omissions."""
    trials: dict[str, list[ReducedTrial]] = {}
    truths: dict[Path, TruthErrors] = {}
    left_out: list[str] = []
    digests = TrialDigests()  # of recordings, independent of files
    for session in sorted(sessions, key=lambda s: (s.path.name[:10], int(s.id[1:]))):
        for path in session.kept_trials():
            try:
                trial = load_trial(path)
            except TrialFileError as error:
                left_out.append(str(error))
                console.say(f"▲ left out: {error}")
                continue
            if trial.is_simulated is not session.is_simulated:
                raise SessionError(
                    f"{path.name} of {session.id} is "
                    f"{'' if trial.is_simulated else 'not '}simulated, its folder says "
                    "otherwise. A report cannot mix the two.",
                    hint="Put the file back where it came from.",
                )
            name = f"{session.id} {path.stem}"
            if (original := digests.original(name, trial.cycles)) is not None:
                left_out.append(f"{name} is the same recording as {original}")
                console.say(f"▲ left out: {left_out[-1]}")
                continue
            trials.setdefault(trial.terrain, []).append(ReducedTrial.of(trial))
            if (truth := compare_with_truth(trial)) is not None:
                truths[path] = truth
    return trials, truths, left_out


@dataclass(frozen=True, slots=True)
class StudySession:
    """Study of sessions.

    Attributes:
        study: the study.
        trials: the kept trials by terrain, in the matrix's order.
        left_out: omitted recordings, with reasons.
        truths: errors against the truth files, by path of the trial.
    """

    study: Study
    trials: dict[str, list[ReducedTrial]]
    left_out: list[str]
    truths: dict[Path, TruthErrors]

    @property
    def files(self) -> dict[str, TrialFiles]:
        """The trials on disk, by terrain."""
        return {name: TrialFiles(group) for name, group in self.trials.items()}

    @property
    def doubts(self) -> list[str]:
        """Doubts about the trials, one line per reason."""
        return doubt_summary(
            (t.name, t.doubts) for ts in self.trials.values() for t in ts
        )


def results_below(data: Path) -> ResultStore:
    """Return the result store of a data folder; its size depends on the free space."""
    free = disk_usage(data).free if data.is_dir() else 0
    return ResultStore(data / FOLDS, max(MAX_STORE_BYTES, free // _SHARE_OF_DISK))


def study_sessions(
    sessions: Sequence[SessionFolder],
    kept: Path,
    request: ReportRequest,
    console: Console,
    fit: FitOptions,
) -> StudySession:
    """Load the kept trials and fit; finished folds are stored in `kept`.

    Raises:
        SessionError: no session has a kept trial.
    """
    trials, truths, left_out = _load_trials(sessions, console)
    count = sum(len(group) for group in trials.values())
    if not count:
        ids = ", ".join(s.id for s in sessions)
        raise SessionError(f"{ids}: no kept trials to report.")
    trials = {name: trials[name] for name in request.sorted(trials)}
    console.say(
        f"{counted(count, 'trial')} on {counted(len(trials), 'terrain')}: fitting ..."
    )
    travel = min(t.frame.travel for group in trials.values() for t in group)
    options = StudyOptions(
        prepare=replace(request.choices.prepare, container_travel=travel),
        fit=fit,
        scheduler=request.scheduler,
    )
    series = {name: [t.series for t in group] for name, group in trials.items()}
    with fitting(console) as progress:
        study = run_study(
            series,
            options,
            sessions[0].is_simulated,
            progress,
            results_below(kept),
            with_break_away=True,
        )
    return StudySession(study, trials, left_out, truths)


def report_sessions(
    sessions: Sequence[SessionFolder],
    data: Path,
    request: ReportRequest,
    console: Console,
) -> Path:
    """Load the kept trials, fit, and write the report; returns the page.

    The report goes to the folder of `request`, else to that of a single session, else
    to `data`/study.

    Raises:
        SessionError: no session has a kept trial, or the folder of `request` holds
            something else than an earlier report.
        SettingsError: the folder cannot be written.
        MissingLibraryError: the extra `report` is not installed.
    """
    out = folder_of(sessions, data, request.out)
    require_folder(out)
    if request.out is not None and not (out / FOLDS).is_dir():
        make_empty(out)  # it is no earlier report
    kept = request.out or data  # folder of the results, for the next report
    analysed = study_sessions(sessions, kept, request, console, request.fit)
    reported = _reported(sessions, request, analysed)
    store = results_below(kept)
    page = report_study(reported, out, request, console, store)
    console.table(*summary_table(analysed.study))
    for note in analysed.study.groups:
        console.say(note)
    return page


def _reported(
    sessions: Sequence[SessionFolder], request: ReportRequest, analysed: StudySession
) -> ReportedStudy:
    """Return a study with the further tables and warnings of its sessions."""
    study, trials = analysed.study, analysed.trials
    every = [trial for group in trials.values() for trial in group]
    units = {
        name: unit
        for trial in every
        for name, unit in stated_factors(trial.metadata["trial"]).units.items()
    }
    return ReportedStudy(
        study,
        title="Traction " + (sessions[0].id if len(sessions) == 1 else "study"),
        subtitle=f"{counted(len(every), 'trial')} on {', '.join(trials)}",
        is_foreign=False,
        trials=analysed.files,
        with_columns=recorded_columns(analysed.files, request.covariates),
        cells=cells_table(study, units),
        tables=[
            *truth_tables(study, trials, analysed.truths),
            *report_tables(sessions, trials),
        ],
        rig=with_tares([trial.health for trial in every], every),
        warnings=[
            *uncommissioned((trial.name, trial.metadata) for trial in every),
            *request.missing,
            *analysed.left_out,
            *analysed.doubts,
        ],
        numbers={"left_out": analysed.left_out},
    )
