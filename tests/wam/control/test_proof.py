from dataclasses import replace

import numpy as np
import pytest

from acquisition.control_loop.proof import PROOF_LIMITS, ProofGoal, ProofKind
from acquisition.devices import ArmReading
from wam.control.proof import Proof
from wam.model.constants import load_constants

CONSTANTS = load_constants()
WEIGHT = np.full(7, 4.0)
MS = 1_000_000


def reading(ms=0, **joints):
    """Return a reading; `j3=0.01` puts joint 3 there."""
    q = CONSTANTS.home.copy()
    for name, way in joints.items():
        q[int(name[1]) - 1] += way
    return ArmReading(
        host_ns=ms * MS,
        arm_ns=ms * MS,
        bus_ns=0,
        counts=[0] * 7,
        q=q,
        qd=np.zeros(7),
        qd7_raw=0.0,
        fresh=0x7F,
        is_complete=True,
        missing_cycles=0,
        jump=None,
        foreign_id=None,
        has_bus_error=False,
    )


def excess(proof, now, energy=0.0, *, is_powered=True):
    return proof.excess(now, energy, is_powered=is_powered)


def test_a_ramp_pushes_one_joint_evenly_and_ends_where_that_moves():
    proof = Proof(ProofGoal(ProofKind.RAMP, 2, 10.0, 1.0), CONSTANTS, reading())
    assert proof.torque(reading(500), WEIGHT).tolist() == [0, 5, 0, 0, 0, 0, 0]
    moved = reading(600, j2=PROOF_LIMITS.reach[1] + 1e-4)
    assert not proof.torque(moved, WEIGHT).any()
    assert not proof.torque(reading(700), WEIGHT).any()


@pytest.mark.parametrize("sense", [1.0, -1.0])
def test_a_joint_that_goes_the_other_way_is_too_much(sense):
    proof = Proof(ProofGoal(ProofKind.RAMP, 3, sense), CONSTANTS, reading())
    way = sense * (PROOF_LIMITS.reach[2] + 0.001)
    assert excess(proof, reading(100, j3=way)) is None
    assert excess(proof, reading(100, j3=-way)).quantity == "the way of joint 3"


def test_another_joint_may_go_less_far_than_one_of_the_same_motors():
    proof = Proof(ProofGoal(ProofKind.RAMP, 2, 1.0), CONSTANTS, reading())
    way = PROOF_LIMITS.aside + 0.001
    assert excess(proof, reading(100, j3=way)) is None
    assert excess(proof, reading(100, j4=way)) is not None


def test_without_power_a_hand_may_move_the_arm_and_the_ramp_waits():
    proof = Proof(ProofGoal(ProofKind.RAMP, 1, 8.0, 1.0), CONSTANTS, reading())
    assert excess(proof, reading(900, j4=-0.5), is_powered=False) is None
    assert excess(proof, reading(902, j4=-0.5)) is None
    assert proof.torque(reading(1400, j4=-0.5), WEIGHT)[0] == pytest.approx(4.0)


def test_energy_ends_a_proof():
    proof = Proof(ProofGoal(ProofKind.REST), CONSTANTS, reading())
    assert excess(proof, reading(10), PROOF_LIMITS.energy) is None
    assert excess(proof, reading(10), PROOF_LIMITS.energy + 0.001).unit == "J"


def test_gravity_grows_to_the_whole_and_stays():
    goal = ProofGoal(ProofKind.GRAVITY, seconds=2.0)
    proof = Proof(goal, CONSTANTS, reading())
    assert proof.torque(reading(1000), WEIGHT) == pytest.approx(WEIGHT / 2)
    assert proof.torque(reading(5000), WEIGHT) == pytest.approx(WEIGHT)


def test_a_lift_never_exceeds_its_torque_and_ends_without():
    proof = Proof(ProofGoal(ProofKind.LIFT, 4, -6.0), CONSTANTS, reading())
    assert proof.torque(reading(1600), WEIGHT)[3] == -6.0
    assert not proof.torque(reading(4000), WEIGHT).any()


@pytest.mark.parametrize(
    "goal",
    [
        ProofGoal(ProofKind.RAMP, 0, 1.0),
        ProofGoal(ProofKind.LIFT, 8, 1.0),
        ProofGoal(ProofKind.RAMP, 1, float("nan")),
        ProofGoal(ProofKind.GRAVITY, seconds=0.0),
    ],
)
def test_what_is_no_proof_is_refused(goal):
    with pytest.raises(ValueError, match=r"no joint|is no proof"):
        Proof(goal, CONSTANTS, reading())


def test_a_goal_survives_its_way_through_the_commands():
    goal = ProofGoal(ProofKind.LIFT, 6, -1.5, 2.0)
    assert ProofGoal.of((*goal.values, 0.0)) == goal
    assert ProofGoal.of(replace(goal, joint=5).values) != goal
