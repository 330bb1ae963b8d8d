"""Paired comparison of every model with the first one over the trials."""

from analysis.report.cell_texts import holm_note, paired_cells
from analysis.report.section import ReportSection, ReportTable
from analysis.study.metrics import compare
from analysis.study.models import TITLES
from analysis.study.study import Study


def paired_tables(study: Study) -> list[ReportTable]:
    """Return the comparisons by error and by log density."""
    return [paired_table(study, key, unit) for key, unit in _MEASURES]


def paired_table(study: Study, key: str, unit: str) -> ReportTable:
    """Compare every model with the first one over the trials."""
    first, *others = study.options.fit.models
    names = [n for n, r in study.terrains.items() if others and r.models(first)]
    pairs = [
        compare(study.terrains[n].scores(first, key), study.terrains[n].scores(m, key))
        for n in names
        for m in others
    ]
    cells, width = paired_cells(pairs), len(others)
    rows = [[n, *cells[k * width : (k + 1) * width]] for k, n in enumerate(names)]
    return ReportTable(
        name=f"{key.upper()} difference to {TITLES[first]}, paired by trial",
        header=("terrain", *(f"{TITLES[model]} [{unit}]" for model in others)),
        rows=rows,
        note=f"Difference to {TITLES[first]} ± its standard error over the trials; "
        "below zero is better. p: exact permutation test over the signs "
        f"of the differences. {holm_note(pairs)}",
        section=ReportSection.BEYOND,
    )


_MEASURES = (("mae", "N"), ("nlpd", "nat"))
