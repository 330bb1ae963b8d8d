"""The residual of torque against motion shows what acts beside what was sent."""

import numpy as np
import pytest

from studies.torque_residual import (
    GAIN,
    Course,
    MomentumObserver,
    course_of,
    pushed_torques,
)
from studies.wrong_rigs import OTHERS, RIGS
from tests.fakes.scenes import CONSTANTS, TOOL
from wam.model.arm_model import ArmModel

MODEL = ArmModel(CONSTANTS, TOOL)
STILL = np.zeros(7)


def test_an_arm_that_stands_under_its_weight_shows_what_holds_it_beside():
    observer = MomentumObserver.of(MODEL)
    q = CONSTANTS.home
    beside = np.array([0.0, 3.0, 0.0, -1.0, 0.0, 0.0, 0.0])
    for _ in range(10):
        residual = observer.step(q, STILL, MODEL.gravity(q))
    assert residual == pytest.approx(STILL, abs=1e-12)
    for _ in range(round(10 / GAIN / 0.002)):  # ten times what it takes to follow
        residual = observer.step(q, STILL, MODEL.gravity(q) - beside)
    assert residual == pytest.approx(beside, abs=1e-3)


def test_an_arm_that_swings_freely_shows_nothing():
    observer = MomentumObserver.of(MODEL)
    q, qd, dt = CONSTANTS.home.copy(), STILL.copy(), 0.002
    largest = 0.0
    for _ in range(50):
        pull = -MODEL.gravity(q) - MODEL.coriolis(q, qd)
        qd = qd + dt * np.linalg.solve(MODEL.mass_matrix(q), pull)
        q = q + dt * qd
        largest = max(largest, np.abs(observer.step(q, qd, STILL)).max())
    assert np.abs(qd).max() > 0.5
    assert largest < 0.02 * np.abs(MODEL.gravity(CONSTANTS.home)).max()


def test_a_limit_is_looked_at_until_the_guard_asks_for_idle():
    course = Course(np.eye(7)[[1, 1, 2]] * [[0.5], [2.0], [3.0]], 6.0)
    limits = np.array([9.0, 1.0, 9.0, 9.0, 9.0, 9.0, 9.0])
    assert course.first_ms(limits) == pytest.approx(4.0)
    assert course.first_ms(limits + 2.0) == np.inf


@pytest.mark.slow
def test_a_torn_cable_shows_at_once_where_nobody_may_push():
    (torn,) = [rig for rig in RIGS if "torn" in rig.name]
    untouched = np.abs(course_of(OTHERS[0], 1.0).residuals).max(axis=0)
    course = course_of(torn, 0.3)
    assert course.first_ms(untouched + 1.0) < 20.0
    assert course.first_ms(untouched + pushed_torques()) > 300.0
