"""Section on rig health: timing, tare, joint 7, temperatures and drift by trial."""

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from analysis.data.quality import JOINT7_WARNING
from analysis.data.series import Array
from analysis.report.cell_texts import number_text
from analysis.report.page_model import ReportContext, Section
from analysis.report.results import StudyResults
from analysis.report.section import FigureSpec, ReportSection, ReportTable
from analysis.report.sections.rig_health.health import (
    PERIOD_EDGES,
    SKEW_EDGES,
    RigTrial,
)
from analysis.report.style import Axes, Figure, name_ticks, new_figure, terrain_colours

_NAMED = 8  # largest number of session names below a figure


def health_table(rig: Sequence[RigTrial]) -> ReportTable:
    """Return the table with one row per trial."""
    return ReportTable(
        "Rig health by trial",
        (
            "trial",
            "period, median [ms]",
            "longest [ms]",
            "missed",
            "force sample's age, 5 to 95% [ms]",
            "tare x, y, z [N]",
            "change of tare [N]",
            "joint 7 [mrad]",
            "pucks [°C]",
            "motors [°C]",
            "mean |F_y| moving [N]",
        ),
        [
            (
                f"{trial.terrain} {trial.name}",
                f"{trial.period:.3f}",
                f"{trial.longest_gap:.2f}",
                str(trial.missed),
                f"{trial.skew[0]:.2f} to {trial.skew[2]:.2f}",
                ", ".join(f"{value:.2f}" for value in trial.tare),
                number_text(trial.tare_bracket),
                f"{trial.joint7:.1f}",
                _range(trial.puck_degc),
                _range(trial.motor_degc),
                number_text(trial.lateral),
            )
            for trial in rig
        ],
        note="Age: time from the force sample to the joint replies. "
        "Change of tare: distance to the offset of the next tare, which "
        "brackets the drift of the sensor. –: not known.",
        section=ReportSection.HEALTH,
    )


def _range(values: Sequence[float]) -> str:
    if not values:
        return "–"
    low, high = min(values), max(values)
    return f"{low:.0f}" if low == high else f"{low:.0f} to {high:.0f}"


def draw_timing(results: StudyResults) -> Figure | None:
    """Draw histograms of the period and of the age of the force samples."""
    if not results.rig:
        return None
    figure = new_figure(2.3)
    left, right = figure.subplots(1, 2)
    periods = np.sum([trial.periods for trial in results.rig], axis=0)
    skews = np.sum([trial.skews for trial in results.rig], axis=0)
    # the last bin holds all longer periods
    edges = np.append(PERIOD_EDGES[:-1], PERIOD_EDGES[-2] + 0.2)
    _draw_histogram(left, periods, edges)
    left.set_xlabel("period of the loop [ms], last bar: 8 and more")
    left.axvline(2.0, color="#D55E00", lw=0.9, ls="--")
    left.set_ylabel("cycles")
    _draw_histogram(right, skews, SKEW_EDGES)
    right.set_xlabel("joints later than force sample [ms]")
    right.set_ylabel("cycles")
    return figure


def caption_timing(results: StudyResults) -> str:
    """State the longest period and the typical age of a force sample."""
    longest = max(trial.longest_gap for trial in results.rig)
    missed = sum(trial.missed for trial in results.rig)
    cycles = sum(trial.cycles for trial in results.rig)
    skews = [trial.skew[1] for trial in results.rig]
    return (
        f"{cycles} cycles, {missed} missed, longest period {longest:.2f} ms. At the "
        f"joint replies the force sample is {np.median(skews):.2f} ms old "
        f"(median over trials; {min(skews):.2f} to {max(skews):.2f} ms)."
    )


def draw_rig(results: StudyResults) -> Figure | None:
    """Draw tare change, joint 7, temperatures and load bias of every trial."""
    if not results.rig:
        return None
    figure = new_figure(4.2)
    axes = figure.subplots(2, 2, sharex=True)
    kinds = results.study.kinds
    panels: Sequence[tuple[str, Callable[[RigTrial], float | None]]] = (
        ("change of tare [N]", lambda trial: trial.tare_bracket),
        ("motion of joint 7 [mrad]", lambda trial: trial.joint7),
        (
            "warmest puck or motor [°C]",
            lambda trial: max((*trial.puck_degc, *trial.motor_degc), default=None),
        ),
        ("$F_n$ above the set load [N]", lambda trial: trial.load_bias),
    )
    for ax, (label, measure) in zip(axes.flat, panels, strict=True):
        _draw_by_trial(ax, results.rig, kinds, measure)
        ax.set_ylabel(label)
    axes[0, 0].set_ylim(bottom=0.0)
    low, high = axes[1, 0].get_ylim()
    axes[1, 0].set_ylim(min(low, high - 10.0), high + 2.0)
    axes[0, 1].axhline(JOINT7_WARNING * 1e3, color="#D55E00", lw=0.9, ls="--")
    axes[0, 1].set_ylim(bottom=0.0)
    axes[1, 1].axhline(0.0, color="#808080", lw=0.6)
    for ax in axes[1]:
        name_ticks(ax, list(kinds))
        ax.set_xlabel("terrain, trials from left to right")
    return figure


def caption_rig(results: StudyResults) -> str:
    """State the largest motion of joint 7 and the largest change of tare."""
    joint7 = max(results.rig, key=lambda trial: trial.joint7)
    parts = [f"Joint 7 moved at most {joint7.joint7:.1f} mrad ({joint7.name})"]
    brackets = [t.tare_bracket for t in results.rig if t.tare_bracket is not None]
    if brackets:
        parts.append(f"the tare changed by at most {max(brackets):.2f} N to the next")
    return (
        f"{'; '.join(parts)}. Dashed: warning limit of joint 7. Change of tare: to the "
        "next trial's. Load: median F_n of the moving foot minus the weight of the "
        "virtual mass."
    )


