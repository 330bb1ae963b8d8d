"""Terrain classification: confusion of windows of motion between terrains."""

from collections.abc import Callable

import numpy as np

from analysis.report.results import StudyResults
from analysis.report.section import FigureSpec, ReportSection, ReportTable
from analysis.report.style import (
    Axes,
    Figure,
    name_ticks,
    new_figure,
    plain,
    shade_table,
)
from analysis.terrains.evidence import REFUSED, Exclusion
from analysis.terrains.identify import KEPT_PER_SECOND, Confusion, Identification

_LEVELS = {  # titles of levels; a factor has its own name
    "terrain": "each terrain",
    "stones": "size of stones",
    "surface": "flat or rocky",
}
_SIDE = 2.25  # inches of one matrix of terrains
_SMALL_SIDE = 1.55  # inches of a matrix of few kinds
_MANY = 5  # kinds from which a matrix is drawn large
_RULES = {
    "log density": "by log density",
    "smallest error": "smallest error (paper)",
    "features": "by features",
}


def recognition_tables(results: StudyResults) -> list[ReportTable]:
    """Return the tables of classification accuracy; none for one terrain."""
    identification = results.identification
    if identification is None:
        return []
    rules = (identification.by_density, identification.by_error)
    rows = [
        (
            f"{size / KEPT_PER_SECOND:g} s",
            *(
                f"{rule[size][level].accuracy:.2f}"
                for rule in rules
                for level in identification.levels
            ),
        )
        for size in identification.sizes
    ]
    names = [_LEVELS.get(level, level) for level in identification.levels]
    return [
        ReportTable(
            "Terrain classification",
            (
                "window",
                *(f"by density: {name}" for name in names),
                *(f"by error: {name}" for name in names),
            ),
            rows,
            note="Share of windows of held-out trials that are recognised, mean over "
            "kinds. By error, the paper's rule: the model with the smallest mean "
            f"absolute error. {_stones_note(identification)}",
            section=ReportSection.BEYOND,
        ),
        surface_table(identification),
    ]


def surface_table(identification: Identification) -> ReportTable:
    """Return the table of flat or rocky accuracy and rejection of unknown ground."""
    rows = [
        (
            f"{size / KEPT_PER_SECOND:g} s",
            *_surface_cells(identification, size),
            *_exclusion_cells(identification.exclusions[size]),
        )
        for size in identification.sizes
    ]
    return ReportTable(
        name="Flat, rocky or unknown ground",
        header=(
            "window",
            "flat or rocky, accuracy",
            "calibration error",
            "98 % confident",
            "confident and wrong",
            "known, called none",
            "flat, only rocky known: none",
            "rocky, only flat known: none",
        ),
        rows=rows,
        note="Flat or rocky: logistic regression on features of the window, fitted to "
        "trials of other numbers; accuracy: mean over the two; calibration error: mean "
        "difference between probability and share. None: the strain of the window "
        "under the likeliest terrain's model is too high, or the window is too smooth, "
        "by limits from trials of other numbers that may reject "
        f"{REFUSED:.0%} of a terrain's own windows.",
        section=ReportSection.BEYOND,
    )


def _surface_cells(identification: Identification, size: int) -> list[str]:
    if size not in identification.by_features:
        return ["–"] * 4
    calibration = identification.calibrations[size]
    return [
        f"{identification.by_features[size]['surface'].accuracy:.3f}",
        f"{calibration.error:.3f}",
        f"{calibration.sure:.2f}",
        f"{calibration.sure_and_wrong:.3f}",
    ]


def _exclusion_cells(exclusion: Exclusion) -> list[str]:
    shares = (
        exclusion.false_alarms,
        exclusion.flat_among_rocky,
        exclusion.rocky_among_flat,
    )
    return ["–" if share is None else f"{share:.3f}" for share in shares]


def _stones_note(identification: Identification) -> str:
    """Explain the similarity of stony terrains; empty with fewer than two."""
    shares = {
        size: share
        for size in identification.sizes
        if (share := identification.exact_stones(size)) is not None
    }
    if not shares:
        return ""
    size = max(shares)
    return (
        "Terrains of stones are similar: the single terrain is correct in "
        f"{shares[size]:.2f} of their windows of {size / KEPT_PER_SECOND:g} s "
        f"({1.0 / identification.stones:.2f} by chance), so only the class flat or "
        "rocky is identifiable, not the single terrain."
    )


