"""Table of the paper's statements and the results of the study."""

from collections.abc import Sequence

from analysis.report.results import StudyResults
from analysis.report.section import ReportSection, ReportTable
from analysis.report.sections.paper.claims import PaperClaim, study_claims


def statements(results: StudyResults) -> list[ReportTable]:
    """Return the table of the paper's statements and the results of the study.

    Empty for one terrain; for terrains that are not the paper's, only a note.
    """
    terrains = results.study.terrains
    others = [name for name, result in terrains.items() if not result.is_paper_terrain]
    note = (
        "Errors: mean absolute errors on held-out trials. Beyond chance: paired "
        "over the trials, p below 0.05 for all comparisons of the row together (Holm)."
    )
    if others:
        note = (
            "Not compared: the paper's statements are about its own eight terrains. "
            f"These are others: {_few_names(others)}."
        )
    if len(terrains) < 2:
        return []
    return [
        ReportTable(
            name="Findings of the paper",
            header=("in", "paper", "this study", "agrees?"),
            rows=[_statement_row(claim) for claim in results.of(study_claims)],
            note=note,
            section=ReportSection.PAPER,
        )
    ]


_SHOWN = 6  # names in a sentence


def _few_names(names: Sequence[str]) -> str:
    more = f" and {len(names) - _SHOWN} more" if names[_SHOWN:] else ""
    return ", ".join(names[:_SHOWN]) + more


def _statement_row(claim: PaperClaim) -> tuple[str, ...]:
    return claim.reference, claim.statement, claim.shown, claim.agreement.value
