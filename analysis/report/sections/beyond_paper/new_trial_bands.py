"""Whether the bands of a model hold on trials it has not seen, and how surely.

Two looks at the trials of a terrain, each left out in turn. The first is the share of
the predicted distribution below every measurement: such shares are even where the
distribution is right. The second is an oracle that believes no distribution: a band
around the median, as wide as the other trials left out need it (conformal prediction
over groups; Lee, Barber and Willett 2023). Rows of one trial repeat each other, so a
trial counts as one in both, and an error is that over trials.
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

BINS = 10  # of the shares
ORACLE = (0.5, 0.8)  # bands that ten trials can show; 95 % would need nineteen
_EDGE = 1e-9


@dataclass(frozen=True, slots=True)
class OracleBand:
    """A band of the model beside one that assumes no distribution.

    Attributes:
        nominal: share that both should hold.
        coverage: share of left-out samples in the oracle's band, mean of trials.
        coverage_error: its standard error over trials.
        width: width of the oracle's band over that of the model's, mean of trials.
    """

    nominal: float
    coverage: float
    coverage_error: float
    width: float


@dataclass(frozen=True, slots=True)
class HeldOutShares:
    """Where samples of left-out trials lie in what was predicted for them.

    Attributes:
        terrain: its terrain.
        density: share of the samples in each of ten even bins times ten, mean of
            trials; 1 everywhere where the prediction is right. Shape (10,).
        error: its standard error over trials, shape (10,).
        trials: number of trials.
        oracle: bands beside those of the oracle.
    """

    terrain: str
    density: Array
    error: Array
    trials: int
    oracle: tuple[OracleBand, ...]


def held_out_shares(results: StudyResults) -> list[HeldOutShares]:
    """Return the shares of every terrain with three folds of `GP_SE_TRIAL` or more."""
    found = map(_of_terrain, results.study.terrains.values())
    return [shares for shares in found if shares is not None]


def plain_shares(shares: HeldOutShares) -> dict[str, Any]:
    """Return the shares of a terrain as plain values for fits.json."""
    return asdict(shares) | {
        "density": shares.density.tolist(),
        "error": shares.error.tolist(),
    }


def _of_terrain(result: TerrainResult) -> HeldOutShares | None:
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
    """Return how the conformal band over trials does on each trial in turn.

    Args:
        shares: share of the prediction below every sample, trial by trial.
        nominal: share that the band should hold.
    """
    from scipy.special import ndtri

    scores = [np.abs(ndtri(np.clip(u, _EDGE, 1.0 - _EDGE))) for u in shares]
    reach = conformal_reaches(scores, nominal)
    held = np.array([np.mean(s <= r) for s, r in zip(scores, reach, strict=True)])
    usual = float(ndtri(0.5 + 0.5 * nominal))
    error = held.std(ddof=1) / np.sqrt(held.size)
    width = float(np.mean(reach)) / usual
    return OracleBand(nominal, float(held.mean()), float(error), width)


def conformal_reaches(scores: Sequence[Array], nominal: float) -> list[float]:
    """Return for each trial the score that its samples stay below, by the others.

    The others share all weight but one part, which stands for the trial and lies at
    infinity: the reach is infinite for a share that so few trials cannot show. With
    G(s) the sum over all trials of the share of their samples up to s, and G_k that of
    trial k, its reach is the smallest s with G(s) - G_k(s) at least `nominal` times
    their number. As G_k is at most 1, it lies among few samples.

    Args:
        scores: of the samples of every trial, larger where they fit less.
        nominal: share of the trial's samples.
    """
    values = np.concatenate(scores)
    weight = np.concatenate([np.full(s.size, 1.0 / s.size) for s in scores])
    order = np.argsort(values)
    values, total = values[order], np.cumsum(weight[order])
    wanted = nominal * len(scores) - 1e-9
    first, end = np.searchsorted(total, [wanted, wanted + 1.0])
    near = values[first : end + 1]
    up_to = total[np.searchsorted(values, near, "right") - 1]
    found: list[float] = []
    for own in map(np.sort, scores):
        others = up_to - np.searchsorted(own, near, "right") / own.size
        is_reached = others >= wanted
        reach = float(near[np.argmax(is_reached)]) if is_reached.any() else np.inf
        found.append(reach)
    return found


def oracle_table(results: StudyResults) -> ReportTable:
    """Return bands of a new trial beside those that assume no distribution."""
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
    """Return where held-out samples lie in what is predicted for a new trial."""
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
    """State how far the shares are from even, in standard errors."""
    values = [
        f"{shares.terrain} {np.abs(shares.density - 1.0).max():.2f}"
        for shares in results.of(held_out_shares)
    ]
    return (
        "Probability integral transform: the share of the distribution predicted for a "
        "new trial that lies below a sample of a trial left out, in ten bins; dashed: "
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
