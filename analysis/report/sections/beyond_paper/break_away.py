"""Force available from rest: break-away models compared with recorded pushes."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from analysis.data.series import Array
from analysis.report.results import StudyResults
from analysis.report.section import FigureSpec, ReportSection, ReportTable
from analysis.report.style import LOAD_LABEL, Axes, Figure, panel_grid, plain
from analysis.study.models import GP_SE
from analysis.study.pushes import FootPush, find_pushes
from analysis.study.slip_risk import BREAK_AWAY, SLIDING, BreakAwayModel
from analysis.study.survival import SurvivalCurve, kaplan_meier, pit_limit
from analysis.study.terrain_fit import TerrainResult

RISKS = (0.05, 0.1, 0.5)  # slip probabilities at which forces are stated
BREAK_AWAY_UNITS = {
    "law": "log N (sliding: N), 1, log N, log N",
    "v_slip": "m/s",
    "F_n, loads, forces, available, in_motion": "N",
    "pushes": "peak N, F_n N, held",
}
_POINTS = 60  # points of a curve
_CURVES = ("#0072B2", "#D55E00", "#009E73")
_STYLES = ("-", "--", "-.")
_SLIP, _HELD = "#4d4d4d", "#CC79A7"
_SHOWN_RISK = RISKS[1]  # risk of the curve with an interval, and in the caption


@dataclass(frozen=True, slots=True)
class TerrainBreakAway:
    """Break-away model of a terrain and the pushes it was fitted to.

    Attributes:
        terrain: name of the terrain.
        title: name and kind of the terrain.
        model: model fitted to all trials.
        pushes: pushes of all kept trials, in order.
        motion: mean and standard deviation [N] of F_t at the slowest velocity of the
            window and the median normal force; None without a Gaussian process.
    """

    terrain: str
    title: str
    model: BreakAwayModel
    pushes: tuple[FootPush, ...]
    motion: tuple[float, float] | None

    @property
    def peaks(self) -> Array:
        """Peaks of the pushes [N], shape (n,)."""
        return np.array([push.peak for push in self.pushes])

    @property
    def F_n(self) -> Array:
        """Normal forces of the pushes [N], shape (n,)."""
        return np.array([push.F_n for push in self.pushes])

    @property
    def is_held(self) -> np.ndarray:
        """Whether each push held, shape (n,)."""
        return np.array([push.is_held for push in self.pushes], dtype=bool)

    @property
    def load(self) -> float:
        """Median F_n of the pushes, or of the model's range without pushes [N]."""
        return float(np.median(self.F_n if self.pushes else self.model.loads))

    @property
    def loads(self) -> Array:
        """Normal forces at which curves are drawn [N], without extrapolation."""
        return np.linspace(*self.model.loads, _POINTS)

    @property
    def forces(self) -> Array:
        """Traction forces at which curves are drawn [N], from 0 to the largest."""
        most = max([self.model.forces[1], *self.peaks.tolist()])
        return np.linspace(0.0, most, _POINTS)

    @property
    def survival(self) -> SurvivalCurve | None:
        """Kaplan-Meier curve of the peaks; None without a slip."""
        if self.is_held.all():
            return None
        return kaplan_meier(self.peaks, self.is_held)

    @property
    def mean_risk(self) -> Array:
        """Model risk at `forces`, averaged over the normal forces of the pushes."""
        risks = [
            self.model.risks(np.full(self.F_n.size, force), self.F_n)
            for force in self.forces
        ]
        return np.array([float(np.mean(risk)) for risk in risks])

    @property
    def critical_distance(self) -> float | None:
        """Critical value of `model.distance` at the 5 % level; None for sliding."""
        if self.model.kind != BREAK_AWAY:
            return None
        return pit_limit(self.model.slips)

    def motion_quantile(self, share: float) -> float | None:
        """Return the quantile `share` of F_t in motion [N]; None without `motion`."""
        from scipy.special import ndtri

        if self.motion is None:
            return None
        return self.motion[0] + self.motion[1] * float(ndtri(share))

    def numbers(self) -> dict[str, Any]:
        """Return the reported numbers as plain values for fits.json."""
        model = self.model
        available = [model.available(self.load, risk) for risk in RISKS]
        return {
            **{k: v for k, v in model.to_dict().items() if k != "draws"},
            "F_n": self.load,
            "available": [
                {"risk": risk, "force": a.force, "low": a.low, "high": a.high}
                for risk, a in zip(RISKS, available, strict=True)
            ],
            "in_motion": {str(risk): self.motion_quantile(risk) for risk in RISKS},
            "limit": self.critical_distance,
            "pushes": [
                [push.peak, push.F_n, float(push.is_held)] for push in self.pushes
            ],
        }


