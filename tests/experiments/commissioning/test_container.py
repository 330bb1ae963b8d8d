"""C13: a container that agrees with its row passes; a wrong entry is named."""

from dataclasses import replace

import numpy as np
import pytest

from experiments.commissioning import container
from experiments.rig.build import terrain_frame
from experiments.settings.load import load_settings

HALF_WIDTH = 0.12  # m


@pytest.fixture(scope="module")
def frame():
    """The frame of an inclined container."""
    rows = load_settings(None).matrix.terrains
    return terrain_frame(next(row for row in rows if row.name == "S10"))


def touched(true, typed, noise=0.0):
    """Recording of C13 where the corners of `true` are touched."""
    along, across, _ = true.axes()
    far = np.array(true.start)
    corners = [
        far + along * distance + across * side
        for distance in (0.0, true.travel)
        for side in (HALF_WIDTH, -HALF_WIDTH)
    ]
    points = np.array(corners) + np.random.default_rng(1).normal(0.0, noise, (4, 3))
    return container.recorded(points, typed)


def test_a_container_as_typed_passes(frame):
    assert container.judge(touched(frame, frame, noise=0.001)).cause == ""


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"incline": np.radians(5.0)}, "Wrong incline"),
        ({"incline": np.radians(-20.0)}, "Wrong incline"),
        ({"heading": np.radians(20.0)}, "Wrong heading"),
        ({"start": np.array([0.0, 0.0, -0.1])}, "Wrong far_end"),
        ({"travel": -0.1}, "travel is longer than the container"),
    ],
)
def test_a_wrong_entry_is_reported(frame, changes, words):
    was = {name: np.add(getattr(frame, name), by) for name, by in changes.items()}
    true = replace(frame, **was)
    assert words in container.judge(touched(true, frame)).cause


def test_headings_are_compared_across_half_a_turn(frame):
    true = replace(frame, heading=np.pi - 0.01)
    typed = replace(frame, heading=-np.pi + 0.01, start=true.start)
    assert container.judge(touched(true, typed)).cause == ""


def test_corners_that_make_no_container_are_reported(frame):
    values = touched(frame, frame)
    values["points"][1] = values["points"][0]
    assert "corners are too close" in container.judge(values).cause


def test_points_off_a_plane_are_reported(frame):
    values = touched(frame, frame)
    values["points"][0, 2] += 0.03
    assert "points off the plane" in container.judge(values).cause
