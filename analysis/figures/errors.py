"""Figures 9 and 10: errors of every model, on its own and on other terrains."""

import numpy as np

from analysis.figures.style import (
    ERROR_LABEL,
    MODEL_COLOURS,
    MODEL_HATCHES,
    ONE_COLUMN,
    WIDTH,
    Axes,
    Figure,
    name_ticks,
    new_figure,
    plain,
    shade_table,
    terrain_colours,
)
from analysis.study.models import FITTERS, TITLES
from analysis.study.study import Study

_MOST_NARROW = 10  # terrains whose bars one column of a paper holds
_MOST_BARS = 12  # terrains beyond which grouped bars cannot be told apart
_MAP_COLUMNS = 2  # heat maps side by side


def draw_errors(study: Study) -> Figure | None:
    """Return Fig. 9: error per terrain and model, standard error over the folds."""
    results = [r for r in study.terrains.values() if r.folds]
    if not results:
        return None
    is_narrow = len(results) <= _MOST_NARROW
    figure = new_figure(3.1, ONE_COLUMN if is_narrow else WIDTH)
    ax = figure.subplots()
    width = 0.8 / len(FITTERS)
    for k, model in enumerate(FITTERS):
        folds = [[e for e in r.maes(model) if e is not None] for r in results]
        ax.bar(
            np.arange(len(results)) + (k - (len(FITTERS) - 1) / 2) * width,
            [float(np.mean(errors)) if errors else 0.0 for errors in folds],
            width * 0.92,
            yerr=[_standard_error(errors) for errors in folds],
            color=MODEL_COLOURS[k % len(MODEL_COLOURS)],
            hatch=MODEL_HATCHES[k % len(MODEL_HATCHES)],
            edgecolor="white",
            error_kw={"elinewidth": 0.7, "capsize": 1.2},
            label=TITLES[model],
        )
    for k, result in enumerate(results):
        ax.hlines(
            result.constant_mae or 0.0,
            k - 0.45,
            k + 0.45,
            color="black",
            linewidth=1.2,
            linestyle=(0, (4, 2)),
            label="constant (median $F_t$)" if k == 0 else "",
        )
    name_ticks(ax, [result.terrain for result in results])
    ax.set_xlabel("terrain")
    ax.set_ylabel(ERROR_LABEL)
    ax.grid(visible=False, axis="x")
    figure.legend(loc="outside upper center", ncols=2 if is_narrow else 3)
    return figure


def draw_cross_bars(study: Study) -> Figure | None:
    """Return Fig. 10 as grouped bars: every model on every terrain."""
    if not 2 <= len(study.terrains) <= _MOST_BARS or not _has_models(study):
        return None
    figure = new_figure(2.1 * len(FITTERS) + 0.5)
    axes = figure.subplots(len(FITTERS), 1, sharex=True, sharey=True, squeeze=False)
    tested = list(study.terrains)
    colours = terrain_colours(tested)
    for ax, model in zip(axes[:, 0], FITTERS, strict=True):
        cross = study.cross(model)
        width = 0.84 / max(len(cross), 1)
        for k, (terrain, errors) in enumerate(cross.items()):
            ax.bar(
                np.arange(len(tested)) + (k - (len(cross) - 1) / 2) * width,
                [errors[name] or 0.0 for name in tested],
                width,
                color=colours[terrain],
                edgecolor="white",
                linewidth=0.4,
                label=plain(terrain),
            )
        ax.set_title(f"{TITLES[model]} models", loc="left")
        ax.grid(visible=False, axis="x")
        name_ticks(ax, tested)
    axes[-1, 0].set_xlabel("terrain tested on")
    figure.supylabel(ERROR_LABEL, fontsize=8)
    handles, labels = max(
        (ax.get_legend_handles_labels() for ax in axes[:, 0]),
        key=lambda pair: len(pair[1]),
    )
    figure.legend(
        handles,
        labels,
        title="model of",
        loc="outside right center",
        title_fontsize=7.5,
    )
    return figure


def draw_cross_map(study: Study) -> Figure | None:
    """Return Fig. 10 as heat maps: rows are models, columns terrains tested on."""
    if len(study.terrains) < 2 or not _has_models(study):
        return None
    tested = list(study.terrains)
    side, rows = WIDTH / _MAP_COLUMNS, -(-len(FITTERS) // _MAP_COLUMNS)
    figure = new_figure(rows * (side + 0.2))
    grid = figure.subplots(rows, _MAP_COLUMNS, squeeze=False)
    axes = grid.ravel()[: len(FITTERS)]
    for spare in grid.ravel()[len(FITTERS) :]:
        spare.remove()
    tables = {model: study.cross(model) for model in FITTERS}
    values = [e for c in tables.values() for row in c.values() for e in row.values()]
    top = max(value for value in values if value is not None)
    for ax, (model, cross) in zip(axes, tables.items(), strict=True):
        _draw_map(ax, cross, tested, top)
        ax.set_title(f"{TITLES[model]}: {ERROR_LABEL}", loc="left")
        ax.set_xlabel("terrain tested on")
    for ax in grid[:, 0]:
        ax.set_ylabel("model of terrain")
    return figure


def _draw_map(
    ax: Axes,
    cross: dict[str, dict[str, float | None]],
    tested: list[str],
    top: float,
) -> None:
    table = np.array(
        [
            [np.nan if (e := errors[name]) is None else e for name in tested]
            for errors in cross.values()
        ]
    )
    shade_table(ax, table.tolist(), top)
    for (i, j), value in np.ndenumerate(table):
        ax.text(
            j + 0.5,
            i + 0.5,
            "-" if np.isnan(value) else f"{value:.2f}",
            ha="center",
            va="center",
            fontsize=max(4.0, min(7.0, 60.0 / len(tested))),
            color="white" if value > 0.65 * top else "black",
            fontweight="bold" if list(cross)[i] == tested[j] else "normal",
        )
    name_ticks(ax, tested, 0.5)
    ax.set_yticks(np.arange(len(cross)) + 0.5, [plain(name) for name in cross])


def _has_models(study: Study) -> bool:
    return any(study.cross(model) for model in FITTERS)


def _standard_error(errors: list[float]) -> float:
    if len(errors) < 2:
        return 0.0
    return float(np.std(errors, ddof=1) / np.sqrt(len(errors)))
