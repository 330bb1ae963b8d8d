"""Table I: median Tustin parameters of this study and of the paper."""

from analysis.report.cell_texts import bounded_text
from analysis.report.section import ReportSection, ReportTable
from analysis.study.fits import flag_counts, tustin_medians
from analysis.study.models import TUSTIN
from analysis.study.study import Study
from analysis.tustin.model import (
    MINIMUM_ROWS,
    NEGATIVE_B,
    NO_STRIBECK,
    NOT_IDENTIFIABLE,
    SYMBOLS,
    UNITS,
    TustinParameters,
)

# Table I of the paper, as printed
PAPER = {
    "S0": TustinParameters(mu=0.71, F_s=13.52, v_s=-0.841, delta_s=-0.017, b=-23.4),
    "B0": TustinParameters(mu=4.54, F_s=7.70, v_s=0.128, delta_s=0.011, b=-37.4),
    "TF": TustinParameters(mu=0.843, F_s=0.534, v_s=0.079, delta_s=420.0, b=7.49),
    "Tf": TustinParameters(mu=0.952, F_s=0.643, v_s=0.225, delta_s=2.60, b=0.023),
}


def table_one(study: Study) -> ReportTable:
    """Return Table I: median Tustin parameters of this study and of the paper."""
    rows, bounds = [], study.options.fit.bounds
    for name, result in study.terrains.items():
        medians = tustin_medians(result)
        rows.append(
            [
                name,
                "this study",
                *(
                    "–" if (v := medians[key]) is None else bounded_text(bounds, key, v)
                    for key in UNITS
                ),
                "; ".join(flag_counts(result, TUSTIN)) or "none",
            ]
        )
        if name in PAPER and result.is_paper_terrain:
            printed = [f"{getattr(PAPER[name], key):g}" for key in UNITS]
            rows.append([name, "paper, Table I", *printed, ""])
    units = [f"{SYMBOLS[key]} [{unit}]" for key, unit in UNITS.items()]
    return ReportTable(
        name="Table I: Tustin parameters",
        header=("terrain", "source", *units, "flags"),
        rows=rows,
        note="Medians over the folds, parameter by parameter, so a row is not one "
        "coherent fit (≤, ≥: on a bound of the search); all predictions come from the "
        "coherent fits. " + _flag_legend(),
        section=ReportSection.PAPER,
    )


def _flag_legend() -> str:
    return (
        "Flags: “at lower/upper bound” - the fit ended at a bound, so the "
        f"value is that bound; “{NEGATIVE_B}” - force falls with speed, which is not "
        "a viscosity; "
        f"“{NO_STRIBECK}” - a straight line in F_n and v_t fits as well; "
        f"“{NOT_IDENTIFIABLE}” - the parameters are not identifiable separately. When "
        "flagged, compare curves, not parameters. v_s is given as its absolute value. "
        f"A fit needs {MINIMUM_ROWS} samples."
    )
