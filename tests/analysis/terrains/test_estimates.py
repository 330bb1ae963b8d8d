import math

import numpy as np
import pytest

from acquisition.errors import SettingsError
from analysis.terrains.known import KnownTerrain
from tests.analysis.terrains.tables import normal_table

ROWS = np.array([(1.0, 2.0), (3.0, 4.0)])
TABLE = normal_table((1.0, 5.0), (0.01, 0.2), ROWS, ROWS)
TERRAIN = KnownTerrain("S0", "small", 1, 9, 0.0, {}, {"m": TABLE}, {}, "m")


@pytest.mark.parametrize("point", [(math.nan, 0.1), (2.0, math.inf)])
def test_a_value_that_is_not_finite_is_refused(point):
    with pytest.raises(SettingsError, match="finite"):
        TERRAIN.predict(*point)
    with pytest.raises(SettingsError, match="finite"):
        TERRAIN.risk_in_motion(1.0, *point)
    with pytest.raises(SettingsError, match="finite"):
        TERRAIN.predict(np.array(point[:1]), np.array(point[1:]))


@pytest.mark.parametrize(
    ("point", "is_outside"),
    [((2.0, 0.1), False), ((5.0, 0.2), False), ((6.0, 0.1), True), ((2.0, 0.3), True)],
)
def test_an_estimate_states_whether_it_is_extrapolated(point, is_outside):
    assert TERRAIN.predict(*point).is_extrapolated is is_outside


POINTS = np.array([(2.0, 0.1), (5.0, 0.2), (6.0, 0.1), (0.5, 0.1), (2.0, 0.3)])


def test_estimates_state_which_of_them_are_extrapolated():
    many = TERRAIN.predict(*POINTS.T)
    single = [TERRAIN.predict(*point).is_extrapolated for point in POINTS.tolist()]
    assert many.is_extrapolated.tolist() == single == [False, False, True, True, True]


@pytest.mark.parametrize(
    ("point", "is_outside"),
    [
        ((2.0, 0.1), False),
        ((2.0,), False),  # at rest counts as the slowest velocity
        ((6.0, 0.1), True),
        ((0.5,), True),
        ((2.0, 0.3), True),
    ],
)
def test_a_risk_states_whether_it_is_extrapolated(point, is_outside):
    risk = TERRAIN.risk_in_motion(1.0, *point)
    assert risk.is_extrapolated is is_outside
    assert risk.kind == "in motion"
    assert 0.0 <= risk <= 1.0


def test_without_a_break_away_model_a_push_from_rest_has_no_risk():
    with pytest.raises(SettingsError, match="not known") as refused:
        TERRAIN.slip_risk(1.0, 2.0)
    assert "risk_in_motion" in refused.value.hint
