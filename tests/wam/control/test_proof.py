from dataclasses import replace

import numpy as np
import pytest

from acquisition.control_loop.proof import PROOF_LIMITS, ProofGoal, ProofKind
from acquisition.devices import ArmReading, PositionJump
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


# ms after the begin of a lift, and how high the joint is to be then [mrad]
LIFTED_AT = [(0, 0), (400, 20), (1600, 80), (1899, 80), (2300, 60), (3480, 1)]


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
    assert excess(proof, reading(100, j3=-way)).quantity == "the travel of joint 3"


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
    for ms in (3502, 4000):
        assert not proof.torque(reading(ms, j4=-0.01), WEIGHT).any()


REST = (0.008, 0.015, 0.015, 0.015, 0.030, 0.030, 0.030)  # rad
REACH = (0.008, 0.008, 0.008, 0.008, 0.015, 0.015, 0.020)
OTHERS = {2: 3, 3: 2, 5: 6, 6: 5}  # of the same two motors
E = 1e-6  # rad


def ends(goal, joint):
    """Return how far `joint` may go down and up in a proof [rad], to `E`."""
    proof, found = Proof(goal, CONSTANTS, reading()), []
    for side in (-1.0, 1.0):
        low, high = 0.0, 1.0
        while high - low > E / 4:
            middle = 0.5 * (low + high)
            is_fine = excess(proof, reading(**{f"j{joint}": side * middle})) is None
            low, high = (middle, high) if is_fine else (low, middle)
        found.append(side * low)
    return found


@pytest.mark.parametrize("joint", range(1, 8))
def test_each_joint_rests_and_is_borne_within_its_way(joint):
    most = REST[joint - 1]
    assert ends(ProofGoal(ProofKind.REST), joint) == pytest.approx([-most, most], abs=E)
    borne = ends(ProofGoal(ProofKind.GRAVITY), joint)
    assert borne == pytest.approx([-1.5 * most, 1.5 * most], abs=E)


@pytest.mark.parametrize("joint", range(1, 8))
@pytest.mark.parametrize("sense", [-1.0, 1.0])
@pytest.mark.parametrize("kind", [ProofKind.RAMP, ProofKind.LIFT])
def test_a_joint_goes_on_a_little_beyond_its_aim_and_hardly_back(kind, sense, joint):
    aim = REACH[joint - 1] if kind is ProofKind.RAMP else 0.08
    wanted = sorted([-sense * REACH[joint - 1], sense * (aim + 0.025)])
    found = ends(ProofGoal(kind, joint, sense), joint)
    assert found == pytest.approx(wanted, abs=E)


@pytest.mark.parametrize("pushed", range(1, 8))
@pytest.mark.parametrize("kind", [ProofKind.RAMP, ProofKind.LIFT])
def test_every_other_joint_stays_and_the_partner_nearly(kind, pushed):
    for joint in set(range(1, 8)) - {pushed}:
        most = 0.045 if OTHERS.get(pushed) == joint else 0.025
        found = ends(ProofGoal(kind, pushed, 1.0), joint)
        assert found == pytest.approx([-most, most], abs=E)


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_what_is_told_of_a_way_is_the_end_that_was_passed(side):
    proof = Proof(ProofGoal(ProofKind.RAMP, 2, 1.0), CONSTANTS, reading())
    told = excess(proof, reading(j2=side * 0.1))
    assert told.quantity == "the travel of joint 2"
    assert told.value == pytest.approx(side * 0.1)
    assert told.limit == pytest.approx(0.033 if side > 0.0 else -0.008)


@pytest.mark.parametrize("joint", range(1, 8))
@pytest.mark.parametrize("sense", [-1.0, 1.0])
def test_a_ramp_ends_where_its_joint_has_reached_its_aim(sense, joint):
    proof = Proof(ProofGoal(ProofKind.RAMP, joint, 2.0 * sense), CONSTANTS, reading())
    reach = REACH[joint - 1]
    before = reading(2000, **{f"j{joint}": sense * (reach - E)})
    assert proof.torque(before, WEIGHT) == pytest.approx(
        2.0 * sense * np.eye(7)[joint - 1]
    )
    other_way = reading(2000, **{f"j{joint}": -sense * (reach + E)})
    assert proof.torque(other_way, WEIGHT).any()
    moved = reading(2000, **{f"j{joint}": sense * (reach + E)})
    assert not proof.torque(moved, WEIGHT).any()
    assert not proof.torque(reading(2000), WEIGHT).any()
    assert excess(proof, reading(2000), is_powered=False) is None
    assert proof.torque(reading(3000), WEIGHT).any()


@pytest.mark.parametrize("sense", [-1.0, 1.0])
def test_a_joint_at_its_aim_has_moved(sense):
    assert CONSTANTS.home[0] == 0.0
    proof = Proof(ProofGoal(ProofKind.RAMP, 1, sense), CONSTANTS, reading())
    assert not proof.torque(reading(500, j1=sense * 0.008), WEIGHT).any()


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_a_joint_may_be_at_the_end_of_its_way(side):
    proof = Proof(ProofGoal(ProofKind.REST), CONSTANTS, reading())
    assert excess(proof, reading(j1=side * 0.008)) is None


def test_a_ramp_to_no_torque_pushes_nothing():
    proof = Proof(ProofGoal(ProofKind.RAMP, 2), CONSTANTS, reading())
    for way in (-0.02, 0.0, 0.02):
        assert not proof.torque(reading(500, j2=way), WEIGHT).any()


