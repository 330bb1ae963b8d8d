import pytest

from analysis.report.page_model import ReportContext
from analysis.report.results import compute_results
from analysis.report.section import ReportSection
from analysis.report.sections.order import FIGURES, SECTIONS
from analysis.report.sections.paper.surfaces import distinct_labels, round_ticks
from analysis.report.style import styled
from analysis.study.models import FitOptions
from analysis.study.study import StudyOptions, run_study

pytestmark = pytest.mark.slow

MARGIN = 0.02  # inches, half the width of a line on the edge


@pytest.fixture(scope="module")
def findings(small_study, slice_trials):
    """Results of three terrains and of one terrain."""
    options = StudyOptions(fit=FitOptions(gp_points=80), n_jobs=1)
    alone = run_study({"TF": slice_trials["TF"]}, options, simulated=True)
    return {"three": compute_results(small_study), "one": compute_results(alone)}


def is_whole(figure):
    """Return whether all artists lie within the figure."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    drawn = figure.get_tightbbox(canvas.get_renderer())
    width, height = figure.get_size_inches()
    return (
        min(drawn.x0, drawn.y0) >= -MARGIN
        and drawn.x1 <= width + MARGIN
        and drawn.y1 <= height + MARGIN
    )


@pytest.mark.parametrize(("count", "figures"), [("three", 18), ("one", 13)])
def test_no_part_of_a_figure_is_cut_off(findings, count, figures):
    with styled():
        drawn = {key: spec.draw(findings[count]) for key, spec in FIGURES.items()}
        shown = {key: figure for key, figure in drawn.items() if figure is not None}
        assert len(shown) >= figures
        assert [key for key, figure in shown.items() if not is_whole(figure)] == []


@pytest.mark.parametrize(
    ("low", "high", "is_log", "wanted"),
    [
        (0.88, 15.1, False, [2.5, 5.0, 7.5, 10.0, 12.5, 15.0]),
        (12.0, 22.4, True, [12.0, 14.0, 16.0, 18.0, 20.0, 22.0]),
        (0.02, 0.9, True, [0.03, 0.1, 0.3]),
        (0.4, 3.1, True, [0.5, 1.0, 2.0]),
        (-1.0, 1.0, False, [-1.0, -0.5, 0.0, 0.5, 1.0]),
        (1.01, 1.02, True, [1.01, 1.012, 1.014, 1.016, 1.018, 1.02]),
    ],
)
def test_a_scale_has_few_round_numbers(low, high, is_log, wanted):
    assert round_ticks(low, high, is_log=is_log) == wanted


def test_numbers_that_differ_have_distinct_labels():
    assert distinct_labels([0.171, 0.174, 0.21]) == ["0.171", "0.174", "0.21"]
    assert distinct_labels([1.0, 2.0]) == ["1", "2"]
    assert distinct_labels([1.0, 1.0]) == ["1", "1"]


def test_sections_are_ordered_and_figure_keys_are_unique():
    assert [section.heading for section in SECTIONS] == list(ReportSection)
    keys = [figure.key for section in SECTIONS for figure in section.figures]
    assert len(keys) == len(set(keys))
    assert list(FIGURES) == keys


@pytest.mark.parametrize("section", SECTIONS, ids=lambda section: section.heading.name)
def test_tables_of_a_section_name_it(findings, section):
    context = ReportContext("", "", True, False, "")
    tables = section.tables(findings["three"], context)
    assert {table.section for table in tables} <= {section.heading}
