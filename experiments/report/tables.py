"""Tables of sessions, cells, checks, settings and provenance in a report."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import cast

import numpy as np

from analysis.data.recorded_factors import FOOT, value_text
from analysis.data.terrain_kinds import kind_title
from analysis.report.reduced_trial import ReducedTrial
from analysis.report.section import ReportSection, ReportTable
from analysis.report.traction_ratio import traction_ratio
from analysis.study.models import GP_SE, TUSTIN
from analysis.study.study import Study
from experiments.session.data_files import read_json
from experiments.session.derivation import sidecar_of
from experiments.session.reducer import SessionState, replay
from experiments.session.store import SessionFolder

_ROW = (
    ("incline_deg", "incline [°]"),
    ("stone_size", "stones"),
    ("tread", "tread"),
    ("effective_mass_kg", "virtual mass [kg]"),
    ("foot_mass_kg", "foot [kg]"),
    ("gravity_model", "gravity"),
)


def summary_table(study: Study) -> tuple[list[str], list[list[str]]]:
    """Return header and rows of the summary of a study, a row per terrain.

    F_t/F_n: ratio of the means of a trial, mean and standard deviation over the trials.
    Errors: mean absolute error on held-out trials [N].
    """
    shown = (("Tustin", TUSTIN), ("GP", GP_SE))
    header = ["terrain", "trials", "F_t/F_n"]
    header += [f"error {title} [N]" for title, _ in shown] + ["of a constant [N]"]
    rows: list[list[str]] = []
    for name, result in study.terrains.items():
        errors = [result.maes(model) for _, model in shown]
        numbers = [[mae for mae in maes if mae is not None] for maes in errors]
        rows.append(
            [
                name,
                str(len(result.trials)),
                traction_ratio(result),
                *(f"{np.mean(maes):.2f}" if maes else "–" for maes in numbers),
                f"{result.constant_mae:.2f}" if result.folds else "–",
            ]
        )
    return header, rows


def report_tables(
    sessions: Sequence[SessionFolder], trials: Mapping[str, Sequence[ReducedTrial]]
) -> list[ReportTable]:
    """Return sessions, rejected trials, preflight, settings, provenance and files."""
    every = [trial for group in trials.values() for trial in group]
    states = {session.path: replay(session.events()) for session in sessions}
    return [
        _session_table(sessions, states),
        _rejected_table(sessions, states),
        _preflight_table(sessions),
        _matrix_table(trials),
        _provenance(every),
        _files(sessions, states),
    ]


def _session_table(
    sessions: Sequence[SessionFolder], states: Mapping[Path, SessionState]
) -> ReportTable:
    rows = [
        (
            s.id,
            s.terrain,
            s.path.name[:10],
            "SIMULATED" if s.is_simulated else "LIVE",
            str(len(states[s.path].kept)),
            str(states[s.path].rejected),
        )
        for s in sessions
    ]
    return ReportTable(
        "Sessions",
        ("session", "terrain", "date", "kind", "kept", "rejected"),
        rows,
        section=ReportSection.SUMMARY,
    )


def _rejected_table(
    sessions: Sequence[SessionFolder], states: Mapping[Path, SessionState]
) -> ReportTable:
    rows = [
        (
            s.id,
            f"{attempt.name.kept} attempt {attempt.name.attempt}",
            str(sidecar_of(s, attempt).get("status", "")),
            attempt.verdict.reason,
            attempt.verdict.who,
            attempt.verdict.when,
        )
        for s in sessions
        for attempt in states[s.path].attempts
        if attempt.is_rejected
    ]
    return ReportTable(
        "Acceptance: rejected and interrupted trials",
        ("session", "trial", "status", "reason", "who", "when (UTC)"),
        rows,
        note="" if rows else "None: every recorded trial was kept.",
        section=ReportSection.HEALTH,
    )


def _preflight_table(sessions: Sequence[SessionFolder]) -> ReportTable:
    sessions_of: dict[tuple[str, ...], list[str]] = {}
    for session in sessions:
        checks = read_json(session.path / "preflight.json").get("checks", [])
        for check in cast("list[object]", checks) if isinstance(checks, list) else []:
            if isinstance(check, dict):
                values = cast("dict[str, object]", check)
                result = tuple(str(values.get(k, "")) for k in ("name", "mark", "text"))
                sessions_of.setdefault(result, []).append(session.id)
    return ReportTable(
        "Preflight results",
        ("check", "", "found", "sessions"),
        [(*result, ", ".join(ids)) for result, ids in sorted(sessions_of.items())],
        section=ReportSection.HEALTH,
    )


def _matrix_table(trials: Mapping[str, Sequence[ReducedTrial]]) -> ReportTable:
    rows = [
        (
            name,
            *(
                " | ".join(
                    sorted({trial.metadata["trial"].get(key, "?") for trial in group})
                )
                for key, _ in _ROW
            ),
            " | ".join(sorted({f"{trial.frame.travel:g}" for trial in group})),
        )
        for name, group in trials.items()
    ]
    return ReportTable(
        "Settings of the terrains",
        ("terrain", *(head for _, head in _ROW), "travel [m]"),
        rows,
    )


def _provenance(trials: Sequence[ReducedTrial]) -> ReportTable:
    values: dict[str, set[str]] = {}
    for trial in trials:
        for key, value in trial.metadata["provenance"].items():
            values.setdefault(key, set()).add(value)
    rows = [(key, _few(different)) for key, different in values.items()]
    return ReportTable(
        "Provenance",
        ("what", "value"),
        rows,
        note="As recorded in the trials: code, packages, machine, firmware, and "
        "the checksums of the settings in every trial file.",
    )


def _few(values: set[str]) -> str:
    """Return the values in order, or their count if there are many."""
    if len(values) <= 3:
        return " | ".join(sorted(values))
    return f"{len(values)} different values, in the trial files"


def _files(
    sessions: Sequence[SessionFolder], states: Mapping[Path, SessionState]
) -> ReportTable:
    rows = [
        (
            f"{s.path.name}/{kept.relative_stem}.mcap",
            str(kept.size or "?"),
            kept.sha256 or "?",
        )
        for s in sessions
        for kept in states[s.path].kept_trials
    ]
    return ReportTable("Trial files", ("file", "bytes", "SHA-256"), rows)


def cells_table(
    study: Study, units: Mapping[str, str] | None = None
) -> list[ReportTable]:
    """Return the table of terrains with their factors; none without factors.

    Args:
        study: the study.
        units: units of the factors, by name.
    """
    results = list(study.terrains.values())
    names = dict.fromkeys(n for r in results for n in r.factors if n != FOOT)
    if not names:
        return []
    units = units or {}
    heads = [f"{name} [{units[name]}]" if units.get(name) else name for name in names]
    rows = [
        (
            result.terrain,
            value_text(result.factors.get(FOOT, "?")),
            kind_title(result.kind),
            "?" if result.incline_deg is None else f"{result.incline_deg:+z.1f}",
            *(
                value_text(result.factors[n]) if n in result.factors else "?"
                for n in names
            ),
            str(len(result.trials)),
            traction_ratio(result),
        )
        for result in results
    ]
    header = ("terrain", "foot", "ground", "slope [°]", *heads, "trials", "F_t/F_n")
    return [
        ReportTable(
            "Cells",
            header,
            rows,
            note="Slope: along the push, positive downhill. -: does not apply.",
            section=ReportSection.SUMMARY,
        )
    ]
