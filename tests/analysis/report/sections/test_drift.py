"""The figure of drift shows sessions in the order of their start."""

from types import SimpleNamespace

import pytest

from analysis.report.sections.rig_health.section import caption_drift, draw_drift


def trial(session, number, tare, load_bias):
    """Return the fields of a trial's health that the figure uses."""
    return SimpleNamespace(
        name=f"{session}/T{number:02d}",
        session=session,
        started_utc=f"2027-01-{int(session[1:]):02d}T08:00:{number:02d}Z",
        tare=tare,
        load_bias=load_bias,
    )


RIG = [
    trial("S003", 1, (0.5, -0.2, 1.0), None),
    trial("S001", 2, (0.0, 0.0, 0.0), 0.4),
    trial("S001", 1, (0.1, 0.0, 0.0), 0.2),
    trial("S002", 1, (0.2, -0.1, 0.5), 0.7),
]


def test_trials_are_ordered_by_start():
    above, below = draw_drift(SimpleNamespace(rig=RIG)).axes
    x, y = above.lines[0].get_data()
    assert list(y) == [0.1, 0.0, 0.2, 0.5]
    assert list(x) == pytest.approx([-0.2, 0.2, 1.0, 2.0])
    assert list(below.lines[0].get_ydata()) == [0.2, 0.4, 0.7]
    names = [label.get_text() for label in below.get_xticklabels()]
    assert names == ["S001", "S002", "S003"]


def test_the_change_from_first_to_last_session_is_reported():
    assert "+0.45, -0.20, +1.00 N" in caption_drift(SimpleNamespace(rig=RIG))
    loads = caption_drift(SimpleNamespace(rig=RIG[1:]))
    assert "the load by +0.40 N" in loads


def test_one_session_does_not_drift():
    assert draw_drift(SimpleNamespace(rig=RIG[1:3])) is None
    assert draw_drift(SimpleNamespace(rig=[])) is None
