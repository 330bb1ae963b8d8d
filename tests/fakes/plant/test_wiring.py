"""Wrong cables and encoders of the simulated arm have their stated effects."""

import numpy as np
import pytest

from fakes.plant.plant import ArmPlant
from fakes.plant.wiring import Wiring
from tests.fakes.scenes import CONSTANTS, FRAME, START_Q, TOOL

UNITS = [100, -200, 300, 400, 50, 60, 70]


def swapped(a, b):
    matrix = np.eye(7)
    matrix[[a, b]] = matrix[[b, a]]
    return matrix


def test_wiring_as_built_changes_nothing():
    wiring = Wiring()
    assert wiring.applied_torques(UNITS) == UNITS
    counts = np.arange(7.0)
    assert wiring.reported_counts(counts) == pytest.approx(counts)


def test_reversed_and_swapped_wiring_permute_the_motors():
    reversed_2 = np.diag([1.0, -1.0, 1.0, 1.0, 1.0, 1.0, 1.0])
    assert Wiring(reversed_2).applied_torques(UNITS)[1] == 200
    made = Wiring(swapped(4, 5)).applied_torques(UNITS)
    assert made[4:6] == [60, 50]


def test_swapped_encoders_report_the_other_motor_relative_to_home():
    home = np.full(7, 1000.0)
    wiring = Wiring(counts=swapped(4, 5), home=home)
    reported = wiring.reported_counts(home + np.array([0, 0, 0, 0, 10, 20, 0]))
    assert reported[4:6].tolist() == [1020.0, 1010.0]


def test_a_torn_cable_stops_the_rotor_and_removes_joint_torque():
    wiring = Wiring(torn=2, torn_at=777.0)
    assert wiring.applied_torques(UNITS)[1] == 0
    assert wiring.reported_counts(np.zeros(7))[1] == 777.0


def test_the_arm_moves_by_the_torque_of_its_motors():
    def turned(wiring):
        plant = ArmPlant(CONSTANTS, TOOL, FRAME, START_Q)
        plant.wiring = wiring
        plant.hand.let_go()
        plant.short_windings([False] * 7)
        plant.set_torques([600, 0, 0, 0, 0, 0, 0])
        plant.advance(100_000_000)
        return plant.q[0] - START_Q[0]

    share = np.eye(7)
    share[0, 0] = -1.0
    there, back = turned(None), turned(Wiring(share))
    assert abs(there) > 1e-3
    assert there * back < 0.0
