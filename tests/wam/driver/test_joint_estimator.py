"""Positions and velocities are estimated though replies are missing or false."""

import numpy as np
import pytest

from wam.driver.joint_estimator import JointEstimator
from wam.driver.settings import ArmSettings
from wam.driver.transmission import Transmission
from wam.model.constants import load_constants

CTS = (4096,) * 7
IPNM = (2700, 2700, 2700, 2700, 6500, 6500, 17474)
MS = 1_000_000
STEP = 20  # counts in a cycle


@pytest.fixture
def estimator():
    transmission = Transmission(load_constants().j2mp, CTS, IPNM)
    estimator = JointEstimator(transmission, ArmSettings())
    estimator.begin(0, [0] * 7)
    return estimator


def move(estimator, cycles, start=0):
    """Let all motors turn steadily; return the last counts."""
    for cycle in range(start + 1, start + cycles + 1):
        assert estimator.update(cycle * 2 * MS, [cycle * STEP] * 7) == 0x7F
    return [(start + cycles) * STEP] * 7


def test_a_new_estimator_is_at_zero():
    transmission = Transmission(load_constants().j2mp, CTS, IPNM)
    estimator = JointEstimator(transmission, ArmSettings())
    assert estimator.counts == [0] * 7
    assert not estimator.q.any()
    assert not estimator.qd.any()
    assert estimator.qd7_raw == 0.0


def test_steady_motion_is_estimated_with_its_velocity(estimator):
    counts = move(estimator, 1000)
    rates = estimator.transmission.joints([STEP / 0.002] * 7)
    assert estimator.q == pytest.approx(estimator.transmission.joints(counts))
    assert estimator.qd == pytest.approx(rates, rel=1e-6)
    assert estimator.qd7_raw == pytest.approx(rates[6])


def test_the_velocity_filter_has_the_configured_pole(estimator):
    """After one cycle the output is the share p T / (1 + p T) of the velocity."""
    move(estimator, 1)
    p = ArmSettings().velocity_pole * 0.002
    rates = estimator.transmission.joints([STEP / 0.002] * 7)
    assert estimator.qd == pytest.approx(p / (1.0 + p) * rates)


def test_two_reads_at_one_instant_do_not_change_the_velocity(estimator):
    counts = move(estimator, 50)
    before, raw = estimator.qd.copy(), estimator.qd7_raw
    assert estimator.update(100 * MS, counts) == 0x7F
    assert estimator.qd == pytest.approx(before)
    assert estimator.qd7_raw == raw
    assert estimator.jump is None
    near = [count + 1 for count in counts]
    estimator.update(100 * MS, near)
    assert estimator.qd == pytest.approx(before)
    assert estimator.qd7_raw == raw


def test_the_raw_velocity_of_joint_7_uses_replies_and_no_extrapolation(estimator):
    """Positions extrapolated meanwhile do not count as motion."""
    move(estimator, 1)
    per_count = estimator.transmission.joints([1] * 7)[6]
    first = estimator.qd7_raw
    assert first == pytest.approx(STEP * per_count / 0.002)
    estimator.update(4 * MS, [None] * 7)
    assert estimator.qd7_raw == first
    estimator.update(6 * MS, [4 * STEP] * 7)
    assert estimator.qd7_raw == pytest.approx(3 * STEP * per_count / 0.004)


def test_a_silent_joint_7_loses_its_raw_velocity(estimator):
    move(estimator, 10)
    for cycle in range(11, 60):
        estimator.update(cycle * 2 * MS, [None] * 7)
    assert estimator.qd7_raw == 0.0


def test_a_rejected_joint_7_has_no_raw_velocity(estimator):
    counts = move(estimator, 10)
    estimator.update(22 * MS, [*counts[:6], counts[6] + 1_000_000])
    assert estimator.jump is not None
    assert estimator.qd7_raw == 0.0


def test_missing_replies_are_extrapolated_for_a_limited_time(estimator):
    counts = move(estimator, 1000)
    none = [None] * 7
    at = estimator.transmission.joints
    for cycles in (1, 2):
        assert estimator.update((1000 + cycles) * 2 * MS, none) == 0
        guess = [count + cycles * STEP for count in counts]
        assert estimator.q == pytest.approx(at(guess), abs=1e-6)
    assert estimator.counts == counts
    estimator.update(1100 * 2 * MS, none)
    last = estimator.q.copy()
    estimator.update(1200 * 2 * MS, none)
    assert estimator.q == pytest.approx(last)  # extrapolation has ended


def test_a_rejected_position_is_reported_and_moves_no_joint(estimator):
    counts = move(estimator, 100)
    false = list(counts)
    false[3] += 3000
    before = estimator.q.copy()
    fresh = estimator.update(101 * 2 * MS, [*false[:3], false[3], *counts[4:]])
    assert fresh == 0x7F & ~(1 << 3)
    assert (estimator.jump.motor, estimator.jump.counts) == (4, 3000)
    speed = np.abs(estimator.transmission.joints([0, 0, 0, 3000, 0, 0, 0])).max()
    assert estimator.jump.speed == pytest.approx(speed / 0.002)
    assert estimator.q == pytest.approx(before, abs=1e-6)


def test_the_faster_of_two_jumps_is_reported(estimator):
    counts = move(estimator, 100)
    false = list(counts)
    false[0], false[6] = counts[0] - 30_000, counts[6] + 3000
    estimator.update(101 * 2 * MS, false)
    at = estimator.transmission.joints
    first = np.abs(at([30_000] + [0] * 6)).max()
    last = np.abs(at([0] * 6 + [3000])).max()
    assert estimator.jump.motor == (1 if first > last else 7)
    estimator.update(102 * 2 * MS, [count + 2 * STEP for count in counts])
    assert estimator.jump is None


@pytest.mark.parametrize(("counts", "is_believed"), [(4, True), (5, False)])
def test_a_few_counts_of_jitter_are_not_a_jump(counts, is_believed):
    """Two replies at one instant allow no travel, whatever the speed limit."""
    transmission = Transmission(load_constants().j2mp, CTS, IPNM)
    estimator = JointEstimator(transmission, ArmSettings())
    estimator.begin(0, [0] * 7)
    estimator.update(0, [counts, 0, 0, 0, 0, 0, 0])

    assert (estimator.jump is None) is is_believed
    assert estimator.counts[0] == (counts if is_believed else 0)
