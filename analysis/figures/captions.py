"""What is seen in the paper's figures, said in sentences with numbers."""

from collections.abc import Sequence

import numpy as np

from analysis.figures.selection import (
    FLAT,
    Panel,
    TimeWindow,
    excerpts,
    panels,
    terrain_class,
)
from analysis.study.models import FITTERS, GP_SE, TITLES, TUSTIN
from analysis.study.study import Study


def say_excerpts(study: Study) -> str:
    """Return what the excerpts of Fig. 4 show."""
    parts = [_say_excerpt(excerpt) for excerpt in excerpts(study)]
    return "Smoothed record at the full rate. " + " ".join(parts)


def _say_excerpt(excerpt: TimeWindow) -> str:
    where = f"{excerpt.terrain}, trial {excerpt.trial}"
    slips = [slip for slip, _, _ in excerpt.slips]
    if not slips:
        low, middle, high = np.quantile(excerpt.F_t, (0.05, 0.5, 0.95))
        return (
            f"{where}: no slip; F_t near {middle:.1f} N, nine tenths of it between "
            f"{low:.1f} and {high:.1f} N."
        )
    peak = np.median([slip.peak for slip in slips])
    floor = np.median([slip.floor for slip in slips])
    bounced = sum(slip.has_bounce for slip in slips)
    return (
        f"{where}: {_count(len(slips), 'slip')}, F_t falling from {peak:.1f} N before "
        f"to {floor:.1f} N during one (medians); the foot is thrown back after "
        f"{bounced}."
    )


def say_tustin(study: Study) -> str:
    """Return how the Tustin curves run."""
    said = [_say_curve(panel) for panel in _one_per_class(panels(study, TUSTIN))]
    fold = "each terrain's first fold, one coherent fit and not the medians of Table I"
    return f"Curves of {fold}. At the median load {'; '.join(said)}."


def _say_curve(panel: Panel) -> str:
    start, end = panel.means[1][[0, -1]]
    return (
        f"F_t goes from {start:.1f} N at {panel.v[0]:.3f} m/s to {end:.1f} N at "
        f"{panel.v[-1]:.3f} m/s on {panel.terrain}"
    )


def say_gp(study: Study) -> str:
    """Return how wide the bands of the processes are."""
    said = [
        f"{2 * float(np.median(panel.sds[1])):.2f} N on {panel.terrain}"
        for panel in _one_per_class(panels(study, GP_SE))
    ]
    return (
        "First fold of each terrain. The band of two standard deviations, noise "
        f"included, reaches {', '.join(said)} to either side of the mean."
    )


def say_errors(study: Study) -> str:
    """Return how large the errors are, and how far models differ."""
    errors = {
        (name, model): mae
        for name, result in study.terrains.items()
        for model in FITTERS
        if (mae := result.mae(model)) is not None
    }
    if not errors:
        return "No model could be fitted; the dashed lines are the constant's errors."
    low, high = min(errors, key=errors.__getitem__), max(errors, key=errors.__getitem__)
    text = (
        f"Smallest error {errors[low]:.2f} N ({TITLES[low[1]]} on {low[0]}), largest "
        f"{errors[high]:.2f} N ({TITLES[high[1]]} on {high[0]}). Whiskers are standard "
        "errors over the trials left out."
    )
    gaps = [
        abs(errors[name, TUSTIN] / errors[name, GP_SE] - 1.0)
        for name in study.terrains
        if {(name, TUSTIN), (name, GP_SE)} <= errors.keys() and errors[name, GP_SE] > 0
    ]
    if gaps:
        text += f" Tustin and GP differ by at most {max(gaps):.0%} on any terrain."
    return text


def say_cross(study: Study) -> str:
    """Return how foreign models compare with a terrain's own."""
    said = [
        f"{TITLES[model]}: {_say_ratios(study, model)}"
        for model in FITTERS
        if study.cross(model)
    ]
    return "Error of a foreign model over that of the terrain's own. " + " ".join(said)


def _say_ratios(study: Study, model: str) -> str:
    cross = study.cross(model)
    groups: dict[str, list[float]] = {}
    for source, errors in cross.items():
        for tested, error in errors.items():
            own = study.terrains[tested].mae(model)
            if source != tested and error is not None and own:
                groups.setdefault(_relation(source, tested), []).append(error / own)
    parts = [
        f"{name} {min(ratios):.1f} to {max(ratios):.1f}"
        for name, ratios in groups.items()
    ]
    return "; ".join(parts) + "." if parts else "no pair to compare."


def _relation(source: str, tested: str) -> str:
    kinds = [terrain_class(name) for name in (source, tested)]
    if any(kind == name for kind, name in zip(kinds, (source, tested), strict=True)):
        return "one terrain's model on another"
    grounds = ["plates" if kind == FLAT else "stones" for kind in kinds]
    other = "other " if grounds[0] == grounds[1] else ""
    return f"models of {grounds[0]} on {other}{grounds[1]}"


def _one_per_class(chosen: Sequence[Panel]) -> list[Panel]:
    first: dict[str, Panel] = {}
    for panel in chosen:
        first.setdefault(terrain_class(panel.terrain), panel)
    return list(first.values())


def _count(number: int, thing: str) -> str:
    return f"{number} {thing}" if number == 1 else f"{number} {thing}s"
