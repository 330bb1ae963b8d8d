"""Trials that no generator has seen, each beside what is sampled along it."""

import numpy as np

from analysis.figures.spec import FigureSpec
from analysis.figures.style import FORCE_LABEL, Figure, panel_grid, plain
from analysis.findings.findings import StudyResults
from analysis.terrains.process_rows import STEP

_SECONDS = 6.0  # of a trial that are shown
_RECORDED, _SAMPLED = "black", "#0072B2"


def draw_sampled(results: StudyResults) -> Figure | None:
    """Return a trial left out, at the top, beside five samples along its motion."""
    if not results.sampled:
        return None
    figure, axes = panel_grid(len(results.sampled), 2.6, most_columns=2)
    top = max(float(np.ptp(s.recorded)) for s in results.sampled.values())
    for ax, (terrain, sampled) in zip(axes, results.sampled.items(), strict=True):
        rows = slice(0, round(_SECONDS / STEP))
        traces = [sampled.recorded, *sampled.paths]
        for k, F_t in enumerate(traces):
            shown = F_t[rows]
            t = STEP * np.arange(shown.size)
            colour = _SAMPLED if k else _RECORDED
            ax.plot(t, shown - k * top, color=colour, lw=0.6)
        ax.set_title(plain(terrain), loc="left")
        ax.set_yticks([0.0, top], ["0", f"{top:.0f}"])
    figure.supxlabel("time [s]", fontsize=8)
    figure.supylabel(FORCE_LABEL, fontsize=8)
    return figure


def caption_sampled(results: StudyResults) -> str:
    """State how like the trials left out the samples are."""
    found = results.sampled.items()
    slips = [
        f"{name} {s.drops[0]:.0f} and {s.drops[1]:.0f}"
        for name, s in found
        if s.drops[1] > 0.0
    ]
    return (
        "A trial that the generator was not fitted to (black, at the top) and five "
        "samples along its motion, one below the other. Drops of force per metre, "
        f"sampled and recorded: {', '.join(slips)}."
    )


FIGURES = (
    FigureSpec(
        "sampled",
        "Sampled traction beside trials left out",
        "Traction force over time of one recorded trial and five sampled ones per "
        "terrain, one below the other.",
        draw_sampled,
        caption_sampled,
    ),
)
