"""Calibration of predictive bands on held-out trials.

Two checks with the trials of a terrain, each left out in turn. The first is the
probability integral transform: the share of the predicted distribution below every
measurement, uniform if the distribution is right. The second is a distribution-free
band about the median whose width is calibrated on the other held-out trials (conformal
prediction over groups; Lee, Barber and Willett 2023). Rows of one trial are correlated,
so each trial counts as one unit, and errors are over trials.
"""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from analysis.data.series import Array
from analysis.report.results import StudyResults
from analysis.report.section import FigureSpec, ReportSection, ReportTable
from analysis.report.style import FIRST_COLOUR, Figure, panel_grid, plain
from analysis.study.models import GP_SE_TRIAL
from analysis.study.terrain_fit import TerrainResult

BINS = 10  # bins of the shares
ORACLE = (0.5, 0.8)  # bands possible with ten trials; 95 % would need nineteen
_EDGE = 1e-9


@dataclass(frozen=True, slots=True)
class OracleBand:
    """Comparison of a band of the model with a distribution-free one.

    Attributes:
        nominal: nominal share of both bands.
        coverage: share of held-out samples in the conformal band, mean over trials.
        coverage_error: standard error of the coverage over trials.
        width: width of the conformal band over that of the model, mean over trials.
    """

    nominal: float
    coverage: float
    coverage_error: float
    width: float


@dataclass(frozen=True, slots=True)
class HeldOutShares:
    """Probability integral transform of the samples of held-out trials.

    Attributes:
        terrain: name of the terrain.
        density: density of the transform in ten equal bins, mean over trials; 1
            everywhere if the prediction is right. Shape (10,).
        error: standard error of the density over trials, shape (10,).
        trials: number of trials.
        oracle: comparisons with conformal bands.
    """

    terrain: str
    density: Array
    error: Array
    trials: int
    oracle: tuple[OracleBand, ...]


def held_out_shares(results: StudyResults) -> list[HeldOutShares]:
    """Return the shares of every terrain with three folds of `GP_SE_TRIAL` or more."""
    by_terrain = map(_terrain_shares, results.study.terrains.values())
    return [shares for shares in by_terrain if shares is not None]


def plain_shares(shares: HeldOutShares) -> dict[str, Any]:
    """Convert the shares of a terrain to plain values for fits.json."""
    return asdict(shares) | {
        "density": shares.density.tolist(),
        "error": shares.error.tolist(),
    }


def _terrain_shares(result: TerrainResult) -> HeldOutShares | None:
    shares = [
        fold.model.predict(trial.F_n, trial.v_t, trial.further).cdf(trial.F_t)
        for k, fold in result.left_out(GP_SE_TRIAL)
        for trial in [result.trials[k]]
    ]
    if len(shares) < 3:
        return None
    edges = np.linspace(0.0, 1.0, BINS + 1)
    counts = np.array([np.histogram(u, edges)[0] / u.size * BINS for u in shares])
    return HeldOutShares(
        terrain=result.terrain,
        density=counts.mean(axis=0),
        error=counts.std(axis=0, ddof=1) / np.sqrt(len(shares)),
        trials=len(shares),
        oracle=tuple(oracle_band(shares, nominal) for nominal in ORACLE),
    )


def oracle_band(shares: Sequence[Array], nominal: float) -> OracleBand:
    """Test the conformal band over trials on each trial in turn.

    Args:
        shares: share of the prediction below every sample, trial by trial.
        nominal: nominal share of the band.
    """
    from scipy.special import ndtri

    scores = [np.abs(ndtri(np.clip(u, _EDGE, 1.0 - _EDGE))) for u in shares]
    reach = conformal_reaches(scores, nominal)
    inside = np.array([np.mean(s <= r) for s, r in zip(scores, reach, strict=True)])
    model_reach = float(ndtri(0.5 + 0.5 * nominal))
    error = inside.std(ddof=1) / np.sqrt(inside.size)
    width = float(np.mean(reach)) / model_reach
    return OracleBand(nominal, float(inside.mean()), float(error), width)


