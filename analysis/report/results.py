"""Everything a report shows, computed once for tables, figures and files."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from analysis.report.sections.beyond_paper.break_away import (
    BREAK_AWAY_UNITS,
    TerrainBreakAway,
    break_away_findings,
)
from analysis.report.sections.beyond_paper.new_trial_bands import (
    HeldOutShares,
    held_out_shares,
    plain_shares,
)
from analysis.report.sections.beyond_paper.noise import NoiseSummary, noise_summaries
from analysis.report.sections.beyond_paper.residuals import (
    RESIDUAL_MODELS,
    ResidualBand,
    residual_band,
)
from analysis.report.sections.beyond_paper.trends import TREND_UNITS, Trend, trends_of
from analysis.report.sections.paper.claims import PaperClaim, paper_claims
from analysis.report.sections.paper.evidence import gather_evidence
from analysis.report.sections.rig_health.health import HEALTH_UNITS, RigTrial
from analysis.report.surfaces import (
    CoverageMap,
    Surface,
    SurfaceAxes,
    cell_edges,
    coverages,
    plain_coverage,
    plain_surfaces,
    surface_axes,
    surfaces,
)
from analysis.study.fits import CsvRow
from analysis.study.models import GP_SE
from analysis.study.study import Study
from analysis.terrains.identify import Identification, identify_study


@dataclass(frozen=True, slots=True)
class StudyResults:
    """A study and what follows from it.

    Attributes:
        study: the study.
        identification: how well the terrains can be told apart; None for one terrain.
        break_away: what a terrain gives before it slips from rest, where it is known.
        noise: constant against chosen noise, by terrain.
        shares: where samples lie in what is predicted for a new trial, by terrain.
        trends: of the trial means, by terrain and measure.
        residuals: by terrain and model.
        axes: of the surfaces.
        surfaces: of the Gaussian process.
        edges: of the cells of `coverage`.
        coverage: of velocity and load by the samples.
        rig: health of the rig by trial; empty for tables from elsewhere.
        claims: the paper's statements; empty for one terrain.
    """

    study: Study
    identification: Identification | None
    break_away: Mapping[str, TerrainBreakAway]
    noise: Sequence[NoiseSummary]
    shares: Sequence[HeldOutShares]
    trends: Mapping[str, Mapping[str, Trend]]
    residuals: Mapping[str, Mapping[str, ResidualBand]]
    axes: SurfaceAxes
    surfaces: Sequence[Surface]
    edges: SurfaceAxes
    coverage: Sequence[CoverageMap]
    rig: Sequence[RigTrial]
    claims: Sequence[PaperClaim]


def compute_results(study: Study, rig: Sequence[RigTrial] = ()) -> StudyResults:
    """Return what follows from a study; no model is fitted.

    Args:
        study: the study.
        rig: health of the rig by trial.
    """
    from threadpoolctl import threadpool_limits

    with threadpool_limits(1):  # small matrices: more threads lose time
        return _compute(study, rig)


def _compute(study: Study, rig: Sequence[RigTrial]) -> StudyResults:
    results, axes, edges = study.terrains, surface_axes(study), cell_edges(study)
    identification, noise = identify_study(study), noise_summaries(study)
    return StudyResults(
        study=study,
        identification=identification,
        break_away=break_away_findings(study),
        noise=noise,
        shares=held_out_shares(study),
        trends={name: trends_of(result) for name, result in results.items()},
        residuals={
            name: {
                model: band
                for model in RESIDUAL_MODELS
                if (band := residual_band(result, model)) is not None
            }
            for name, result in results.items()
        },
        axes=axes,
        surfaces=surfaces(study, GP_SE, axes),
        edges=edges,
        coverage=coverages(study, edges),
        rig=rig,
        claims=paper_claims(gather_evidence(study, identification, noise)),
    )


def plain_findings(results: StudyResults) -> dict[str, Any]:
    """Return the findings as plain values for fits.json, with units."""
    return {
        "identification": None
        if results.identification is None
        else results.identification.numbers(),
        "break_away": {n: found.numbers() for n, found in results.break_away.items()},
        "noise": {summary.terrain: summary.numbers() for summary in results.noise},
        "new_trial": {
            shares.terrain: plain_shares(shares) for shares in results.shares
        },
        "trends": {
            name: {key: trend.numbers() for key, trend in trends.items()}
            for name, trends in results.trends.items()
        },
        "residuals": {
            name: {model: band.numbers() for model, band in bands.items()}
            for name, bands in results.residuals.items()
        },
        "surfaces": plain_surfaces(results),
        "coverage": plain_coverage(results),
        "rig": [trial.numbers() for trial in results.rig],
        "paper": [claim.plain() for claim in results.claims],
        "units": {
            "nlpd_constant": "nat",
            "nlpd_chosen": "nat",
            "trend means, slope, slope_error, spread": TREND_UNITS,
            "residual quantiles, bias, sd": "N",
            "autocorrelation_samples": "kept samples",
            "F_n": "N",
            "v_t": "m/s",
            "mean": "N",
            "break_away": BREAK_AWAY_UNITS,
            "variance": "N^2",
            "rig": HEALTH_UNITS,
        },
    }


def findings_rows(results: StudyResults) -> list[CsvRow]:
    """Return the findings as lines of fits.csv."""
    rows: list[CsvRow] = []
    for s in results.noise:
        rows += [
            CsvRow(s.terrain, "gp_se", "", "nlpd", s.before, "nat"),
            CsvRow(s.terrain, "gp_se_noise", "", "nlpd", s.after, "nat"),
        ]
    for name, trends in results.trends.items():
        for key, trend in trends.items():
            values = {"slope per trial": trend.slope, "slope error": trend.slope_error}
            values["spread of trial means"] = trend.spread
            rows += [
                CsvRow(name, "", "", f"{key} {what}", value, TREND_UNITS[key])
                for what, value in values.items()
                if value is not None
            ]
    for name, bands in results.residuals.items():
        for model, band in bands.items():
            rows.append(CsvRow(name, model, "", "residual bias", band.bias, "N"))
            rows.append(CsvRow(name, model, "", "residual sd", band.sd, "N"))
    return rows + _recognised(results.identification) + _rig_rows(results.rig)


def _recognised(
    identification: Identification | None,
) -> list[CsvRow]:
    if identification is None:
        return []
    return [
        CsvRow("", "", "", f"recognised by {rule}, {level}, {size} samples", share, "1")
        for rule, sizes in identification.rules.items()
        for size, levels in sizes.items()
        for level in identification.levels
        if level in levels and np.isfinite(share := levels[level].accuracy)
    ]


def _rig_rows(
    rig: Sequence[RigTrial],
) -> list[CsvRow]:
    return [
        CsvRow(
            trial.terrain,
            "",
            "",
            f"{trial.name} {key}",
            float(value),
            HEALTH_UNITS[key],
        )
        for trial in rig
        for key, value in trial.numbers().items()
        if key in HEALTH_UNITS and isinstance(value, int | float)
    ]
