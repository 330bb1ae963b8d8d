"""Numbers of all sections as plain values for fits.json and fits.csv."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from analysis.report.results import StudyResults
from analysis.report.sections.beyond_paper.break_away import (
    BREAK_AWAY_UNITS,
    break_away_findings,
)
from analysis.report.sections.beyond_paper.new_trial_bands import (
    held_out_shares,
    plain_shares,
)
from analysis.report.sections.beyond_paper.noise import noise_summaries
from analysis.report.sections.beyond_paper.residuals import residual_bands
from analysis.report.sections.beyond_paper.trends import TREND_UNITS, study_trends
from analysis.report.sections.paper.claims import study_claims
from analysis.report.sections.rig_health.health import HEALTH_UNITS, RigTrial
from analysis.report.surfaces import plain_coverage, plain_surfaces
from analysis.study.fits import CsvRow
from analysis.terrains.identify import Identification


def plain_findings(results: StudyResults) -> dict[str, Any]:
    """Return the findings as plain values for fits.json, with units."""
    return {
        "identification": None
        if results.identification is None
        else results.identification.numbers(),
        "break_away": {
            n: terrain.numbers()
            for n, terrain in results.of(break_away_findings).items()
        },
        "noise": {
            summary.terrain: summary.numbers()
            for summary in results.of(noise_summaries)
        },
        "new_trial": {
            shares.terrain: plain_shares(shares)
            for shares in results.of(held_out_shares)
        },
        "trends": {
            name: {key: trend.numbers() for key, trend in trends.items()}
            for name, trends in results.of(study_trends).items()
        },
        "residuals": {
            name: {model: band.numbers() for model, band in bands.items()}
            for name, bands in results.of(residual_bands).items()
        },
        "surfaces": plain_surfaces(results.surfaces, results.axes),
        "coverage": plain_coverage(results.coverage, results.edges),
        "rig": [trial.numbers() for trial in results.rig],
        "paper": [claim.plain() for claim in results.of(study_claims)],
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
    for s in results.of(noise_summaries):
        rows += [
            CsvRow(s.terrain, "gp_se", "", "nlpd", s.before, "nat"),
            CsvRow(s.terrain, "gp_se_noise", "", "nlpd", s.after, "nat"),
        ]
    for name, trends in results.of(study_trends).items():
        for key, trend in trends.items():
            values = {"slope per trial": trend.slope, "slope error": trend.slope_error}
            values["spread of trial means"] = trend.spread
            rows += [
                CsvRow(name, "", "", f"{key} {what}", value, TREND_UNITS[key])
                for what, value in values.items()
                if value is not None
            ]
    for name, bands in results.of(residual_bands).items():
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
