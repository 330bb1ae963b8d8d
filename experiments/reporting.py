"""From sessions to a report: which trials, what is said about them."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from acquisition.clock import SystemClock
from acquisition.errors import SessionError, TrialFileError
from acquisition.trial_file.reader import TrialReader
from analysis.load import RecordedTrial, load_trial
from analysis.models import FitOptions
from analysis.prepare import PrepareOptions
from analysis.report import ReportContext, ReportTable, write_report
from analysis.study import StudyOptions, run_study
from experiments.console import Console
from experiments.store import SessionFolder, find_session, iso_utc, list_sessions


def choose_sessions(
    data: Path, names: Sequence[str], *, every: bool
) -> list[SessionFolder]:
    """Return the sessions to report, of one kind only.

    Raises:
        SessionError: none are named or found, or live and simulated ones are mixed.
    """
    if bool(names) == every:
        raise SessionError(
            "Name the sessions to report, or use --all.",
            hint="For example: traction report S012",
        )
    if every:
        sessions = [s for s in list_sessions(data) if s.kept_trials()]
    else:
        sessions = [find_session(data, name) for name in dict.fromkeys(names)]
    if not sessions:
        raise SessionError(
            f"There are no kept trials in {data}.",
            hint="Record some: traction run S0 --fake --fast",
        )
    simulated = [s for s in sessions if s.is_simulated]
    if simulated and len(simulated) < len(sessions):
        raise SessionError(
            f"{simulated[0].id} is simulated. Reports do not mix: name sessions of one "
            "kind."
        )
    return sessions


def report_sessions(
    sessions: Sequence[SessionFolder], data: Path, seed: int, console: Console
) -> Path:
    """Load the kept trials, fit, and write the report; return the page.

    One session is reported into its own folder, several into `data`/study.

    Raises:
        SessionError: no session has a kept trial.
    """
    trials: dict[str, list[RecordedTrial]] = {}
    problems: list[str] = []
    for session in sessions:
        for path in session.kept_trials():
            try:
                trial = load_trial(path)
            except TrialFileError as error:
                problems.append(str(error))
                console.say(f"▲ left out: {error}")
                continue
            trials.setdefault(trial.terrain, []).append(trial)
    count = sum(len(group) for group in trials.values())
    if not count:
        raise SessionError(
            f"{', '.join(s.id for s in sessions)}: no kept trials to report."
        )
    for group in trials.values():
        group.sort(
            key=lambda trial: (
                int(trial.metadata["clock"]["utc_offset_ns"])
                + int(trial.cycles["host_ns"][0])
            )
        )
    console.say(f"{count} trials on {len(trials)} terrains: fitting ...")
    is_simulated = sessions[0].is_simulated
    travel = min(t.frame.travel for group in trials.values() for t in group)
    options = StudyOptions(
        prepare=PrepareOptions(container_travel=travel), fit=FitOptions(seed=seed)
    )
    series = {name: [t.series() for t in group] for name, group in trials.items()}
    study = run_study(series, options, simulated=is_simulated)
    out = sessions[0].path if len(sessions) == 1 else data / "study"
    context = ReportContext(
        title="Traction " + (sessions[0].id if len(sessions) == 1 else "study"),
        subtitle=f"{count} trials on {', '.join(trials)}",
        is_simulated=is_simulated,
        is_foreign=False,
        generated_utc=iso_utc(SystemClock().utc_ns()),
        tables=_tables(sessions, trials),
        warnings=problems,
    )
    return write_report(study, out, context)


def _tables(
    sessions: Sequence[SessionFolder], trials: dict[str, list[RecordedTrial]]
) -> list[ReportTable]:
    every = [trial for group in trials.values() for trial in group]
    tables = [_session_table(sessions), _rejected_table(sessions), _health(every)]
    truth = _truth_table(every)
    return [*tables, *([truth] if truth else []), _provenance(every)]


def _session_table(sessions: Sequence[SessionFolder]) -> ReportTable:
    rows = [
        (
            s.id,
            s.terrain,
            s.path.name[:10],
            str(len(s.kept_trials())),
            str(len(s.rejected_sidecars())),
        )
        for s in sessions
    ]
    return ReportTable(
        "Sessions", ("session", "terrain", "date", "kept", "rejected"), rows
    )


def _rejected_table(sessions: Sequence[SessionFolder]) -> ReportTable:
    rows = [
        (
            s.id,
            f"{facts.get('trial', '?')} attempt {facts.get('attempt', '?')}",
            str(facts.get("status", "")),
            str(facts.get("reason", "")),
            str(facts.get("who", "")),
            str(facts.get("when", "")),
        )
        for s in sessions
        for facts in s.rejected_sidecars()
    ]
    return ReportTable(
        "Rejected and interrupted trials",
        ("session", "trial", "status", "reason", "who", "when (UTC)"),
        rows,
        note="" if rows else "None: every recorded trial was kept.",
    )


def _health(trials: Sequence[RecordedTrial]) -> ReportTable:
    rows: list[tuple[str, ...]] = []
    for trial in trials:
        gaps = np.diff(trial.t) * 1e3
        q7 = trial.cycles["position"][:, 6]
        age = (trial.cycles["host_ns"] - trial.cycles["ft_ns"]).astype(float) * 1e-6
        moving = np.abs(trial.traction[:, 0]) > 0.005
        ratio = np.abs(trial.lateral[moving]).mean() if moving.any() else np.nan
        rows.append(
            (
                f"{trial.terrain} {trial.name}",
                f"{np.median(gaps):.3f}",
                f"{gaps.max():.2f}",
                trial.metadata["result"]["cycles_missed"],
                f"{np.median(age):.2f}",
                f"{np.abs(q7 - q7[0]).max() * 1e3:.1f}",
                f"{ratio:.2f}",
            )
        )
    return ReportTable(
        "Rig health",
        (
            "trial",
            "period, median (ms)",
            "longest gap (ms)",
            "missed",
            "F/T age, median (ms)",
            "joint 7 (mrad)",
            "mean |F_y| while moving (N)",
        ),
        rows,
    )


def _truth_table(trials: Sequence[RecordedTrial]) -> ReportTable | None:
    """Return measured against true for simulated trials with a truth file."""
    rows: list[tuple[str, ...]] = []
    for trial in trials:
        path = trial.path.with_name(trial.path.stem + ".truth.mcap")
        if not path.exists():
            continue
        try:
            truth = TrialReader(path).truth().data
        except TrialFileError:
            continue
        t_true = truth["host_ns"].astype(float)
        inside = (trial.cycles["host_ns"] >= truth["host_ns"][0]) & (
            trial.cycles["host_ns"] <= truth["host_ns"][-1]
        )
        t = trial.cycles["host_ns"][inside].astype(float)
        error = _smooth(trial.traction[inside]) - _smooth(
            np.column_stack(
                [np.interp(t, t_true, truth["traction"][:, k]) for k in range(3)]
            )
        )
        v_t, F_t, F_n = (
            np.sqrt(np.nanmean(error[:, 0] ** 2)),
            *np.nanmean(np.abs(error[:, 1:]), axis=0),
        )
        rows.append(
            (
                f"{trial.terrain} {trial.name}",
                f"{v_t * 1e3:.2f}",
                f"{F_t:.2f}",
                f"{F_n:.2f}",
            )
        )
    if not rows:
        return None
    return ReportTable(
        "Measured against true",
        ("trial", "v_t, rms (mm/s)", "F_t, mean |error| (N)", "F_n, mean |error| (N)"),
        rows,
        note="Simulated trials only; after the same smoothing on both.",
    )


def _smooth(values: np.ndarray, width: int = 11) -> np.ndarray:
    kernel = np.full(width, 1.0 / width)
    columns = [np.convolve(column, kernel, "same") for column in values.T]
    return np.column_stack(columns)


def _provenance(trials: Sequence[RecordedTrial]) -> ReportTable:
    facts: dict[str, set[str]] = {}
    for trial in trials:
        for key, value in trial.metadata["provenance"].items():
            if not key.startswith("sha256:"):
                facts.setdefault(key, set()).add(value)
    rows = [(key, " | ".join(sorted(values))) for key, values in facts.items()]
    return ReportTable("Provenance", ("what", "value"), rows)
