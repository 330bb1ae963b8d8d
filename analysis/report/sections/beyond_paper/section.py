"""Section "Beyond the paper": tables and figures in page order."""

from analysis.report.page_model import ReportContext, Section
from analysis.report.results import StudyResults
from analysis.report.section import ReportSection, ReportTable
from analysis.report.sections.beyond_paper.break_away import (
    BREAK_AWAY_FIGURE,
    BREAK_AWAY_RISK_FIGURE,
    break_away_table,
)
from analysis.report.sections.beyond_paper.classification import (
    CLASSIFICATION_FIGURES,
    recognition_tables,
)
from analysis.report.sections.beyond_paper.coverage import COVERAGE_FIGURE
from analysis.report.sections.beyond_paper.delay import lag_table
from analysis.report.sections.beyond_paper.factors import FACTORS_FIGURE
from analysis.report.sections.beyond_paper.new_trial import (
    NEW_TRIAL_FIGURE,
    new_trial_tables,
)
from analysis.report.sections.beyond_paper.new_trial_bands import SHARES_FIGURE
from analysis.report.sections.beyond_paper.noise import NOISE_FIGURE, noise_table
from analysis.report.sections.beyond_paper.paired_comparisons import paired_tables
from analysis.report.sections.beyond_paper.predicted_uncertainty import (
    CALIBRATION_FIGURE,
    uncertainty_table,
)
from analysis.report.sections.beyond_paper.residuals import (
    RESIDUALS_FIGURE,
    independent_samples,
)
from analysis.report.sections.beyond_paper.sample_distribution import velocity_shares
from analysis.report.sections.beyond_paper.stick_slip import STICK_SLIP_FIGURE
from analysis.report.sections.beyond_paper.trends import TRENDS_FIGURE, trend_table
from analysis.report.sections.beyond_paper.trials import TRIALS_FIGURE


def beyond_tables(results: StudyResults) -> list[ReportTable]:
    """Return the non-empty tables of the section."""
    study = results.study
    tables = [
        uncertainty_table(study),
        independent_samples(results),
        *paired_tables(study),
        noise_table(results),
        *new_trial_tables(results),
        lag_table(study),
        break_away_table(results),
        *recognition_tables(results),
        trend_table(results),
        velocity_shares(study),
    ]
    return [table for table in tables if table.rows]


def _tables(results: StudyResults, _: ReportContext) -> list[ReportTable]:
    return beyond_tables(results)


SECTION = Section(
    ReportSection.BEYOND,
    _tables,
    (
        NEW_TRIAL_FIGURE,
        CALIBRATION_FIGURE,
        SHARES_FIGURE,
        NOISE_FIGURE,
        BREAK_AWAY_FIGURE,
        BREAK_AWAY_RISK_FIGURE,
        *CLASSIFICATION_FIGURES,
        FACTORS_FIGURE,
        COVERAGE_FIGURE,
        TRIALS_FIGURE,
        TRENDS_FIGURE,
        RESIDUALS_FIGURE,
        STICK_SLIP_FIGURE,
    ),
)
