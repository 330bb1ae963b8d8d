import math

import pytest

from acquisition.bounds import are_between, are_within

LIMITS = [1.0, 2.0, 3.0]


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_magnitude_may_equal_but_not_exceed_its_limit(sign):
    assert are_within([sign * limit for limit in LIMITS], LIMITS)
    for joint in range(3):
        values = [0.0] * 3
        values[joint] = sign * math.nextafter(LIMITS[joint], math.inf)
        assert not are_within(values, LIMITS)


def test_a_value_may_be_on_its_bounds_but_not_beyond():
    lower, upper = [-1.0, 0.5, -3.0], [1.0, 2.0, -2.0]
    assert are_between(lower, lower, upper)
    assert are_between(lower, upper, upper)
    for joint in range(3):
        below, above = list(lower), list(upper)
        below[joint] = math.nextafter(lower[joint], -math.inf)
        above[joint] = math.nextafter(upper[joint], math.inf)
        assert not are_between(lower, below, upper)
        assert not are_between(lower, above, upper)


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
@pytest.mark.parametrize("joint", range(3))
def test_nan_is_within_no_bounds(value, joint):
    values = [0.0] * 3
    values[joint] = value
    assert not are_within(values, LIMITS)
    assert not are_between([-1.0] * 3, values, LIMITS)
