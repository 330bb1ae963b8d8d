"""docs/friction.md and the two commands that write its parts."""

import re
from pathlib import Path

import numpy as np
import pytest

from studies.friction_calibrations import (
    CalibrationErrors,
    page_part,
    rows_of,
    verdicts,
)
from studies.friction_page import (
    CALIBRATIONS,
    SESSIONS,
    page_text,
    with_calibrations,
)

PAGE = Path(__file__).parents[2] / "docs" / "friction.md"
ROW = "| 1 | none | 10 |"


def errors(**changes):
    """Return errors of 1 % of every joint, changed by the first joint's values."""
    fields = {
        name: np.full(7, 0.01)
        for name in ("coulomb", "asymmetry", "breakaway", "curve")
    }
    for name, value in changes.items():
        fields[name][0] = value
    return CalibrationErrors(**fields)


def missed(found):
    return [verdict.name for verdict in verdicts(found) if not verdict.is_met]


@pytest.mark.parametrize(
    ("name", "bound"), [("coulomb", 0.1), ("asymmetry", 0.2), ("curve", 0.1)]
)
def test_one_bad_calibration_misses_a_bound_of_the_worst(name, bound):
    assert missed([errors(), errors(**{name: bound - 0.001})]) == []
    assert len(missed([errors(), errors(**{name: bound + 0.001})])) == 1


def test_break_away_is_judged_by_its_median():
    one, two = errors(breakaway=-0.3), errors(breakaway=0.3)
    assert missed([errors(), errors(), one]) == []
    assert missed([errors(), two, one]) == ["break-away, median"]


def test_a_bound_that_is_missed_stands_out():
    rows = rows_of(0.4, verdicts([errors(coulomb=0.2)]))
    assert [("missed" in row) for row in rows] == [True, False, False, False]


def test_each_part_survives_the_other():
    calibrations = page_part((1, 2), rows_of(0.4, verdicts([errors()])))
    page = with_calibrations(page_text("", [ROW], "friction.png", 2.94), calibrations)
    assert page == with_calibrations(page, calibrations)
    assert page == page_text(page, [ROW], "friction.png", 2.94)
    assert page.index(SESSIONS) < page.index(ROW) < page.index(CALIBRATIONS)
    newer = page_text(page, ["| 0.4 | none | 8 |"], "friction.png", 2.94)
    assert ROW not in newer
    assert newer.endswith(page[page.index(CALIBRATIONS) :])


def test_the_page_shows_every_session_with_its_picture():
    page = PAGE.read_text()
    sessions = page.partition(CALIBRATIONS)[0]
    rows = re.findall(r"^\| ([\d.]+) \| (none|0\.\d) \|", sessions, re.M)
    assert {share for share, _ in rows} == {"0.02", "0.4", "1"}
    (picture,) = re.findall(r"!\[[^]]+\]\(([^)]+)\)", page)
    assert PAGE.with_name(picture).stat().st_size < 200_000


def test_every_bound_of_the_calibrations_is_met_on_the_page():
    calibrations = PAGE.read_text().partition(CALIBRATIONS)[2]
    verdicts_shown = re.findall(r"\| (met|\*\*missed\*\*) \|$", calibrations, re.M)
    assert verdicts_shown == ["met"] * 12
