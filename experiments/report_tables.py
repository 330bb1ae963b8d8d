"""What a report says of sessions and rig, beyond the models."""

from collections.abc import Sequence

import numpy as np

from analysis.identify import LEVELS, WINDOWS, identify_study
from analysis.load import RecordedTrial
from analysis.report import ReportTable
from analysis.study import Study
from experiments.store import SessionFolder
from experiments.truth import truth_errors

_KEPT_PER_SECOND = 100


def report_tables(
    sessions: Sequence[SessionFolder], trials: dict[str, list[RecordedTrial]]
) -> list[ReportTable]:
    """Return sessions, rejected trials, rig health, truth and provenance."""
    every = [trial for group in trials.values() for trial in group]
    tables = [_session_table(sessions), _rejected_table(sessions), _health(every)]
    truth = _truth_table(every)
    return [*tables, *([truth] if truth else []), _provenance(every)]


def identification_tables(study: Study) -> list[ReportTable]:
    """Return how well windows of motion tell the terrains apart; none for one."""
    found = identify_study(study)
    if found is None:
        return []
    shares = [
        (
            f"{size / _KEPT_PER_SECOND:g} s",
            *(f"{found.by_density[size][level].accuracy:.2f}" for level in LEVELS),
            *(f"{found.by_error[size][level].accuracy:.2f}" for level in LEVELS),
        )
        for size in WINDOWS
    ]
    confusion = found.by_density[100]["terrain"]
    counts = [
        (name, *map(str, row))
        for name, row in zip(confusion.names, confusion.counts.tolist(), strict=True)
    ]
    return [
        ReportTable(
            "Telling terrains apart",
            (
                "window",
                *(f"by density: {level}" for level in LEVELS),
                *(f"by error: {level}" for level in LEVELS),
            ),
            shares,
            note="Share of windows recognised by models that never saw the trial, mean "
            "over kinds. By error: the model with the smallest mean absolute error.",
        ),
        ReportTable(
            "Windows of 1 s: from (rows), taken for (columns)",
            ("", *confusion.names),
            counts,
        ),
    ]


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
        error = truth_errors(trial)
        if error is None:
            continue
        rows.append(
            (
                f"{trial.terrain} {trial.name}",
                f"{error.v_t * 1e3:.2f}",
                f"{error.F_t:.2f}",
                f"{error.F_n:.2f}",
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


def _provenance(trials: Sequence[RecordedTrial]) -> ReportTable:
    facts: dict[str, set[str]] = {}
    for trial in trials:
        for key, value in trial.metadata["provenance"].items():
            if not key.startswith("sha256:"):
                facts.setdefault(key, set()).add(value)
    rows = [(key, " | ".join(sorted(values))) for key, values in facts.items()]
    return ReportTable("Provenance", ("what", "value"), rows)