def break_away_findings(results: StudyResults) -> Mapping[str, TerrainBreakAway]:
    """Return the model and pushes of every terrain with a break-away model."""
    study = results.study
    return {
        name: _of_terrain(study.terrains[name], model, study.options.prepare.slowest)
        for name, model in study.break_away.items()
    }


def _of_terrain(
    result: TerrainResult, model: BreakAwayModel, slowest: float
) -> TerrainBreakAway:
    pushes = tuple(
        push
        for trial in result.trials
        if trial.kept
        for push in find_pushes(trial, model.v_slip)
    )
    without_motion = TerrainBreakAway(result.terrain, result.title, model, pushes, None)
    folds = result.models(GP_SE)
    if not folds:
        return without_motion
    prediction = folds[0].model.predict(
        np.array([without_motion.load]), np.array([slowest])
    )
    motion = (float(prediction.mean[0]), float(prediction.sd[0]))
    return TerrainBreakAway(result.terrain, result.title, model, pushes, motion)


def break_away_table(results: StudyResults) -> ReportTable:
    """Return the table of the force available from rest and in motion."""
    terrains = results.of(break_away_findings)
    speeds = sorted({f.model.v_slip for f in terrains.values()})
    return ReportTable(
        name="Force available from rest and in motion",
        header=(
            "terrain",
            "from rest",
            "slipped",
            "held",
            "F_n [N]",
            *(f"F_t at risk {risk:g} [N]" for risk in RISKS),
            *(f"in motion at {risk:g} [N]" for risk in RISKS),
            "distance (critical)",
            "trial effect",
        ),
        rows=[_break_away_row(terrain) for terrain in terrains.values()],
        note="From rest: force by which a push in a new trial has slipped (v_t above "
        f"{', '.join(f'{v:g}' for v in speeds)} m/s) with the stated probability; "
        "brackets: 90 % bootstrap interval over trials. "
        '"sliding": too few pushes slipped, so the force of slow sliding is used. In '
        "motion: quantile of F_t (GP-SE) for the same risk at the slowest velocity of "
        "the window. F_n: median of the pushes. Distance: between model and "
        "Kaplan-Meier curve, with its critical value at the 5 % level. Trial effect: "
        "standard deviation between trials of log force, or of the force for "
        '"sliding".',
        section=ReportSection.BEYOND,
    )


def _break_away_row(terrain: TerrainBreakAway) -> list[str]:
    model, load = terrain.model, terrain.load
    available = [model.available(load, risk) for risk in RISKS]
    motion = [terrain.motion_quantile(risk) for risk in RISKS]
    critical = terrain.critical_distance
    distance = "–" if critical is None else f"{model.distance:.2f} ({critical:.2f})"
    unit = " N" if model.kind == SLIDING else ""
    trial_sd = f"{model.law.trial_sd:.2f}{unit}"
    return [
        terrain.terrain,
        model.kind,
        str(model.slips),
        str(model.held),
        f"{load:.1f}",
        *(f"{a.force:.1f} ({a.low:.1f} to {a.high:.1f})" for a in available),
        *("–" if force is None else f"{force:.1f}" for force in motion),
        distance,
        trial_sd if model.is_trial_seen else "not distinguishable from 0",
    ]


def draw_available(results: StudyResults) -> Figure | None:
    """Draw available force and peaks over F_n, one panel per terrain."""
    shown = list(results.of(break_away_findings).values())
    if not shown:
        return None
    figure, axes = panel_grid(len(shown), 2.1)
    for ax, terrain in zip(axes, shown, strict=True):
        _draw_peaks(ax, terrain)
        for risk, colour, style in zip(RISKS, _CURVES, _STYLES, strict=True):
            curve = terrain.model.curve(terrain.loads, risk)
            ax.plot(
                terrain.loads,
                curve,
                style,
                color=colour,
                lw=1.6,
                label=f"risk {risk:g}",
            )
        _draw_interval(ax, terrain)
        _add_title(ax, terrain)
    axes[0].set_ylim(0.0, 1.15 * max(float(terrain.forces[-1]) for terrain in shown))
    axes[0].set_xlim(left=0.0)
    figure.supxlabel(LOAD_LABEL, fontsize=8)
    figure.supylabel("traction force from rest [N]", fontsize=8)
    _legend(figure, axes)
    return figure


def caption_available(results: StudyResults) -> str:
    """State the forces at the median F_n, from rest and in motion."""
    terrains = results.of(break_away_findings)
    parts = []
    for name, terrain in terrains.items():
        available = terrain.model.available(terrain.load, _SHOWN_RISK)
        motion = terrain.motion_quantile(_SHOWN_RISK)
        parts.append(
            f"{name} {available.force:.1f} N ({available.low:.1f} to "
            f"{available.high:.1f}) at {terrain.load:.1f} N"
            + ("" if motion is None else f", in motion {motion:.1f} N")
        )
    speeds = {terrain.model.v_slip for terrain in terrains.values()}
    limits = ", ".join(f"{speed:g}" for speed in sorted(speeds))
    return (
        f"Peaks of pushes from rest; a slip exceeds {limits} m/s. For a push that "
        "held, break-away lies above its peak. Curves: force by which a push in a new "
        "trial has slipped with the stated probability; band: 90 % bootstrap interval "
        f"over trials of the {_SHOWN_RISK:g} curve. Available force at risk "
        f"{_SHOWN_RISK:g}: {'; '.join(parts)}."
    )


