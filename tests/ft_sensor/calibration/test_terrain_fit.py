import dataclasses

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from acquisition.errors import SettingsError
from ft_sensor.calibration.fit import check_terrain, fit_terrain
from ft_sensor.payload import TerrainFrame

LENGTH, HALF_WIDTH = 0.45, 0.15


def frame(incline_deg=10.0, heading_deg=0.0):
    angles = np.radians(incline_deg), np.radians(heading_deg)
    return TerrainFrame(float(angles[0]), float(angles[1]), (0.7, 0.05, 0.19), LENGTH)


def corners(terrain, more=()):
    """Return the corners in the order of the prompts, then `more` (x, y) on top."""
    axes = terrain.axes()
    outline = [(0, 1), (0, -1), (LENGTH, 1), (LENGTH, -1)]
    flat = [(x, y * HALF_WIDTH) for x, y in outline] + list(more)
    return np.array([terrain.start + x * axes[0] + y * axes[1] for x, y in flat])


@given(st.floats(0, 30), st.floats(-170, 170))
def test_a_plate_is_recovered_from_touched_points(incline_deg, heading_deg):
    expected = frame(incline_deg, heading_deg)
    fit = fit_terrain(corners(expected, [(0.2, 0.0), (0.3, 0.05)]))
    assert fit.frame.incline == pytest.approx(expected.incline, abs=1e-9)
    assert fit.frame.heading == pytest.approx(expected.heading, abs=1e-9)
    assert fit.frame.start == pytest.approx(expected.start, abs=1e-9)
    assert fit.frame.travel == pytest.approx(LENGTH, abs=1e-9)
    assert fit.residual < 1e-9
    assert abs(fit.roll) < 1e-9


def test_touch_noise_keeps_incline_and_heading():
    rng = np.random.default_rng(2)
    expected = frame(10.0, 5.0)
    for _ in range(50):
        points = corners(expected, [(0.2, 0.0), (0.3, 0.05)])
        fit = fit_terrain(points + rng.normal(0, 0.0005, points.shape))
        # 0.5 mm at both ends of 0.45 m are 0.06 degrees; three times that may come
        assert np.degrees(fit.frame.incline) == pytest.approx(10.0, abs=0.2)
        assert np.degrees(fit.frame.heading) == pytest.approx(5.0, abs=1.0)


def test_stones_increase_the_residual():
    rng = np.random.default_rng(3)
    points = corners(frame(), [(0.1, 0.0), (0.2, 0.05), (0.3, -0.05)])
    points[:, 2] += rng.normal(0, 0.006, len(points))
    assert 0.001 < fit_terrain(points).residual < 0.01


def test_a_container_that_leans_to_one_side_has_a_roll():
    points = corners(frame(0.0))
    points[[0, 2], 2] += 2 * HALF_WIDTH * np.tan(np.radians(3.0))
    assert np.degrees(abs(fit_terrain(points).roll)) == pytest.approx(3.0, abs=0.1)


def test_the_matrix_row_is_compared_with_the_touched_plane():
    fit = fit_terrain(corners(frame(10.0)))
    check_terrain(fit, frame(10.9), is_forced=False)
    with pytest.raises(SettingsError, match=r"inclined by 10\.0 degrees.*says 15\.0"):
        check_terrain(fit, frame(15.0), is_forced=False)
    check_terrain(fit, frame(15.0), is_forced=True)


@pytest.mark.parametrize("count", [0, 3])
def test_too_few_points_are_refused(count):
    with pytest.raises(SettingsError, match=f"{count} points were touched, 4"):
        fit_terrain(corners(frame())[:count])


def test_the_same_corner_twice_is_refused():
    points = corners(frame())
    points[1] = points[0]
    with pytest.raises(SettingsError, match="too close"):
        fit_terrain(points)


def test_a_wall_is_not_a_terrain():
    steep = dataclasses.replace(frame(), incline=float(np.radians(60)))
    with pytest.raises(SettingsError, match="steeper than 45"):
        fit_terrain(corners(steep))