def draw_drift(results: StudyResults) -> Figure | None:
    """Draw tares and load of every trial in order of the sessions."""
    sessions = _by_session(results.rig)
    if len(sessions) < 2:
        return None
    figure = new_figure(3.6)
    above, below = figure.subplots(2, 1, sharex=True)
    for axis, (letter, mark) in enumerate(zip("xyz", "os^", strict=True)):
        x, y = _along_sessions(sessions, lambda trial, k=axis: trial.tare[k])
        above.plot(x, y, mark, ms=2.8, label=f"${letter}$")
    above.set_ylabel("tare [N]")
    above.legend(ncols=3)
    x, y = _along_sessions(sessions, lambda trial: trial.load_bias)
    below.plot(x, y, "o", ms=2.8)
    below.axhline(0.0, color="#808080", lw=0.6)
    below.set_ylabel("$F_n$ above the set load [N]")
    step = -(-len(sessions) // _NAMED)
    below.set_xticks(range(0, len(sessions), step), list(sessions)[::step])
    below.set_xlabel("sessions in order, trials from left to right")
    return figure


def caption_drift(results: StudyResults) -> str:
    """State the change of tares and load from the first to the last session."""
    sessions = list(_by_session(results.rig).values())
    first, last = (
        np.median([trial.tare for trial in sessions[k]], axis=0) for k in (0, -1)
    )
    shift = ", ".join(f"{value:+z.2f}" for value in (last - first).tolist())
    words = f"From first to last session the tare changed by {shift} N (x, y, z)"
    loads = [
        [trial.load_bias for trial in sessions[k] if trial.load_bias is not None]
        for k in (0, -1)
    ]
    if all(loads):
        change = float(np.median(loads[1]) - np.median(loads[0]))
        words += f" and the load by {change:+z.2f} N"
    return (
        f"{words} (medians of a session). A steadily drifting tare indicates a sensor "
        "that is overloaded or warms up; a load that drifts from the set one calls for "
        "a new gravity or friction calibration: traction check shows their age."
    )


def _by_session(rig: Sequence[RigTrial]) -> dict[str, list[RigTrial]]:
    """Group the trials by session, both in order of their start time."""
    sessions: dict[str, list[RigTrial]] = {}
    for trial in sorted(rig, key=lambda entry: (entry.started_utc, entry.name)):
        sessions.setdefault(trial.session, []).append(trial)
    return sessions


def _along_sessions(
    sessions: Mapping[str, Sequence[RigTrial]],
    measure: Callable[[RigTrial], float | None],
) -> tuple[list[float], list[float]]:
    """Return axis positions along the sessions, from 0, and the measured values."""
    pairs = [
        (position + 0.8 * ((k + 0.5) / len(trials) - 0.5), value)
        for position, trials in enumerate(sessions.values())
        for k, trial in enumerate(trials)
        if (value := measure(trial)) is not None
    ]
    return [x for x, _ in pairs], [y for _, y in pairs]


def _draw_by_trial(
    ax: Axes,
    rig: Sequence[RigTrial],
    kinds: Mapping[str, str],
    measure: Callable[[RigTrial], float | None],
) -> None:
    colours = terrain_colours(kinds)
    for position, terrain in enumerate(kinds):
        values = [measure(trial) for trial in rig if trial.terrain == terrain]
        spread = (np.arange(len(values)) + 0.5) / len(values) - 0.5
        pairs = [(x, y) for x, y in zip(spread, values, strict=True) if y is not None]
        if pairs:
            x, y = np.array(pairs).T
            ax.plot(position + 0.8 * x, y, "o", ms=2.8, color=colours[terrain])
    ax.grid(visible=False, axis="x")


def _draw_histogram(ax: Axes, counts: Array, edges: Array) -> None:
    ax.stairs(counts, edges, fill=True, color="#0072B2")
    ax.set_yscale("log")
    ax.set_ylim(0.5, 3.0 * max(float(counts.max()), 1.0))
    filled = np.flatnonzero(counts)
    if filled.size:
        low, high = float(edges[filled[0]]), float(edges[filled[-1] + 1])
        margin = 0.1 * (high - low) + 0.5
        ax.set_xlim(low - margin, high + margin)


TIMING_FIGURE = FigureSpec(
    "timing",
    "Period of the loop and age of the force samples",
    "Histograms over all cycles, logarithmic counts: left the period, right how "
    "much later the joints are than the force sample.",
    draw_timing,
    caption_timing,
)

RIG_FIGURE = FigureSpec(
    "rig",
    "Tare, joint 7, temperatures and load, trial by trial",
    "Four panels with one dot per trial: change of tare to the next trial, motion "
    "of the locked joint, warmest puck or motor, load above the set load.",
    draw_rig,
    caption_rig,
)

DRIFT_FIGURE = FigureSpec(
    "drift",
    "Drift of tare and load over the sessions",
    "Two panels with one dot per trial, session after session: the tare along the "
    "sensor's three axes, and the load above the set load.",
    draw_drift,
    caption_drift,
)


def _tables(results: StudyResults, _: ReportContext) -> list[ReportTable]:
    return [health_table(results.rig)] if results.rig else []


SECTION = Section(
    ReportSection.HEALTH, _tables, (TIMING_FIGURE, RIG_FIGURE, DRIFT_FIGURE)
)
