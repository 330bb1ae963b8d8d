"""Further columns: what they tell of F_t."""

from collections.abc import Sequence

from analysis.report.section import ReportSection, ReportTable
from analysis.study.covariates import REPEATED, SPAN, CovariateResult


def covariate_tables(results: Sequence[CovariateResult]) -> list[ReportTable]:
    """Return the table of columns that were tested; none where none was."""
    if not results:
        return []
    rows = [
        [
            one.terrain,
            one.column,
            one.verdict,
            f"{one.gain:+z.3f} ({one.lower:+z.3f} to {one.upper:+z.3f})",
            f"{one.repeated:.0%}",
            str(one.trials),
        ]
        for one in results
    ]
    return [
        ReportTable(
            name="Further columns",
            header=(
                "terrain",
                "column",
                "verdict",
                "gain [nat per sample]",
                "changes that are those of F_t",
                "trials",
            ),
            rows=rows,
            note="Gain: log density of trials left out by a model of a new trial that "
            "has the column as an input, over that of one with F_n and v_t alone, with "
            "a 95% interval over the trials. A gain has its interval above 0 and is at "
            f"least 0.05 nat. Of a column that repeats F_t, {REPEATED:.0%} or more of "
            f"the changes over {SPAN:g} s are those of F_t: it is moved by the force "
            "and is no property of the ground, whatever it gains.",
            section=ReportSection.BEYOND,
        )
    ]