@pytest.mark.parametrize(("ms", "height"), LIFTED_AT)
@pytest.mark.parametrize("sense", [-1.0, 1.0])
def test_a_lift_goes_up_80_mrad_at_50_mrad_a_second_waits_and_comes_back(
    sense, ms, height
):
    """Where the joint is at the height of that moment nothing pulls it."""
    way = 1e-3 * sense * height
    proof = Proof(ProofGoal(ProofKind.LIFT, 4, 5.0 * sense), CONSTANTS, reading())
    assert proof.torque(reading(ms, j4=way), WEIGHT) == pytest.approx(
        np.zeros(7), abs=1e-6
    )
    behind = proof.torque(reading(ms, j4=way - 1e-3 * sense), WEIGHT)[3]
    assert behind == pytest.approx(sense * 1e-3 * CONSTANTS.kp[3], abs=1e-6)


def test_a_lift_is_damped_and_pulls_either_way_with_no_more_than_its_torque():
    proof = Proof(ProofGoal(ProofKind.LIFT, 4, 5.0), CONSTANTS, reading())
    moving = replace(reading(1700, j4=0.08), qd=0.1 * np.eye(7)[3])
    damped = proof.torque(moving, WEIGHT)[3]
    assert damped == pytest.approx(-0.1 * CONSTANTS.kd[3], abs=1e-6)
    assert proof.torque(reading(1700, j4=-0.02), WEIGHT)[3] == 5.0
    assert proof.torque(reading(1700, j4=0.18), WEIGHT)[3] == -5.0


@pytest.mark.parametrize(("joint", "other"), OTHERS.items())
@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_the_partner_of_a_lifted_joint_is_kept_by_twice_its_friction(
    side, joint, other
):
    proof = Proof(ProofGoal(ProofKind.LIFT, joint, 1.0), CONSTANTS, reading())
    lifted = {f"j{joint}": 0.08}
    most = 2.0 * CONSTANTS.coulomb[other - 1]
    far = proof.torque(reading(1700, **lifted, **{f"j{other}": side}), WEIGHT)
    assert far[other - 1] == pytest.approx(-side * most)
    near = 0.5 * most / CONSTANTS.kp[other - 1]
    kept = proof.torque(reading(1700, **lifted, **{f"j{other}": side * near}), WEIGHT)
    assert kept[other - 1] == pytest.approx(-side * 0.5 * most)


@pytest.mark.parametrize("kind", ProofKind)
def test_a_position_that_cannot_be_true_gets_no_torque(kind):
    proof = Proof(ProofGoal(kind, 2, 5.0, seconds=0.3), CONSTANTS, reading())
    jumped = replace(reading(900), jump=PositionJump(motor=3, counts=900, speed=20.0))
    assert not proof.torque(jumped, WEIGHT).any()


def test_at_rest_nothing_is_pushed():
    proof = Proof(ProofGoal(ProofKind.REST), CONSTANTS, reading())
    assert not proof.torque(reading(900, j2=0.01), WEIGHT).any()


@pytest.mark.parametrize(
    "goal",
    [
        ProofGoal(ProofKind.REST),
        ProofGoal(ProofKind.GRAVITY, seconds=60.0),
        ProofGoal(ProofKind.RAMP, 1, -1.0, 0.001),
        ProofGoal(ProofKind.LIFT, 7, 1.0),
    ],
)
def test_the_widest_goals_are_proofs(goal):
    assert Proof(goal, CONSTANTS, reading()).goal == goal


def test_seventy_millijoules_end_a_proof():
    proof = Proof(ProofGoal(ProofKind.REST), CONSTANTS, reading())
    assert excess(proof, reading(10), 0.07) is None
    told = excess(proof, reading(10), 0.0701)
    assert (told.quantity, told.limit) == ("kinetic energy", 0.07)


@pytest.mark.parametrize(
    "goal",
    [
        ProofGoal(ProofKind.RAMP, 0, 1.0),
        ProofGoal(ProofKind.LIFT, 8, 1.0),
        ProofGoal(ProofKind.GRAVITY, -1),
        ProofGoal(ProofKind.REST, 8),
        ProofGoal(ProofKind.RAMP, 1, 1.0, 60.1),
        ProofGoal(ProofKind.RAMP, 1, 1.0, float("nan")),
        ProofGoal(ProofKind.RAMP, 1, float("inf")),
        ProofGoal(ProofKind.RAMP, 1, float("nan")),
        ProofGoal(ProofKind.GRAVITY, seconds=0.0),
    ],
)
def test_what_is_no_proof_is_refused(goal):
    with pytest.raises(ValueError, match=r"no joint|is not a valid proof"):
        Proof(goal, CONSTANTS, reading())


def test_a_goal_says_what_is_given_in_four_numbers():
    """With no joint and no torque, in a second, where nothing else is said."""
    wanted = [(float(number), 0.0, 0.0, 1.0) for number in range(5)]
    assert [ProofGoal(kind).values for kind in ProofKind] == wanted


def test_a_goal_survives_its_way_through_the_commands():
    goal = ProofGoal(ProofKind.LIFT, 6, -1.5, 2.0)
    assert ProofGoal.of((*goal.values, 0.0)) == goal
    assert ProofGoal.of(replace(goal, joint=5).values) != goal
