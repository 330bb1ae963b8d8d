"""A study, and the same repeated under another choice, side by side."""

from typing import Any

from analysis.figures.sections import ReportSection
from analysis.report.further_tables import paired_cell
from analysis.report.page_model import ReportTable
from analysis.report.what_if import StudyVariant
from analysis.study.metrics import PairedComparison, compare
from analysis.study.models import TITLES
from analysis.study.study import Study
from analysis.study.terrain_fit import mean_of

_MEASURES = (("mae", "N"), ("nlpd", "nat"))


def side_by_side(choice: StudyVariant, before: Study, after: Study) -> ReportTable:
    """Return errors of both studies per terrain and model, trial by trial."""
    rows = [
        [
            terrain,
            TITLES[model],
            *(
                cell
                for key, _ in _MEASURES
                for cell in _cells(before, after, (terrain, model, key))
            ),
        ]
        for terrain in before.terrains
        for model in choice.models
        if terrain in after.terrains
    ]
    heads = [
        head
        for key, unit in _MEASURES
        for head in (f"{key.upper()} [{unit}]", choice.text, "difference")
    ]
    return ReportTable(
        name=f"What if {choice.text}?",
        header=("terrain", "model", *heads),
        rows=rows,
        note="The study as it is, then repeated under the choice, with the same "
        "points and the same trials left out. Means over trials; difference ± its "
        "standard error over the trials that both have, below zero is better under "
        "the choice; p by the exact permutation test over signs. Smoothing and "
        "window change what models are fitted to; they are tested on the samples of "
        "the study as it is. Frame, lag, drift and inertia change the data "
        "themselves, and with them what is "
        "tested." + choice.remark,
        section=ReportSection.CHANGED,
    )


def plain_choice(choice: StudyVariant, before: Study, after: Study) -> dict[str, Any]:
    """Return the comparison as plain values for fits.json."""
    return {
        "choice": choice.text,
        "remark": choice.remark.strip(),
        "terrains": {
            terrain: {
                model: {
                    key: _numbers(before, after, (terrain, model, key))
                    for key, _ in _MEASURES
                }
                for model in choice.models
            }
            for terrain in before.terrains
            if terrain in after.terrains
        },
        "units": dict(_MEASURES),
    }


Measure = tuple[str, str, str]  # terrain, model, measure


def _pair(before: Study, after: Study, measure: Measure) -> PairedComparison | None:
    terrain, model, key = measure
    first, second = (s.terrains[terrain].scores(model, key) for s in (before, after))
    return compare(first, second)


def _numbers(before: Study, after: Study, measure: Measure) -> dict[str, Any]:
    terrain, model, key = measure
    paired = _pair(before, after, measure)
    return {
        "before": mean_of(before.terrains[terrain].scores(model, key)),
        "after": mean_of(after.terrains[terrain].scores(model, key)),
        "paired": None if paired is None else paired._asdict(),
    }


def _cells(before: Study, after: Study, measure: Measure) -> list[str]:
    numbers = _numbers(before, after, measure)
    means = [numbers["before"], numbers["after"]]
    texts = ["–" if mean is None else f"{mean:.3f}" for mean in means]
    return [*texts, paired_cell(_pair(before, after, measure))]
