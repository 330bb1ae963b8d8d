"""Tables of sessions, checks, settings and provenance in a report."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any, cast

import numpy as np

from acquisition.trial_file.data_files import list_folder
from analysis.figures.sections import ReportSection
from analysis.findings.held_trial import HeldTrial
from analysis.findings.trends import traction_ratio
from analysis.foresight.judged import SLID
from analysis.foresight.scores import GroundScore, SlipScore
from analysis.report.page_model import ReportTable
from analysis.study.models import GP_SE, TUSTIN
from analysis.study.study import Study
from experiments.session.data_files import read_json
from experiments.session.store import SessionFolder

_SLIP_HEADER = (
    "terrain",
    "slips",
    "recall",
    "lead [ms]",
    "0.1 s ahead",
    "needless time",
    "false alarms/min",
    "false-alarm share",
    "recall by chance",
    "calibration error",
)
_SLIP_NOTE = (
    "Every trial is predicted by models of the other four fifths of the trials, the "
    "alarm's threshold included (5-fold cross-validation). Recall: slips with a "
    "warning in the 0.2 s before v_t rose above 0.03 m/s. Lead: from the beginning "
    "of that alarm, at most 2 s. False-alarm time: share of at-risk time outside "
    "those 0.2 s in warning. By chance: recall of the same warnings shifted in time. "
    "All numbers include the delay of the causal filters, 8 to 14 ms. Of more than 50 "
    "trials of a terrain 50 are taken."
)
_ROW = (
    ("incline_deg", "incline [°]"),
    ("stone_size", "stones"),
    ("tread", "tread"),
    ("effective_mass_kg", "virtual mass [kg]"),
    ("foot_mass_kg", "foot [kg]"),
    ("gravity_model", "gravity"),
)


def summary_table(study: Study) -> tuple[list[str], list[list[str]]]:
    """Return header and rows of what a study comes to, a row per terrain.

    F_t/F_n: ratio of the means of a trial, mean over the trials and their standard
    deviation. Errors: mean absolute error of trials left out [N].
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
    sessions: Sequence[SessionFolder], trials: Mapping[str, Sequence[HeldTrial]]
) -> list[ReportTable]:
    """Return sessions, rejected trials, preflight, settings, provenance and files."""
    every = [trial for group in trials.values() for trial in group]
    return [
        _session_table(sessions),
        _rejected_table(sessions),
        _preflight_table(sessions),
        _matrix_table(trials),
        _provenance(every),
        _files(sessions),
    ]


def _session_table(sessions: Sequence[SessionFolder]) -> ReportTable:
    rows = [
        (
            s.id,
            s.terrain,
            s.path.name[:10],
            "SIMULATED" if s.is_simulated else "LIVE",
            str(len(list_folder(s.trials, "T??.mcap"))),
            str(len(s.rejected_sidecars())),
        )
        for s in sessions
    ]
    return ReportTable(
        "Sessions",
        ("session", "terrain", "date", "kind", "kept", "rejected"),
        rows,
        section=ReportSection.SUMMARY,
    )


def _rejected_table(sessions: Sequence[SessionFolder]) -> ReportTable:
    rows = [
        (
            s.id,
            f"{sidecar.get('trial', '?')} attempt {sidecar.get('attempt', '?')}",
            str(sidecar.get("status", "")),
            str(sidecar.get("reason", "")),
            str(sidecar.get("who", "")),
            str(sidecar.get("when", "")),
        )
        for s in sessions
        for sidecar in s.rejected_sidecars()
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


def _matrix_table(trials: Mapping[str, Sequence[HeldTrial]]) -> ReportTable:
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


def _provenance(trials: Sequence[HeldTrial]) -> ReportTable:
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
    """Return the values in order; many, as of checksums per trial, are counted."""
    if len(values) <= 3:
        return " | ".join(sorted(values))
    return f"{len(values)} different values, in the trial files"


def _files(sessions: Sequence[SessionFolder]) -> ReportTable:
    rows: list[tuple[str, str, str]] = []
    for session in sessions:
        for path in list_folder(session.trials, "T*.json"):
            sidecar = read_json(path)
            name = f"{session.path.name}/trials/{path.stem}.mcap"
            digest, size = (str(sidecar.get(key, "?")) for key in ("sha256", "size"))
            rows.append((name, size, digest))
    return ReportTable("Trial files", ("file", "bytes", "SHA-256"), rows)


def foresight_tables(
    slips: Mapping[str, SlipScore],
    grounds: Mapping[str, Mapping[str, Sequence[float]]],
    surface: GroundScore | None,
) -> tuple[ReportTable, ...]:
    """Return what foresight is worth.

    Args:
        slips: scores by terrain; empty where there were too few slips.
        grounds: mean probability of the own terrain and surface after `SLID`.
        surface: how flat and rocky ground are told apart; None with one of them only.
    """
    tables = [_slip_table(slips)] if slips else []
    if grounds:
        tables.append(_ground_table(grounds))
    if surface is not None:
        tables.append(_surface_table(asdict(surface)))
    return tuple(tables)


def _slip_table(scores: Mapping[str, SlipScore]) -> ReportTable:
    rows = [
        (
            name,
            str(score.onsets),
            _share(score.recall),
            _number(1e3 * score.lead, ".0f"),
            _share(score.early) if score.onsets else "-",
            _share(score.needless),
            _number(score.per_minute, ".1f"),
            _share(score.false_share),
            _share(score.chance),
            _number(score.calibration, ".3f"),
        )
        for name, score in scores.items()
    ]
    return ReportTable(
        "Foresight: slips within 200 ms, held-out trials",
        _SLIP_HEADER,
        rows,
        note=_SLIP_NOTE,
        section=ReportSection.BEYOND,
    )


def _ground_table(rows: Mapping[str, Mapping[str, Sequence[float]]]) -> ReportTable:
    times = [f"{n * 0.01:g} s" for n in SLID]
    return ReportTable(
        "Foresight: probability of the true terrain over time",
        (
            "terrain",
            *(f"terrain, {time}" for time in times),
            *(f"flat or rocky, {time}" for time in times),
            f"none, {times[-1]}",
        ),
        [
            (
                name,
                *map(_share, row["terrain"]),
                *map(_share, row["surface"]),
                _share(row["none"][-1]),
            )
            for name, row in rows.items()
        ],
        note="Mean probability, by models of other trials, of the terrain, of its "
        "surface (given that the terrain is a known one) and of none of them, after "
        "so much sliding in a trial.",
        section=ReportSection.BEYOND,
    )


def _surface_table(score: Mapping[str, Any]) -> ReportTable:
    rows = [
        ("correct after 0.5 s of sliding", _share(score["accuracy"][0])),
        ("correct after 1 s of sliding", _share(score["accuracy"][1])),
        ("correct after 0.5 s, started anywhere", _share(score["anywhere"][0])),
        ("correct after 1 s, started anywhere", _share(score["anywhere"][1])),
        ("wrong at 98 % confidence", _number(score["sure_and_wrong"], ".3f")),
        ("calibration error", _number(score["calibration"], ".3f")),
        ("95 % after a change of ground, median [s]", _number(score["back"], ".2f")),
        ("the slowest of them [s]", _number(score["slowest"], ".2f")),
    ]
    return ReportTable(
        "Foresight: flat or rocky, held-out trials",
        ("what", "value"),
        rows,
        note="A change of ground is a splice of two trials in the middle of sliding.",
        section=ReportSection.BEYOND,
    )


def _share(value: float) -> str:
    return _number(value, ".2f")


def _number(value: float, form: str) -> str:
    return format(value, form) if np.isfinite(value) else "-"
