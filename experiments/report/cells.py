"""The cells of a matrix in a report, with their factors."""

from collections.abc import Mapping

from analysis.data.recorded_factors import FOOT, value_text
from analysis.data.terrain_kinds import kind_title
from analysis.report.section import ReportSection, ReportTable
from analysis.report.traction_ratio import traction_ratio
from analysis.study.study import Study


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