def draw_confusion(level: str) -> Callable[[StudyResults], Figure | None]:
    """Return a function that draws the confusion matrices of a level.

    A column per window length; rows from the top: log density, the paper's rule, the
    classifier.
    """

    def draw(results: StudyResults) -> Figure | None:
        identification = results.identification
        if identification is None or not identification.sizes:
            return None
        sizes = identification.sizes
        kinds = identification.by_density[sizes[0]][level].names
        if len(kinds) < 2:
            return None
        side = _SIDE if len(kinds) >= _MANY else _SMALL_SIDE
        rules = rules_of(identification, level)
        figure = new_figure(side * len(rules) + 0.3)
        grid = figure.subplots(len(rules), len(sizes), squeeze=False)
        for row, rule in enumerate(rules):
            for ax, size in zip(grid[row], sizes, strict=True):
                confusion = identification.rules[rule][size][level]
                _draw_matrix(ax, confusion)
                seconds = size / KEPT_PER_SECOND
                ax.set_title(
                    f"{seconds:g} s, {_RULES[rule]}: {confusion.accuracy:.0%}",
                    loc="left",
                    fontsize=7.5,
                )
            grid[row, 0].set_ylabel("true")
        for ax in grid[-1]:
            ax.set_xlabel("classified as")
        return figure

    return draw


def rules_of(identification: Identification, level: str) -> list[str]:
    """Return the rules available at a level for every window size."""
    return [
        rule
        for rule, sizes in identification.rules.items()
        if all(level in sizes.get(size, {}) for size in identification.sizes)
    ]


def caption_confusion(level: str, results: StudyResults) -> str:
    """State the share of windows recognised by each rule."""
    identification = results.identification
    if identification is None:
        return ""
    shares = [
        f"{size / KEPT_PER_SECOND:g} s "
        f"{identification.by_density[size][level].accuracy:.2f} "
        f"({identification.by_error[size][level].accuracy:.2f})"
        for size in identification.sizes
    ]
    third = ""
    if "features" in rules_of(identification, level):
        accuracies = [
            f"{identification.by_features[size][level].accuracy:.3f}"
            for size in identification.sizes
        ]
        third = f" Bottom: by features of the window, {', '.join(accuracies)}."
    return (
        "Shares of the windows of each row in percent, by models fitted without the "
        "trial. Top: the largest log density; below: the paper's rule, the smallest "
        f"mean absolute error. Recognised (by the paper's rule): {', '.join(shares)}."
        + third
    )


def shares_of(confusion: Confusion) -> np.ndarray:
    """Return the counts as shares of their row; NaN for an empty row."""
    totals = confusion.counts.sum(axis=1, keepdims=True).astype(np.float64)
    totals[totals == 0] = np.nan
    return confusion.counts / totals


def _draw_matrix(ax: Axes, confusion: Confusion) -> None:
    shares, names = shares_of(confusion), list(confusion.names)
    shade_table(ax, shares.tolist(), 1.0)
    size = 5.5 if len(names) >= _MANY else 8.0
    for (i, j), share in np.ndenumerate(shares):
        if not np.isnan(share):
            ax.text(
                j + 0.5,
                i + 0.5,
                f"{100 * share:.0f}",
                ha="center",
                va="center",
                fontsize=size,
                color="white" if share > 0.65 else "black",
                fontweight="bold" if i == j else "normal",
            )
    name_ticks(ax, names, 0.5)
    ax.set_yticks(np.arange(len(names)) + 0.5, [plain(name) for name in names])
    ax.tick_params(labelsize=6.5, length=0)


def _spec(level: str, key: str, title: str) -> FigureSpec:
    return FigureSpec(
        key,
        title,
        "Confusion matrices for windows of 0.5, 1 and 2 s: rows are the true kinds, "
        "columns the answers, numbers are percent of the row; above by log density, "
        "below by the smallest error.",
        draw_confusion(level),
        lambda results: caption_confusion(level, results),
    )


CLASSIFICATION_FIGURES = (
    _spec("terrain", "confusion_terrains", "Terrain classification: each terrain"),
    _spec("stones", "confusion_stones", "Terrain classification: size of stones"),
    _spec("surface", "confusion_surface", "Terrain classification: flat or rocky"),
)
