"""What the ground gives before it goes: peaks of pushes, and the models of them."""

import numpy as np

from analysis.figures.spec import FigureSpec
from analysis.figures.style import (
    LOAD_LABEL,
    Axes,
    Figure,
    panel_grid,
    plain,
)
from analysis.findings.break_away import RISKS, TerrainBreakAway
from analysis.findings.findings import StudyResults

_CURVES = ("#0072B2", "#D55E00", "#009E73")
_STYLES = ("-", "--", "-.")
_SLIP, _HELD = "#4d4d4d", "#CC79A7"
_MIDDLE = RISKS[1]  # the curve with an interval


def draw_available(results: StudyResults) -> Figure | None:
    """Return the force available over F_n, a panel per terrain, with the peaks."""
    shown = list(results.break_away.values())
    if not shown:
        return None
    figure, axes = panel_grid(len(shown), 2.1)
    for ax, found in zip(axes, shown, strict=True):
        _draw_peaks(ax, found)
        for risk, colour, style in zip(RISKS, _CURVES, _STYLES, strict=True):
            curve = found.model.curve(found.loads, risk)
            ax.plot(
                found.loads, curve, style, color=colour, lw=1.6, label=f"risk {risk:g}"
            )
        _draw_interval(ax, found)
        _name(ax, found)
    axes[0].set_ylim(0.0, 1.15 * max(float(found.forces[-1]) for found in shown))
    axes[0].set_xlim(left=0.0)
    figure.supxlabel(LOAD_LABEL, fontsize=8)
    figure.supylabel("traction force from rest [N]", fontsize=8)
    _legend(figure, axes)
    return figure


def caption_available(results: StudyResults) -> str:
    """State the forces at the median load and what is in motion beside them."""
    parts = []
    for name, found in results.break_away.items():
        answer = found.model.available(found.load, _MIDDLE)
        motion = found.motion_quantile(_MIDDLE)
        parts.append(
            f"{name} {answer.force:.1f} N ({answer.low:.1f} to {answer.high:.1f}) at "
            f"{found.load:.1f} N"
            + ("" if motion is None else f", in motion {motion:.1f} N")
        )
    speeds = {found.model.v_slip for found in results.break_away.values()}
    limits = ", ".join(f"{speed:g}" for speed in sorted(speeds))
    return (
        f"Peaks of pushes from rest; a slip is faster than {limits} m/s. A push that "
        "held says only that break-away lies above its peak. Curves: force at which a "
        "push at a new place in a new trial slips with that probability; band: 90 % "
        f"interval at {_MIDDLE:g} by resampled trials. With risk {_MIDDLE:g}: "
        f"{'; '.join(parts)}."
    )


def draw_risk(results: StudyResults) -> Figure | None:
    """Return the risk over the force asked for, with Kaplan and Meier's steps."""
    shown = [f for f in results.break_away.values() if f.survival is not None]
    if not shown:
        return None
    figure, axes = panel_grid(len(shown), 1.8)
    for ax, found in zip(axes, shown, strict=True):
        _draw_survival(ax, found)
        ax.plot(
            found.forces,
            found.mean_risk,
            color=_CURVES[1],
            lw=1.6,
            label="model, mean over the loads",
        )
        _name(ax, found)
    axes[0].set_ylim(0.0, 1.25)  # room for the words
    axes[0].set_yticks(np.linspace(0.0, 1.0, 6))
    axes[0].set_xlim(left=0.0)
    figure.supxlabel("traction force asked for [N]", fontsize=8)
    figure.supylabel("probability of a slip before it", fontsize=8)
    _legend(figure, axes)
    return figure


def caption_risk(results: StudyResults) -> str:
    """State how far the models are from Kaplan and Meier's curves."""
    parts = [
        f"{name} {found.model.distance:.2f} ({found.limit:.2f})"
        for name, found in results.break_away.items()
        if found.limit is not None
    ]
    return (
        "Steps: share of pushes that slipped below a force, those that held censored "
        "at their peak (Kaplan-Meier); line: the model at the loads of the same "
        "pushes. Largest difference of the probability transforms, and its critical "
        f"value at 5 %: {', '.join(parts) or 'none'}."
    )


def _draw_peaks(ax: Axes, found: TerrainBreakAway) -> None:
    is_held = found.is_held
    for chosen, mark, colour, label in (
        (~is_held, "o", _SLIP, "slipped"),
        (is_held, "^", _HELD, "held"),
    ):
        ax.plot(
            found.F_n[chosen],
            found.peaks[chosen],
            mark,
            ms=3.4,
            mfc="none" if mark == "^" else colour,
            mec=colour,
            mew=0.9,
            alpha=0.75,
            label=label,
        )


def _draw_interval(ax: Axes, found: TerrainBreakAway) -> None:
    answers = [found.model.available(float(load), _MIDDLE) for load in found.loads]
    ax.fill_between(
        found.loads,
        [answer.low for answer in answers],
        [answer.high for answer in answers],
        color=_CURVES[1],
        alpha=0.2,
        lw=0,
    )


def _draw_survival(ax: Axes, found: TerrainBreakAway) -> None:
    curve = found.survival
    if curve is None:
        return
    at = np.concatenate([[0.0], curve.at, [found.forces[-1]]])
    below = np.concatenate([[0.0], curve.below, curve.below[-1:]])
    ax.step(at, below, where="post", color=_CURVES[0], lw=1.1, label="Kaplan-Meier")
    held = found.peaks[found.is_held]
    ax.plot(held, curve.share_below(held), "|", ms=5, color=_HELD, label="held")


def _name(ax: Axes, found: TerrainBreakAway) -> None:
    ax.set_title(plain(found.title), loc="left")
    ax.text(
        0.03,
        0.97,
        f"{found.model.kind}\n{found.model.slips} slipped, {found.model.held} held",
        transform=ax.transAxes,
        va="top",
        fontsize=6,
    )


def _legend(figure: Figure, axes: list[Axes]) -> None:
    handles, labels = axes[0].get_legend_handles_labels()
    columns = len(labels) if len(axes) > 1 else 2
    figure.legend(handles, labels, loc="outside upper center", ncols=columns)


FIGURES = (
    FigureSpec(
        "break_away",
        "From rest: available force over normal force",
        "Peaks of traction force over normal force, pushes that slipped and pushes "
        "that held, with curves of the force available at three risks, one panel per "
        "terrain.",
        draw_available,
        caption_available,
    ),
    FigureSpec(
        "break_away_risk",
        "From rest: slip probability over required force",
        "Probability of a slip over the traction force that is asked for, by "
        "Kaplan-Meier and by the model, one panel per terrain.",
        draw_risk,
        caption_risk,
    ),
)