def conformal_reaches(scores: Sequence[Array], nominal: float) -> list[float]:
    """Return the conformal score limit of each trial from the other trials.

    Each trial has the same weight, and the tested trial's weight lies at infinity: the
    limit is infinite if there are too few trials for the share. With G(s) the sum over
    all trials of the share of their samples up to s, and G_k that of trial k, its limit
    is the smallest s with G(s) - G_k(s) at least `nominal` times the number of trials.
    Because G_k is at most 1, only few samples have to be searched.

    Args:
        scores: scores of the samples of every trial, larger for a worse fit.
        nominal: nominal share of the trial's samples.
    """
    values = np.concatenate(scores)
    weight = np.concatenate([np.full(s.size, 1.0 / s.size) for s in scores])
    order = np.argsort(values)
    values, total = values[order], np.cumsum(weight[order])
    target = nominal * len(scores) - 1e-9
    first, end = np.searchsorted(total, [target, target + 1.0])
    near = values[first : end + 1]
    up_to = total[np.searchsorted(values, near, "right") - 1]
    reaches: list[float] = []
    for own in map(np.sort, scores):
        others = up_to - np.searchsorted(own, near, "right") / own.size
        is_reached = others >= target
        reach = float(near[np.argmax(is_reached)]) if is_reached.any() else np.inf
        reaches.append(reach)
    return reaches


def oracle_table(results: StudyResults) -> ReportTable:
    """Return the comparison of bands with distribution-free ones."""
    rows = [
        [
            shares.terrain,
            f"{band.nominal:.0%}",
            f"{band.coverage:.1%} ± {band.coverage_error:.1%}",
            f"{band.width:.2f}",
        ]
        for shares in results.of(held_out_shares)
        for band in shares.oracle
    ]
    return ReportTable(
        name="Distribution-free bands (conformal)",
        header=("terrain", "band", "coverage", "width over the model's"),
        rows=rows,
        note="A band around the median, its width calibrated on the other held-out "
        "trials, one score per trial (conformal over trials). Its coverage has to "
        "reach the nominal share; a width near 1 means that the model's own band is "
        "calibrated. A 95% band needs at least nineteen trials.",
        section=ReportSection.BEYOND,
    )


def draw_shares(results: StudyResults) -> Figure | None:
    """Draw the histogram of the probability integral transform."""
    shown = results.of(held_out_shares)
    if not shown:
        return None
    figure, axes = panel_grid(len(shown), 1.4)
    edges = np.linspace(0.0, 1.0, BINS + 1)
    middles = 0.5 * (edges[1:] + edges[:-1])
    for ax, shares in zip(axes, shown, strict=True):
        ax.axhline(1.0, color="black", lw=1.0, ls=(0, (4, 2)))
        ax.stairs(shares.density, edges, fill=True, color="#56B4E9", alpha=0.6)
        ax.errorbar(
            middles,
            shares.density,
            shares.error,
            fmt="none",
            color=FIRST_COLOUR,
            lw=0.9,
        )
        ax.set_ylim(0.0, 2.2)
        ax.set_xlim(0.0, 1.0)
        title = results.study.terrains[shares.terrain].title
        ax.set_title(plain(title), loc="left")
    figure.supxlabel("share of the predicted distribution below the sample", fontsize=8)
    figure.supylabel("density of held-out samples", fontsize=8)
    return figure


def caption_shares(results: StudyResults) -> str:
    """State the largest deviation of the shares from uniform."""
    values = [
        f"{shares.terrain} {np.abs(shares.density - 1.0).max():.2f}"
        for shares in results.of(held_out_shares)
    ]
    return (
        "Probability integral transform: the share of the distribution predicted for a "
        "new trial that lies below a sample of a held-out trial, in ten bins; dashed: "
        "uniform, as for a calibrated distribution. High ends: bands too narrow; "
        "a slope: a bias. Mean over trials, whiskers: standard error over trials. "
        f"Largest deviation from uniform: {'; '.join(values)}."
    )


SHARES_FIGURE = FigureSpec(
    "shares",
    "Calibration: probability integral transform of a new trial",
    "Histogram of the share of the predicted distribution below every held-out "
    "sample with its standard error over trials, one panel per terrain.",
    draw_shares,
    caption_shares,
)