def draw_risk(results: StudyResults) -> Figure | None:
    """Draw model risk and Kaplan-Meier curve over the required force."""
    shown = [
        f for f in results.of(break_away_findings).values() if f.survival is not None
    ]
    if not shown:
        return None
    figure, axes = panel_grid(len(shown), 1.8)
    for ax, terrain in zip(axes, shown, strict=True):
        _draw_survival(ax, terrain)
        ax.plot(
            terrain.forces,
            terrain.mean_risk,
            color=_CURVES[1],
            lw=1.6,
            label="model, mean over F_n",
        )
        _add_title(ax, terrain)
    axes[0].set_ylim(0.0, 1.25)  # space for the text
    axes[0].set_yticks(np.linspace(0.0, 1.0, 6))
    axes[0].set_xlim(left=0.0)
    figure.supxlabel("required traction force [N]", fontsize=8)
    figure.supylabel("slip probability", fontsize=8)
    _legend(figure, axes)
    return figure


def caption_risk(results: StudyResults) -> str:
    """State the distances between models and Kaplan-Meier curves."""
    parts = [
        f"{name} {terrain.model.distance:.2f} ({terrain.critical_distance:.2f})"
        for name, terrain in results.of(break_away_findings).items()
        if terrain.critical_distance is not None
    ]
    return (
        "Steps: share of pushes that had slipped below a force (Kaplan-Meier); pushes "
        "that held are censored at their peak. Line: the model at the normal forces of "
        "the same pushes. Largest difference of the probability integral transforms, "
        "and its critical value at the 5 % level: "
        f"{', '.join(parts) or 'none'}."
    )


def _draw_peaks(ax: Axes, terrain: TerrainBreakAway) -> None:
    is_held = terrain.is_held
    for chosen, mark, colour, label in (
        (~is_held, "o", _SLIP, "slipped"),
        (is_held, "^", _HELD, "held"),
    ):
        ax.plot(
            terrain.F_n[chosen],
            terrain.peaks[chosen],
            mark,
            ms=3.4,
            mfc="none" if mark == "^" else colour,
            mec=colour,
            mew=0.9,
            alpha=0.75,
            label=label,
        )


def _draw_interval(ax: Axes, terrain: TerrainBreakAway) -> None:
    available = [
        terrain.model.available(float(load), _SHOWN_RISK) for load in terrain.loads
    ]
    ax.fill_between(
        terrain.loads,
        [force.low for force in available],
        [force.high for force in available],
        color=_CURVES[1],
        alpha=0.2,
        lw=0,
    )


def _draw_survival(ax: Axes, terrain: TerrainBreakAway) -> None:
    curve = terrain.survival
    if curve is None:
        return
    at = np.concatenate([[0.0], curve.at, [terrain.forces[-1]]])
    below = np.concatenate([[0.0], curve.below, curve.below[-1:]])
    ax.step(at, below, where="post", color=_CURVES[0], lw=1.1, label="Kaplan-Meier")
    held = terrain.peaks[terrain.is_held]
    ax.plot(held, curve.share_below(held), "|", ms=5, color=_HELD, label="held")


def _add_title(ax: Axes, terrain: TerrainBreakAway) -> None:
    ax.set_title(plain(terrain.title), loc="left")
    ax.text(
        0.03,
        0.97,
        f"{terrain.model.kind}\n"
        f"{terrain.model.slips} slipped, {terrain.model.held} held",
        transform=ax.transAxes,
        va="top",
        fontsize=6,
    )


def _legend(figure: Figure, axes: list[Axes]) -> None:
    handles, labels = axes[0].get_legend_handles_labels()
    columns = len(labels) if len(axes) > 1 else 2
    figure.legend(handles, labels, loc="outside upper center", ncols=columns)


BREAK_AWAY_FIGURE = FigureSpec(
    "break_away",
    "From rest: available force over normal force",
    "Peaks of traction force over normal force, of pushes that slipped and pushes "
    "that held, with curves of the available force at three risks, one panel per "
    "terrain.",
    draw_available,
    caption_available,
)

BREAK_AWAY_RISK_FIGURE = FigureSpec(
    "break_away_risk",
    "From rest: slip probability over required force",
    "Probability of a slip over the required traction force: Kaplan-Meier curve "
    "and model, one panel per terrain.",
    draw_risk,
    caption_risk,
)
