"""The page of a calibration of friction."""

import re
from dataclasses import replace

import numpy as np
import pytest

from analysis.report.friction_page import (
    FrictionPage,
    change_sentences,
    friction_changes,
    friction_html,
    friction_rows,
    friction_tables,
)
from ft_sensor.payload import TerrainFrame
from tests.wam.model.test_friction import example
from wam.calibration.friction_file import FrictionCalibration
from wam.calibration.friction_fit import FrictionFit
from wam.model.arm_model import ArmModel
from wam.model.constants import load_constants

CONSTANTS = load_constants()
BEFORE, NOW = "2027-01-15T08:00:00Z", "2027-06-01T08:00:00Z"
START = np.array([0.0, 0.7696, 0.0, 1.1857, 0.0, 1.1863, 0.0])  # of terrain S0
FRAME = TerrainFrame(0.0, 0.0, (0.7, 0.0, 0.12), 0.45)


def fit(scale=None, doubt=0.01):
    """Return an identified friction; `scale` of each motor's Coulomb torque."""
    shown = example()
    coulomb = shown.coulomb * (np.ones(7) if scale is None else scale)
    return FrictionFit(
        friction=replace(shown, coulomb=coulomb),
        deviation=doubt * coulomb,
        asymmetry_deviation=np.zeros(7),
        residual=np.full(7, 0.02),
        rows=(100,) * 7,
    )


def calibration(when=NOW, *, is_simulated=False, **changes):
    return FrictionCalibration(fit(**changes), "tread", "cad", when, is_simulated)


def worn(joint):
    """Return scales of an arm whose motor of a joint of its own rubs more."""
    scale = np.ones(7)
    scale[joint - 1] = 1.2
    return scale


@pytest.fixture(scope="module")
def model(example_tool):
    return ArmModel(CONSTANTS, example_tool)


def page(model, now, earlier=(), truth=None):
    return FrictionPage(model, now, earlier, "S0", FRAME, START, truth)


def table_of(shown, name):
    return next(table for table in friction_tables(shown) if table.name == name)


def test_every_joint_has_a_cell_in_every_row():
    rows = friction_rows(CONSTANTS, fit())
    assert {len(row) for row in rows} == {8}
    coulomb = [float(cell) for cell in rows[0][1:]]
    assert coulomb[3] == pytest.approx(18.0 * example().coulomb[3], abs=0.001)


def test_a_joint_that_rubs_more_than_before_is_named(model):
    now = calibration(scale=worn(4))
    (text,) = change_sentences(page(model, now, [calibration(BEFORE)]))
    assert text.startswith(f"Friction of joint 4 is 20% higher than on {BEFORE}")


def test_a_joint_that_rubs_less_than_before_is_named(model):
    earlier = [calibration(BEFORE, scale=worn(1))]
    (text,) = change_sentences(page(model, calibration(), earlier))
    assert text.startswith("Friction of joint 1 is 17% lower")


def test_a_change_within_the_intervals_is_none():
    assert friction_changes(CONSTANTS, fit(), fit(worn(4), doubt=0.1)) == {}
    assert list(friction_changes(CONSTANTS, fit(), fit(worn(4)))) == [4]


def test_it_is_the_last_calibration_that_changes_are_stated_against(model):
    years = [calibration(BEFORE, scale=worn(4)), calibration(BEFORE)]
    assert change_sentences(page(model, calibration(), years)) == []


def test_every_earlier_calibration_has_its_line(model):
    years = ["2025-01-01T08:00:00Z", "2026-01-01T08:00:00Z"]
    earlier = [calibration(year) for year in years]
    table = table_of(page(model, calibration(), earlier), "Earlier calibrations")
    assert [row[0] for row in table.rows] == [*years, NOW]


def test_a_first_calibration_is_compared_with_none(model):
    first = page(model, calibration())
    assert "Earlier calibrations" not in {t.name for t in friction_tables(first)}
    assert change_sentences(first) == []


def test_the_loads_grow_lighter_with_the_compensated_share(model):
    table = table_of(page(model, calibration()), "Loads on S0")
    loads = np.array([row[1].split(" to ") for row in table.rows], dtype=float)
    masses = np.array([row[4:] for row in table.rows], dtype=float)
    assert (np.diff(loads, axis=0) < 0.0).all()
    assert (loads[:, 1] > loads[:, 0]).all()  # at the near end
    assert (np.diff(masses, axis=0) < 0.0).all()


@pytest.fixture(scope="module")
def html(model):
    earlier = [calibration(BEFORE, scale=worn(1))]
    now = calibration(is_simulated=True)
    return friction_html(page(model, now, earlier, truth=example()))


@pytest.mark.slow
def test_the_page_needs_no_other_file(html):
    assert "data:image/png;base64," in html
    assert not re.findall(r'(?:src|href)="(?!data:|#)', html)
    assert "figures/" not in html
    assert len(html) < 250_000


@pytest.mark.slow
def test_the_page_says_of_which_arm_it_is(html):
    assert 'class="kind simulated">SIMULATED<' in html


@pytest.mark.slow
def test_what_has_changed_stands_before_the_numbers(html):
    assert html.index("Friction of joint 1") < html.index("break-away")
