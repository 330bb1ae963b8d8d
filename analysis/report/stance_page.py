"""The page of stances: what each policy asked, delivered and slipped, by terrain."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from analysis.figures.sections import ReportSection
from analysis.figures.style import (
    MODEL_COLOURS,
    MODEL_HATCHES,
    Axes,
    Figure,
    name_ticks,
    new_figure,
    render,
    styled,
)
from analysis.report.page import html_page
from analysis.report.page_model import (
    PageSection,
    ReportContext,
    ReportFigure,
    ReportTable,
)
from analysis.stance.interface import StanceRequest
from analysis.stance.outcomes import StanceOutcome, StanceTotals, totals

HEADER = (
    "terrain",
    "policy",
    "stances",
    "slipped (95 %)",
    "faster than 0.12 m/s",
    "succeeded",
    "impulse over time [N]",
    "impulse in 1 s",
    "F_n [N]",
    "slid [mm]",
    "scale at the end",
)
_SENTENCES = (
    "A stance has slipped when the sole moved more than 10 mm since it was loaded, or "
    "faster than 0.06 m/s over 20 ms; it has succeeded when 95 % of the impulse came "
    "without that. Intervals are as if stances were independent; those of one bed "
    "share its strength.",
)


@dataclass(frozen=True, slots=True)
class StanceGroup:
    """Stances of one policy on one terrain.

    Attributes:
        terrain: its name.
        policy: its name, with the risk where there is one.
        request: what was asked of every stance.
        outcomes: of the stances.
    """

    terrain: str
    policy: str
    request: StanceRequest
    outcomes: Sequence[StanceOutcome]


def stance_html(context: ReportContext, groups: Sequence[StanceGroup]) -> str:
    """Return the page of stances as HTML."""
    summed = [
        (group, one)
        for group in groups
        if (one := totals(group.outcomes, group.request)) is not None
    ]
    section = PageSection(
        heading=ReportSection.STANCES,
        sentences=_SENTENCES,
        tables=[_table(summed), _stance_table(groups)],
        figures=[_figure(context, summed)] if summed else [],
    )
    return html_page(context, [section], context.warnings)


def _table(summed: Sequence[tuple[StanceGroup, StanceTotals]]) -> ReportTable:
    rows = [
        (
            group.terrain,
            group.policy,
            str(t.count),
            f"{t.slips:.3f} ({t.low:.2f} to {t.high:.2f})",
            f"{t.runaways:.3f}",
            f"{t.successes:.3f}",
            f"{t.traction:.2f}",
            f"{t.early:.2f}",
            f"{t.load:.1f}",
            f"{1e3 * t.slid:.2f}",
            f"{t.scale:.2f}",
        )
        for group, t in summed
    ]
    return ReportTable("Policies", HEADER, rows, section=ReportSection.STANCES)


def _stance_table(groups: Sequence[StanceGroup]) -> ReportTable:
    rows = [
        (
            group.terrain,
            group.policy,
            str(number),
            f"{1e3 * one.spot:.0f}",
            "-" if one.risk != one.risk else f"{one.risk:.3f}",
            f"{one.load:.1f}",
            f"{one.force:.1f}",
            f"{one.delivered:.2f}",
            f"{one.seconds:.2f}",
            f"{1e3 * one.moved:.1f}",
            "slipped" if one.is_slip else "held",
        )
        for group in groups
        for number, one in enumerate(group.outcomes, 1)
    ]
    header = (
        "terrain",
        "policy",
        "stance",
        "spot [mm]",
        "risk foreseen",
        "F_n [N]",
        "F_t [N]",
        "impulse [N s]",
        "time [s]",
        "moved [mm]",
        "outcome",
    )
    return ReportTable("Every stance", header, rows, section=ReportSection.STANCES)


def _figure(
    context: ReportContext, summed: Sequence[tuple[StanceGroup, StanceTotals]]
) -> ReportFigure:
    bars: dict[str, list[tuple[str, StanceTotals]]] = {}
    for group, one in summed:
        bars.setdefault(group.terrain, []).append((group.policy, one))
    asked = sorted(
        {group.request.risk for group, _ in summed if "avoid-slip" in group.policy}
    )
    with styled():
        picture = render("stances", draw_stances(bars, asked), context.is_simulated)
    return ReportFigure(
        section=ReportSection.STANCES,
        title="Policies of a stance",
        alt="Bars of slips, success, traction and slid way by terrain and policy.",
        caption="Share of stances that slipped (dotted: what was asked for), share "
        "that succeeded, mean impulse over time, and mean way after a slip began.",
        picture=picture,
        is_filed=False,
    )


_PANELS = (
    ("slips", "share of stances that slipped"),
    ("successes", "success"),
    ("traction", "impulse over time [N]"),
    ("slid", "slid after the slip began [mm]"),
)
_SCALE = {"slid": 1e3}


def draw_stances(
    groups: Mapping[str, Sequence[tuple[str, StanceTotals]]],
    asked: Sequence[float] = (),
) -> Figure:
    """Return the figure of stances.

    Args:
        groups: by terrain, (policy, what came of it); the same policies everywhere.
        asked: shares of slips that were asked for, drawn as lines.
    """
    figure = new_figure(4.6)
    axes = list(figure.subplots(2, 2).flat)
    for ax, (name, label) in zip(axes, _PANELS, strict=True):
        _bars(ax, groups, name)
        ax.set_ylabel(label)
        name_ticks(ax, list(groups))
    for share in asked:
        axes[0].axhline(share, color="#000000", lw=0.8, ls=":")
    handles, labels = axes[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=4)
    return figure


def _bars(
    ax: Axes, groups: Mapping[str, Sequence[tuple[str, StanceTotals]]], name: str
) -> None:
    policies = list(
        dict.fromkeys(label for group in groups.values() for label, _ in group)
    )
    width = 0.8 / len(policies)
    for k, policy in enumerate(policies):
        rows = [(i, dict(group).get(policy)) for i, group in enumerate(groups.values())]
        known = [(i, one) for i, one in rows if one is not None]
        at = np.array([i - 0.4 + width * (k + 0.5) for i, _ in known])
        height = np.array([getattr(one, name) for _, one in known])
        ax.bar(
            at,
            height * _SCALE.get(name, 1.0),
            width,
            label=policy,
            color=MODEL_COLOURS[k % len(MODEL_COLOURS)],
            hatch=MODEL_HATCHES[k % len(MODEL_HATCHES)],
            edgecolor="white",
            lw=0.3,
        )
        if name == "slips":
            low = np.array([one.low for _, one in known])
            high = np.array([one.high for _, one in known])
            reach = np.maximum([height - low, high - height], 0.0)
            ax.errorbar(at, height, reach, fmt="none", ecolor="#000000", elinewidth=0.6)
