"""How the rig behaved: timing, sensor, locked joint, temperatures, trial by trial."""

from collections.abc import Callable, Sequence

import numpy as np

from analysis.data.quality import JOINT7_WARNING
from analysis.data.series import Array
from analysis.figures.style import (
    Axes,
    Figure,
    name_ticks,
    new_figure,
    terrain_colours,
)
from analysis.findings.findings import StudyResults
from analysis.findings.rig_health import PERIOD_EDGES, SKEW_EDGES, RigTrial


def draw_timing(found: StudyResults) -> Figure | None:
    """Return histograms of the period and of the age of the force samples."""
    if not found.rig:
        return None
    figure = new_figure(2.3)
    left, right = figure.subplots(1, 2)
    periods = np.sum([trial.periods for trial in found.rig], axis=0)
    skews = np.sum([trial.skews for trial in found.rig], axis=0)
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


def draw_rig(found: StudyResults) -> Figure | None:
    """Return tare bracket, joint 7, temperatures and load bias of every trial."""
    if not found.rig:
        return None
    figure = new_figure(4.2)
    axes = figure.subplots(2, 2, sharex=True)
    terrains = list(found.study.terrains)
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
        _draw_by_trial(ax, found.rig, terrains, measure)
        ax.set_ylabel(label)
    axes[0, 0].set_ylim(bottom=0.0)
    low, high = axes[1, 0].get_ylim()
    axes[1, 0].set_ylim(min(low, high - 10.0), high + 2.0)
    axes[0, 1].axhline(JOINT7_WARNING * 1e3, color="#D55E00", lw=0.9, ls="--")
    axes[0, 1].set_ylim(bottom=0.0)
    axes[1, 1].axhline(0.0, color="#808080", lw=0.6)
    for ax in axes[1]:
        name_ticks(ax, terrains)
        ax.set_xlabel("terrain, trials from left to right")
    return figure


def _draw_by_trial(
    ax: Axes,
    rig: Sequence[RigTrial],
    terrains: list[str],
    measure: Callable[[RigTrial], float | None],
) -> None:
    colours = terrain_colours(terrains)
    for place, terrain in enumerate(terrains):
        values = [measure(trial) for trial in rig if trial.terrain == terrain]
        spread = (np.arange(len(values)) + 0.5) / len(values) - 0.5
        pairs = [(x, y) for x, y in zip(spread, values, strict=True) if y is not None]
        if pairs:
            x, y = np.array(pairs).T
            ax.plot(place + 0.8 * x, y, "o", ms=2.8, color=colours[terrain])
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
