"""Traction by the factors of an experiment."""

from collections.abc import Mapping, Sequence

import numpy as np

from analysis.data.recorded_factors import FOOT, value_text
from analysis.data.terrain_kinds import Value
from analysis.report.results import StudyResults
from analysis.report.section import FigureSpec
from analysis.report.style import (
    MODEL_COLOURS,
    MODEL_MARKERS,
    ONE_COLUMN,
    Axes,
    Figure,
    new_figure,
    plain,
)
from analysis.report.traction_ratio import ratios_of
from analysis.study.study import Study
from analysis.study.terrain_fit import TerrainResult

INCLINE = "incline_deg"
_MOST_WORDS = len(MODEL_MARKERS)  # values of the second factor with distinct markers
_NUDGE = 0.06  # offset between values of the second factor [share of the axis]


def shown_factors(study: Study) -> list[str]:
    """Return the first two factors that vary; none if no experiment states one.

    Stated factors come first, in their order, then incline and foot.
    """
    results = list(study.terrains.values())
    stated = dict.fromkeys(n for r in results for n in r.factors if n != FOOT)
    if not stated:
        return []
    return [
        name
        for name in (*stated, INCLINE, FOOT)
        if len({_value(result, name) for result in results}) > 1
    ][:2]


def draw_factors(results: StudyResults) -> Figure | None:
    """Draw F_t/F_n of every trial over the first factor, marked by the second."""
    names = shown_factors(results.study)
    if not names:
        return None
    terrains = [r for r in results.study.terrains.values() if r.kept]
    seconds = _ordered([_value(r, names[1]) for r in terrains]) if names[1:] else [None]
    firsts = _ordered([_value(r, names[0]) for r in terrains])
    positions = _axis_positions(firsts)
    figure = new_figure(2.6, ONE_COLUMN)
    ax = figure.subplots()
    span = max(positions.values()) - min(positions.values()) or 1.0
    for k, second in enumerate(seconds[:_MOST_WORDS]):
        chosen = [r for r in terrains if not names[1:] or _value(r, names[1]) == second]
        points = [
            (positions[_value(r, names[0])], x) for r in chosen for x in ratios_of(r)
        ]
        if not points:
            continue
        x, y = np.array(points).T
        label = f"{names[1]} {value_text(second)}" if names[1:] else None
        ax.plot(
            x + _NUDGE * span * (k - (len(seconds) - 1) / 2.0) / len(seconds),
            y,
            MODEL_MARKERS[k],
            color=MODEL_COLOURS[k % len(MODEL_COLOURS)],
            ms=3.0,
            alpha=0.7,
            label=None if label is None else plain(label),
        )
    units = {n: unit for r in terrains for n, unit in r.units.items()}
    _label(ax, names[0], {INCLINE: "°"} | units, firsts, positions)
    if names[1:]:
        ax.legend(fontsize=6.5, loc="best")
    return figure


def caption_factors(results: StudyResults) -> str:
    """State the mean ratio of every terrain."""
    names = shown_factors(results.study)
    shown = " and ".join(names)
    ratio_texts = [
        f"{r.terrain} {np.mean(ratios):.2f}"
        for r in results.study.terrains.values()
        if len(ratios := ratios_of(r))
    ]
    listed = ", ".join(ratio_texts[:12]) + (" ..." if ratio_texts[12:] else "")
    return f"Ratio of the means of F_t and F_n of every trial, by {shown}: {listed}."


def _value(result: TerrainResult, name: str) -> Value:
    if name == INCLINE:
        return result.incline_deg
    return result.factors.get(name)


def _ordered(values: Sequence[Value]) -> list[Value]:
    """Sort distinct values: numbers by size, then words, then None."""
    return sorted(set(values), key=lambda v: (v is None, isinstance(v, str), v or 0.0))


def _axis_positions(values: Sequence[Value]) -> dict[Value, float]:
    """Return axis positions: numbers at their value, words at 0, 1, 2, ..."""
    if all(isinstance(value, float) for value in values):
        return {value: float(value) for value in values if isinstance(value, float)}
    return {value: float(k) for k, value in enumerate(values)}


def _label(
    ax: Axes,
    name: str,
    units: Mapping[str, str],
    values: Sequence[Value],
    positions: dict[Value, float],
) -> None:
    ax.set_xticks(list(positions.values()), [plain(value_text(v)) for v in values])
    unit = units.get(name, "")
    ax.set_xlabel(plain(f"{name} [{unit}]" if unit else name))
    ax.set_ylabel("$F_t / F_n$")


FACTORS_FIGURE = FigureSpec(
    "factors",
    "Traction by the factors of the experiment",
    "Points of the ratio of traction to normal force of every trial over the first "
    "factor that varies, with a mark for each value of the second.",
    draw_factors,
    caption_factors,
    is_vector=True,
)
