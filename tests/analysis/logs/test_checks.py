"""Checks of stated values against the paths and forces of made trials."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from analysis.data.plausibility import SHORTEST, UNEVEN
from analysis.logs.checks import (
    LARGEST_TILT,
    AppliedImport,
    normal_check,
    tare_check,
)
from analysis.logs.estimates import SHORTEST_PATH, STEADY
from ft_sensor.payload import Payload

ROWS = 200  # of a trial


def judged_of(foot, values, spans):
    """An import with these paths [m] and values; everything else is zero."""
    count = len(foot)
    record = SimpleNamespace(
        path=SimpleNamespace(foot=foot), t=np.arange(float(count)) * 0.002
    )
    payload = Payload(0.0, np.zeros(3), np.eye(3), 1.0, np.zeros(6))
    force = np.column_stack([-values[:, 1], np.zeros(count), values[:, 2]])
    raw = np.hstack([force, np.zeros((count, 3))])
    return AppliedImport(record, spans, np.eye(3), payload, raw, force, values)


def strokes(*slopes_deg, length=0.5):
    """Strokes of `length` [m], each on ground of one slope."""
    ahead = np.linspace(0.0, length, ROWS)
    level = np.zeros(ROWS)
    paths = [
        np.column_stack([ahead, level, np.tan(np.radians(slope)) * ahead])
        for slope in slopes_deg
    ]
    values = np.tile([0.06, 6.0, 10.0], (ROWS * len(paths), 1))
    spans = [(k * ROWS, (k + 1) * ROWS) for k in range(len(paths))]
    return judged_of(np.concatenate(paths), values, spans)


@pytest.mark.parametrize("slope", [0.0, 0.8 * LARGEST_TILT])
def test_a_normal_within_its_limit_is_not_reported(slope):
    assert normal_check(strokes(slope, 0.0)).warning == ""


def test_the_trial_whose_ground_has_another_slope_is_named():
    warning = normal_check(strokes(0.0, 5.0)).warning
    assert "T02: --normal is 5.0 degrees off" in warning
    assert "T01" not in warning


@pytest.mark.parametrize("length", [1.01 * SHORTEST, 0.99 * SHORTEST_PATH])
@pytest.mark.parametrize("share", [0.9, 1.1])
def test_a_short_path_may_rise_by_the_height_of_a_stone(length, share):
    slope = np.degrees(np.arcsin(share * UNEVEN / length))
    assert bool(normal_check(strokes(slope, length=length)).warning) is (share > 1.0)


@pytest.mark.parametrize("load", [3.0, 10.0, 500.0])
@pytest.mark.parametrize("share", [0.8, 1.2])
def test_a_tare_may_err_as_much_as_a_tilt_at_the_limit(load, share):
    """Whatever the load: both change F_t/F_n by the same amount."""
    judged = strokes(0.0)
    pressed = np.tile([0.0, 0.0, load], (ROWS, 1))
    limit = max(STEADY, load * np.tan(np.radians(LARGEST_TILT)))
    free = np.tile([share * limit, 0.0, 0.0], (ROWS, 1))
    judged = replace(judged, force=pressed)
    assert judged.largest_free_force == pytest.approx(limit)
    with_free = replace(judged, force=np.vstack([pressed, free]))
    with_free = replace(with_free, values=np.zeros((2 * ROWS, 3)))
    quiet = np.repeat([False, True], ROWS)
    assert bool(tare_check(with_free, quiet).warning) is (share > 1.0)
