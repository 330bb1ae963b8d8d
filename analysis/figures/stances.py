"""Stances of a foot: how often it slipped, how often it succeeded, and how far it slid.

One group of bars per terrain, one bar per policy.
"""

from collections.abc import Mapping, Sequence

import numpy as np

from analysis.figures.style import (
    MODEL_COLOURS,
    MODEL_HATCHES,
    Axes,
    Figure,
    name_ticks,
    new_figure,
)
from analysis.stance import StanceTotals

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
    policies = list(dict.fromkeys(label for of in groups.values() for label, _ in of))
    width = 0.8 / len(policies)
    for k, policy in enumerate(policies):
        rows = [(i, dict(of).get(policy)) for i, of in enumerate(groups.values())]
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
