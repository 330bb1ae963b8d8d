from dataclasses import replace

import numpy as np
import pytest

from analysis.figures.pictures import Picture
from analysis.figures.sections import ReportSection
from analysis.findings.findings import compute_results
from analysis.report import drawing
from analysis.report.drawing import (
    DRAWN_TYPES,
    FigureTasks,
    code_digest,
    draw_figure,
    drawn_once,
    shown_digest,
)
from analysis.report.page_model import ReportFigure, ShownNumbers
from analysis.study.jobs import run_tasks
from analysis.study.store import TYPES, ResultStore

PICTURE = Picture("rig", b"\x89PNG\x00\xff", b"%PDF", 1146, "<svg></svg>")
FIGURE = ReportFigure(ReportSection.HEALTH, "Rig", "bars", "It is well.", PICTURE)


@pytest.fixture
def store(tmp_path):
    return ResultStore(tmp_path, types={**TYPES, **DRAWN_TYPES})


class Pen:
    """Draws, and counts how many times."""

    drawings = 0

    def __call__(self):
        self.drawings += 1
        return [FIGURE]


def drawn(pen, store, shown=(1.0, 2.0), *, is_simulated=True, with_pdf=False):
    return drawn_once(shown, pen, store, is_simulated=is_simulated, with_pdf=with_pdf)


def test_the_same_numbers_are_drawn_once_and_come_back_byte_by_byte(store):
    pen = Pen()
    assert drawn(pen, store) == drawn(pen, store) == [FIGURE]
    assert pen.drawings == 1


def test_without_a_store_figures_are_drawn_every_time():
    pen = Pen()
    assert drawn(pen, None) == drawn(pen, None) == [FIGURE]
    assert pen.drawings == 2


@pytest.mark.parametrize(
    "change", [{"shown": (1.0, 2.5)}, {"is_simulated": False}, {"with_pdf": True}]
)
def test_other_numbers_or_wishes_are_drawn_anew(store, change):
    pen = Pen()
    drawn(pen, store)
    drawn(pen, store, **change)
    assert pen.drawings == 2


DIFFERENT = (
    None,
    0,
    0.0,
    -0.0,
    False,
    "0",
    b"0",
    (),
    [],
    (0.0, 1.0),
    ((0.0,), 1.0),
    {},
    {"a": 1},
    {"b": 1},
    np.zeros(0),
    np.zeros(2),
    np.zeros((1, 2)),
    np.zeros(2, dtype=np.int64),
    np.array([0.0, 5e-324]),
    PICTURE,
    replace(PICTURE, png=b""),
    ReportSection.HEALTH,
    ReportSection.REACH,
)


def test_different_values_have_different_digests():
    assert len({shown_digest(value) for value in DIFFERENT}) == len(DIFFERENT)
    assert shown_digest(np.arange(6.0)[::2]) == shown_digest(np.array([0.0, 2.0, 4.0]))


def test_what_has_no_known_content_has_no_digest():
    with pytest.raises(TypeError, match="object has no digest"):
        shown_digest([object()])


def test_changed_code_draws_anew(store, monkeypatch):
    pen = Pen()
    drawn(pen, store)
    monkeypatch.setattr(drawing, "code_digest", lambda: "other")
    drawn(pen, store)
    assert pen.drawings == 2


def test_any_byte_of_the_analysis_is_in_its_digest(tmp_path, monkeypatch):
    (tmp_path / "report").mkdir()
    (tmp_path / "report" / "drawing.py").write_text("")
    (tmp_path / "model.py").write_text("a = 1")
    monkeypatch.setattr(drawing, "__file__", str(tmp_path / "report" / "drawing.py"))
    digests = set()
    for text in ("a = 1", "a = 2", "a = 1\n"):
        (tmp_path / "model.py").write_text(text)
        code_digest.cache_clear()
        digests.add(code_digest())
    code_digest.cache_clear()
    assert len(digests) == 3


@pytest.mark.parametrize("kept", [b"", b"{}"], ids=len)
def test_damaged_figures_are_drawn_anew(tmp_path, store, kept):
    pen = Pen()
    drawn(pen, store)
    (path,) = tmp_path.iterdir()
    path.write_bytes(kept)
    assert drawn(pen, store) == [FIGURE]
    assert pen.drawings == 2


def test_what_is_no_figure_is_drawn_anew(store):
    pen = Pen()
    task = drawing.DrawingTask(
        shown_digest((1.0, 2.0)), code_digest(), is_simulated=True, with_pdf=False
    )
    store.put(task, ["figure"])
    assert drawn(pen, store) == [FIGURE]
    assert pen.drawings == 1


@pytest.mark.parametrize("value", [np.float64(1.5), np.int64(3), np.bool_(True)])
def test_a_number_shows_the_same_when_the_store_gives_it_back(value):
    assert shown_digest([value]) == shown_digest([value.item()])
    assert shown_digest([value]) != shown_digest([value.item() + 1])


@pytest.mark.slow
def test_pictures_are_the_same_from_two_processes(small_study):
    shown = ShownNumbers(compute_results(small_study))
    tasks = FigureTasks(shown)
    here = [draw_figure(task) for task in tasks]
    assert any(here)
    assert run_tasks(draw_figure, tasks, 2) == here
