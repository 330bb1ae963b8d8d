"""All trials: force over travel, one row per terrain."""

from collections.abc import Mapping, Sequence

import numpy as np

from analysis.data.prepare import PreparedTrial, Smoothed
from analysis.data.series import Array
from analysis.data.terrain_kinds import kind_title
from analysis.report.results import StudyResults
from analysis.report.section import FigureSpec
from analysis.report.sections.beyond_paper.stick_slip import travel_of
from analysis.report.style import (
    FORCE_LABEL,
    Figure,
    mark_simulated,
    new_figure,
    plain,
    styled,
    terrain_colours,
)

_MOST_TRIALS = 20  # side by side
_MOST_POINTS = 400  # per curve
_GAP = 0.08  # margin on either side of a trial [share of its cell]


def draw_trials(results: StudyResults) -> Figure | None:
    """Draw F_t over the travel of every trial as small multiples, a row per terrain."""
    terrains = results.study.terrains
    trials = {name: result.trials for name, result in terrains.items()}
    titles = {name: result.title for name, result in terrains.items()}
    return _draw_rows(trials, titles, results.study.kinds)


def plot_trials(
    trials: Mapping[str, Sequence[PreparedTrial]],
    kinds: Mapping[str, str],
    *,
    is_simulated: bool,
) -> Figure:
    """Plot F_t over the travel of every trial side by side, as in the report.

    Args:
        trials: trials by terrain, at least one.
        kinds: "small", "big" or "flat" by terrain.
        is_simulated: add the watermark.
    """
    titles = {name: f"{name}: {kind_title(kinds[name])}" for name in trials}
    with styled():
        figure = _draw_rows(trials, titles, kinds)
        if is_simulated:
            mark_simulated(figure)
    return figure


def _draw_rows(
    trials: Mapping[str, Sequence[PreparedTrial]],
    titles: Mapping[str, str],
    kinds: Mapping[str, str],
) -> Figure:
    figure = new_figure(0.95 * len(trials) + 0.7)
    axes = figure.subplots(len(trials), 1, sharex=True, sharey=True, squeeze=False)
    most = min(max(map(len, trials.values())), _MOST_TRIALS)
    colours = terrain_colours(kinds)
    for ax, (terrain, group) in zip(axes[:, 0], trials.items(), strict=True):
        for k, trial in enumerate(group[:most]):
            travel, force = _thinned(trial.smooth)
            reach = max(float(travel.max()), 1e-9)
            ax.plot(
                k + 0.5 + _GAP + (1.0 - 2.0 * _GAP) * np.clip(travel / reach, 0.0, 1.0),
                force,
                lw=0.6,
                color=colours[terrain],
            )
        ax.set_title(plain(titles[terrain]), loc="left", pad=2.0)
        ax.grid(visible=False, axis="x")
    lowest, highest = force_limits([t for group in trials.values() for t in group])
    axes[0, 0].set_ylim(lowest, highest)
    axes[0, 0].set_xlim(0.5, most + 0.5)
    axes[-1, 0].set_xticks(range(1, most + 1))
    axes[-1, 0].set_xlabel("trial; within each, share of its travel from 0 to 1")
    figure.supylabel(FORCE_LABEL, fontsize=8)
    return figure


def caption_trials(results: StudyResults) -> str:
    """State the number of trials."""
    count = sum(len(result.trials) for result in results.study.terrains.values())
    return (
        f"Smoothed traction of {count} trials, each from the far end to the near one; "
        "one scale for all terrains."
    )


def force_limits(trials: Sequence[PreparedTrial]) -> tuple[float, float]:
    """Return axis limits of F_t [N] that include all but a few spikes."""
    ends = [np.quantile(trial.smooth.F_t, (0.001, 0.999)) for trial in trials]
    low, high = min(float(e[0]) for e in ends), max(float(e[1]) for e in ends)
    margin = 0.04 * (high - low) or 1.0
    return low - margin, high + margin


def _thinned(smooth: Smoothed) -> tuple[Array, Array]:
    step = max(1, smooth.t.size // _MOST_POINTS)
    return travel_of(smooth)[::step], smooth.F_t[::step]


TRIALS_FIGURE = FigureSpec(
    "trials",
    "All trials",
    "Small curves of traction force over the travel of each trial, a row per terrain.",
    draw_trials,
    caption_trials,
    is_vector=True,
)
