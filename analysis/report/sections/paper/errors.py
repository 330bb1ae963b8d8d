"""Fig. 9 and 10: errors of every model on its own terrain and on the others."""

import numpy as np

from analysis.data.terrain_kinds import FLAT
from analysis.report.results import StudyResults
from analysis.report.section import FigureSpec
from analysis.report.style import (
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
from analysis.study.models import GP_SE, TITLES, TUSTIN, compared
from analysis.study.study import Study
from analysis.study.terrain_fit import TerrainResult

_MOST_NARROW = 10  # largest number of terrains for a one-column figure
_MOST_BARS = 12  # terrains beyond which grouped bars are unreadable
_MAP_COLUMNS = 2  # heat maps side by side


def draw_errors(results: StudyResults) -> Figure | None:
    """Draw Fig. 9: error per terrain and model, standard error over the folds."""
    terrains = [r for r in results.study.terrains.values() if r.folds]
    if not terrains or not _models_of(results.study):
        return None
    models = _models_of(results.study)
    is_narrow = len(terrains) <= _MOST_NARROW
    figure = new_figure(3.1, ONE_COLUMN if is_narrow else WIDTH)
    ax = figure.subplots()
    width = 0.8 / len(models)
    for k, model in enumerate(models):
        folds = [[e for e in r.maes(model) if e is not None] for r in terrains]
        ax.bar(
            np.arange(len(terrains)) + (k - (len(models) - 1) / 2) * width,
            [float(np.mean(errors)) if errors else 0.0 for errors in folds],
            width * 0.92,
            yerr=[_standard_error(errors) for errors in folds],
            color=MODEL_COLOURS[k % len(MODEL_COLOURS)],
            hatch=MODEL_HATCHES[k % len(MODEL_HATCHES)],
            edgecolor="white",
            error_kw={"elinewidth": 0.7, "capsize": 1.2},
            label=TITLES[model],
        )
    for k, result in enumerate(terrains):
        ax.hlines(
            result.constant_mae or 0.0,
            k - 0.45,
            k + 0.45,
            color="black",
            linewidth=1.2,
            linestyle=(0, (4, 2)),
            label="constant (median $F_t$)" if k == 0 else "",
        )
    name_ticks(ax, [result.terrain for result in terrains])
    ax.set_xlabel("terrain")
    ax.set_ylabel(ERROR_LABEL)
    ax.grid(visible=False, axis="x")
    figure.legend(loc="outside upper center", ncols=2 if is_narrow else 3)
    return figure


def caption_errors(results: StudyResults) -> str:
    """State the range of the errors and the differences between models."""
    study = results.study
    errors = {
        (name, model): mae
        for name, result in study.terrains.items()
        for model in _models_of(study)
        if (mae := result.mae(model)) is not None
    }
    if not errors:
        return "No model could be fitted; dashed lines: errors of the constant."
    low, high = min(errors, key=errors.__getitem__), max(errors, key=errors.__getitem__)
    text = (
        f"Smallest error {errors[low]:.2f} N ({TITLES[low[1]]} on {low[0]}), largest "
        f"{errors[high]:.2f} N ({TITLES[high[1]]} on {high[0]}). Whiskers are standard "
        "errors over the held-out trials."
    )
    gaps = [
        abs(errors[name, TUSTIN] / errors[name, GP_SE] - 1.0)
        for name in study.terrains
        if {(name, TUSTIN), (name, GP_SE)} <= errors.keys() and errors[name, GP_SE] > 0
    ]
    if gaps:
        text += f" Tustin and GP differ by at most {max(gaps):.0%} on any terrain."
    return text


def draw_cross_bars(results: StudyResults) -> Figure | None:
    """Draw Fig. 10 as grouped bars: every model on every terrain."""
    study = results.study
    if not 2 <= len(study.terrains) <= _MOST_BARS or not _has_models(study):
        return None
    models = _models_of(study)
    figure = new_figure(2.1 * len(models) + 0.5)
    axes = figure.subplots(len(models), 1, sharex=True, sharey=True, squeeze=False)
    tested = list(study.terrains)
    colours = terrain_colours(study.kinds)
    for ax, model in zip(axes[:, 0], models, strict=True):
        cross, spread = study.cross(model), study.cross_errors(model)
        width = 0.84 / max(len(cross), 1)
        for k, (terrain, errors) in enumerate(cross.items()):
            ax.bar(
                np.arange(len(tested)) + (k - (len(cross) - 1) / 2) * width,
                [errors[name] or 0.0 for name in tested],
                width,
                yerr=[spread[terrain][name] or 0.0 for name in tested],
                error_kw={"elinewidth": 0.6, "capsize": 1.0},
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


def caption_cross(results: StudyResults) -> str:
    """State the error ratios of other terrains' models to the terrain's own."""
    study = results.study
    values = [
        f"{TITLES[model]}: {_describe_ratios(study, model)}"
        for model in _models_of(study)
        if study.cross(model)
    ]
    return (
        "Whiskers are standard errors over the tested trials. Error of another "
        f"terrain's model over that of the terrain's own. {' '.join(values)}"
    )


def draw_cross_map(results: StudyResults) -> Figure | None:
    """Draw Fig. 10 as heat maps: rows are models, columns terrains tested on."""
    study = results.study
    if len(study.terrains) < 2 or not _has_models(study):
        return None
    tested = list(study.terrains)
    tables = {model: study.cross(model) for model in _models_of(study)}
    side, rows = WIDTH / _MAP_COLUMNS, -(-len(tables) // _MAP_COLUMNS)
    figure = new_figure(rows * (side + 0.2))
    grid = figure.subplots(rows, _MAP_COLUMNS, squeeze=False)
    axes = grid.ravel()[: len(tables)]
    for spare in grid.ravel()[len(tables) :]:
        spare.remove()
    values = [e for c in tables.values() for row in c.values() for e in row.values()]
    top = max(value for value in values if value is not None)
    for ax, (model, cross) in zip(axes, tables.items(), strict=True):
        _draw_map(ax, cross, tested, top)
        ax.set_title(f"{TITLES[model]}: {ERROR_LABEL}", loc="left")
        ax.set_xlabel("terrain tested on")
    for ax in grid[:, 0]:
        ax.set_ylabel("model of terrain")
    return figure


def caption_cross_map(_: StudyResults) -> str:
    """Refer to the bar figure."""
    return "The numbers of the bars above; the terrain's own model in bold."


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


def _models_of(study: Study) -> tuple[str, ...]:
    return compared(study.options.fit.models)


def _has_models(study: Study) -> bool:
    return any(study.cross(model) for model in _models_of(study))


def _standard_error(errors: list[float]) -> float:
    if len(errors) < 2:
        return 0.0
    return float(np.std(errors, ddof=1) / np.sqrt(len(errors)))


def _describe_ratios(study: Study, model: str) -> str:
    cross = study.cross(model)
    groups: dict[str, list[float]] = {}
    for source, errors in cross.items():
        for tested, error in errors.items():
            own = study.terrains[tested].mae(model)
            if source != tested and error is not None and own:
                relation = _relation(study.terrains[source], study.terrains[tested])
                groups.setdefault(relation, []).append(error / own)
    parts = [
        f"{name} {min(ratios):.1f} to {max(ratios):.1f}"
        for name, ratios in groups.items()
    ]
    return "; ".join(parts) + "." if parts else "no pair to compare."


def _relation(source: TerrainResult, tested: TerrainResult) -> str:
    if any(result.kind == result.terrain for result in (source, tested)):
        return "one terrain's model on another"
    model, ground = (
        "plates" if result.kind == FLAT else "stones" for result in (source, tested)
    )
    other = "other " if model == ground else ""
    return f"models of {model} on {other}{ground}"


FIG9 = FigureSpec(
    "fig9_errors",
    "Fig. 9 Prediction error of each model on its own terrain",
    "Bars of mean absolute error for every terrain and model, with the error of a "
    "constant as a dashed line.",
    draw_errors,
    caption_errors,
)

FIG10_BARS = FigureSpec(
    "fig10_cross_bars",
    "Fig. 10 Cross-terrain errors",
    "Grouped bars of mean absolute error: groups are the terrains tested on, bars "
    "the terrains of the models.",
    draw_cross_bars,
    caption_cross,
)

FIG10_MAP = FigureSpec(
    "fig10_cross_map",
    "Fig. 10 as a heat map",
    "Heat maps of mean absolute error: rows are the terrains of the models, "
    "columns the terrains tested on.",
    draw_cross_map,
    caption_cross_map,
)
