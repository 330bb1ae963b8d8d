"""The cells of a matrix in a report: their factors, forecasts, and which comes next."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from acquisition.errors import TractionError
from analysis.data.recorded_factors import FOOT, value_text
from analysis.data.series import TractionSeries
from analysis.data.terrain_kinds import FINE, Value, kind_title
from analysis.figures.sections import ReportSection
from analysis.findings.trends import traction_ratio
from analysis.gp.ground import Ground
from analysis.report.page_model import ReportTable
from analysis.study.next_cell import ENOUGH, MatrixForecast, forecast_matrix
from analysis.study.relatives import grounds_of
from analysis.study.study import Study
from experiments.settings.matrix import MatrixSettings, TerrainRow

_MOST = 60  # rows of a table


def ground_of(row: TerrainRow, matrix: MatrixSettings) -> Ground:
    """Return the ground of a row of the matrix, as its recordings would state it."""
    logs = {factor.name for factor in matrix.factors if factor.scale == "log"}
    values: dict[str, Value] = {}
    for name, value in row.factors.items():
        if name != "d50":
            values[name] = value
            if name in logs and isinstance(value, float):
                values[name] = math.log(value)  # above 0: checked
    kind = f"{row.d50:g} mm" if row.kind == FINE and row.d50 else row.kind
    factors = (*values.items(), (FOOT, row.foot))
    return Ground(row.name, kind, row.slope_deg, factors)


def cells_table(
    study: Study, units: Mapping[str, str] | None = None
) -> list[ReportTable]:
    """Return the terrains with their factors; none where no factor was stated.

    Args:
        study: the study.
        units: of the factors, by name.
    """
    results = list(study.terrains.values())
    names = dict.fromkeys(n for r in results for n in r.factors if n != FOOT)
    if not names:
        return []
    units = units or {}
    heads = [f"{name} [{units[name]}]" if units.get(name) else name for name in names]
    rows = [
        (
            result.terrain,
            value_text(result.factors.get(FOOT, "?")),
            kind_title(result.kind),
            "?" if result.incline_deg is None else f"{result.incline_deg:+z.1f}",
            *(
                value_text(result.factors[n]) if n in result.factors else "?"
                for n in names
            ),
            str(len(result.trials)),
            traction_ratio(result),
        )
        for result in results
    ]
    header = ("terrain", "foot", "ground", "slope [°]", *heads, "trials", "F_t/F_n")
    return [
        ReportTable(
            "Cells",
            header,
            rows,
            note="Slope: along the push, positive downhill. -: does not apply.",
            section=ReportSection.SUMMARY,
        )
    ]


def forecast_of(
    study: Study,
    series: Mapping[str, Sequence[TractionSeries]],
    matrix: MatrixSettings,
) -> MatrixForecast | None:
    """Return forecasts of the cells of a matrix.

    None where all wanted trials were recorded, fewer than two grounds are known, or
    the model cannot be fitted.
    """
    counts = {name: len(result.trials) for name, result in study.terrains.items()}
    blocks = 1 + matrix.design.repeat_blocks
    if all(counts.get(r.name, 0) >= r.trials * blocks for r in matrix.terrains):
        return None
    grounds = {
        name: ground
        for name, ground in grounds_of(series).items()
        if study.terrains[name].kept
    }
    cells = [ground_of(row, matrix) for row in matrix.terrains]
    trials = {name: result.trials for name, result in study.terrains.items()}
    try:
        return forecast_matrix(trials, grounds, cells)
    except TractionError:
        return None


def forecast_table(forecast: MatrixForecast) -> ReportTable:
    """Return the cells of a matrix with what is expected of each, best gain first."""
    ordered = sorted(forecast.cells, key=lambda cell: -cell.gain)
    rows = [
        (
            cell.terrain,
            str(cell.trials),
            f"{cell.middle:.1f} ({cell.low:.1f} to {cell.high:.1f})",
            f"extrapolated: {', '.join(cell.beyond)}" if cell.beyond else "",
            f"{cell.gain:.4f}",
        )
        for cell in ordered[:_MOST]
    ]
    best = forecast.best
    verdict = (
        f"Enough: no further trial is expected to bring {ENOUGH:g} nat."
        if forecast.is_enough
        else f"Most is expected of one more trial on {best.terrain}."
    )
    omitted = (
        f" Not in the model, which takes six factors: {', '.join(forecast.left_out)}."
        if forecast.left_out
        else ""
    )
    more = f" The first {_MOST} cells of {len(ordered)}." if ordered[_MOST:] else ""
    return ReportTable(
        "The matrix: forecasts, and which cell next",
        ("terrain", "trials", "F_t of a new trial [N]", "", "gain [nat]"),
        rows,
        note=f"{verdict} Median and 90 % band of a measurement at F_n "
        f"{forecast.F_n:.1f} N and v_t {forecast.v_t:.3f} m/s, by the model of all "
        "ground. Gain: of the mean log density of a measurement over all cells, by one "
        "more trial on this one. Extrapolated: beyond the numbers, or with a word, of "
        f"what was recorded.{omitted}{more}",
        section=ReportSection.BEYOND,
    )


def plain_forecast(forecast: MatrixForecast) -> dict[str, object]:
    """Return forecasts as plain values for fits.json."""
    return {
        "F_n": forecast.F_n,
        "v_t": forecast.v_t,
        "is_enough": forecast.is_enough,
        "next": forecast.best.terrain,
        "left_out": list(forecast.left_out),
        "cells": {
            cell.terrain: {
                "trials": cell.trials,
                "quantiles": [cell.low, cell.middle, cell.high],
                "beyond": list(cell.beyond),
                "gain": cell.gain,
            }
            for cell in forecast.cells
        },
    }
