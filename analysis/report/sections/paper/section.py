"""Section with the paper's table and figures, in page order."""

from analysis.report.page_model import ReportContext, Section
from analysis.report.results import StudyResults
from analysis.report.section import ReportSection, ReportTable
from analysis.report.sections.paper.curves import FIG5, FIG6
from analysis.report.sections.paper.errors import FIG9, FIG10_BARS, FIG10_MAP
from analysis.report.sections.paper.excerpts import FIG4
from analysis.report.sections.paper.statements import statements
from analysis.report.sections.paper.surfaces import FIG7, FIG8
from analysis.report.sections.paper.table_one import table_one
from analysis.report.sections.paper.tustin_model import FIG2


def _tables(results: StudyResults, _: ReportContext) -> list[ReportTable]:
    return [*statements(results), table_one(results.study)]


SECTION = Section(
    ReportSection.PAPER,
    _tables,
    (FIG2, FIG4, FIG5, FIG6, FIG7, FIG8, FIG9, FIG10_BARS, FIG10_MAP),
)
