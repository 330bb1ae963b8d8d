from functools import wraps

import pytest

from analysis.report import drawing
from analysis.report.drawing import (
    FigureTask,
    cached_figures,
    draw_figures,
)
from analysis.report.page_model import ReportFigure, ShownNumbers
from analysis.report.pictures import Picture
from analysis.report.results import compute_results
from analysis.report.section import ReportSection
from analysis.report.sections.order import FIGURES
from analysis.study.store import ResultStore
from analysis.study.tasks import run_tasks

PICTURE = Picture("rig", b"\x89PNG\x00\xff", b"%PDF", 1146, "<svg></svg>")
FIGURE = ReportFigure(ReportSection.HEALTH, "Rig", "bars", "It is well.", PICTURE)


@pytest.fixture
def store(tmp_path):
    return ResultStore(tmp_path)


@pytest.fixture
def drawings(monkeypatch):
    """A list of all drawn figures."""
    drawn = []

    @wraps(drawing.report_figures)  # pictures are stored by its module and name
    def draw(task):
        drawn.append(task)
        return [FIGURE]

    monkeypatch.setattr(drawing, "report_figures", draw)
    return drawn


def test_equal_data_are_drawn_once_and_restored_byte_for_byte(store, drawings):
    shown = (1.0, 2.0)
    assert cached_figures(shown, store) == cached_figures(shown, store) == [FIGURE]
    assert len(drawings) == 1


def test_without_a_store_figures_are_drawn_every_time(drawings):
    assert cached_figures(1.0, None) == cached_figures(1.0, None) == [FIGURE]
    assert len(drawings) == 2


def test_changed_data_are_drawn_again(store, drawings):
    cached_figures((1.0, 2.0), store)
    cached_figures((1.0, 2.5), store)
    assert drawings == [(1.0, 2.0), (1.0, 2.5)]


@pytest.mark.parametrize("kept", [b"", b"{}"], ids=len)
def test_damaged_figures_are_drawn_again(tmp_path, store, drawings, kept):
    cached_figures(1.0, store)
    (path,) = tmp_path.iterdir()
    path.write_bytes(kept)
    assert cached_figures(1.0, store) == [FIGURE]
    assert len(drawings) == 2


def test_an_invalid_stored_figure_is_drawn_again(store, drawings):
    store.put(drawing.report_figures, 1.0, ["figure"])
    assert cached_figures(1.0, store) == [FIGURE]
    assert len(drawings) == 1


@pytest.mark.slow
@pytest.mark.timeout(300)  # two processes alongside others on a busy machine
def test_pictures_are_the_same_from_two_processes(small_study):
    shown, keys = ShownNumbers(compute_results(small_study)), tuple(FIGURES)[::4]
    shares = [FigureTask(shown, keys[k::2]) for k in range(2)]
    here = [draw_figures(share) for share in shares]
    assert all(here)
    assert run_tasks(draw_figures, shares, 2) == here
