"""Further columns: their value for predicting F_t."""

from collections.abc import Sequence

from analysis.report.section import ReportSection, ReportTable
from analysis.study.covariates import REPEATED, SPAN, CovariateResult


def covariate_tables(results: Sequence[CovariateResult]) -> list[ReportTable]:
    """Return the table of tested columns; none without any."""
    if not results:
        return []
    rows = [
        [
            result.terrain,
            result.column,
            result.verdict,
            f"{result.gain:+z.3f} ({result.lower:+z.3f} to {result.upper:+z.3f})",
            f"{result.repeated:.0%}",
            str(result.trials),
        ]
        for result in results
    ]
    return [
        ReportTable(
            name="Further columns",
            header=(
                "terrain",
                "column",
                "verdict",
                "gain [nat per sample]",
                "changes explained by F_t",
                "trials",
            ),
            rows=rows,
            note="Gain in log density of held-out trials by a model of a new trial "
            "with the column as an input, over one with F_n and v_t alone, with a 95% "
            "interval over the trials. A gain has its interval above 0 and is at least "
            f"0.05 nat. A column repeats F_t if {REPEATED:.0%} or more of its changes "
            f"over {SPAN:g} s are explained by those of F_t: it is driven by the force "
            "and is not a property of the ground, whatever its gain.",
            section=ReportSection.BEYOND,
        )
    ]
