"""Export of the terrain database of recorded sessions."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from acquisition.clock import SystemClock
from acquisition.wording import counted
from analysis.study.models import GP_SE, GP_SE_TRIAL, PAPER_MODELS, FitOptions
from analysis.terrains.identify import identify_study
from analysis.terrains.tabulation import database_of
from experiments.operator.console import Console
from experiments.report.choices import ReportRequest
from experiments.report.sessions import results_below, study_sessions
from experiments.session.data_files import write_new_text
from experiments.session.store import SessionFolder, iso_utc

EXPORTED = (*PAPER_MODELS, GP_SE_TRIAL)


def export_terrains(
    sessions: Sequence[SessionFolder],
    data: Path,
    out: Path,
    request: ReportRequest,
    console: Console,
) -> None:
    """Write the terrain database of the sessions to `out`.

    Raises:
        SessionError: no session has a kept trial.
        TrialFileError: `out` exists or cannot be written.
    """
    fit = FitOptions(seed=request.seed, models=(GP_SE, GP_SE_TRIAL), draws=0)
    analysed = study_sessions(sessions, data, request, console, fit)
    study = analysed.study
    options = replace(
        study.options, fit=FitOptions(seed=request.seed, models=EXPORTED, draws=0)
    )
    text = database_of(
        replace(study, options=options),
        identify_study(study),
        iso_utc(SystemClock().utc_ns()),
        store=results_below(data),
    )
    write_new_text(out, text)
    console.say(f"{counted(len(study.terrains), 'terrain')}: {out}")
