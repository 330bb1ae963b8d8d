"""Hands on the links pose the simulated arm and turn joints to their stops."""

import numpy as np
import pytest

from fakes.plant.hand import HandPhase
from fakes.plant.model import Support
from tests.fakes.scenes import CONSTANTS, MODEL, make_plant
from tests.sweeps import swept

SEEDS = (1, 2, 3)
GOAL = np.array([0.5, -1.0, 0.4, 2.0, -1.0, 0.7, 1.0])
POSED = 5e-3  # rad; the springs of the hands give by friction over stiffness
OTHERS = 0.05  # rad, of the joints that are not turned
PRESSED = 0.01  # rad beyond a stop: a spring of 2000 N m/rad under some N m


def pass_time(plant, seconds):
    plant.advance(plant.t_ns + round(1e9 * seconds))


def wait(plant, at_most=15.0):
    """Let time pass until the hands are done; return the duration [s]."""
    begin_ns = plant.t_ns
    while not plant.is_hand_done:
        pass_time(plant, 0.05)
        assert plant.t_ns - begin_ns < 1e9 * at_most
    return 1e-9 * (plant.t_ns - begin_ns)


def hold_at_goal(plant):
    """Set the arm to a pose in which the hands hold it."""
    plant.q = GOAL
    plant.pose(GOAL, 0.1)
    pass_time(plant, 0.4)


@pytest.mark.parametrize(("seed", "cables"), [(1, None), (2, 15.0), (3, None)])
def test_hands_bring_the_idle_arm_to_a_pose_and_hold_it(seed, cables):
    plant = make_plant(friction=1.0, seed=seed, cables=cables)
    plant.pose(GOAL, 1.5)
    assert not plant.is_hand_done
    assert 1.4 < wait(plant) < 1.7
    pass_time(plant, 1.0)
    assert plant.is_idle
    assert np.abs(plant.q - GOAL).max() < POSED
    assert np.abs(plant.qd).max() < 1e-3


def test_the_path_to_a_pose_is_smooth_and_takes_its_duration():
    plant = make_plant(friction=0.4, seed=1)
    start = plant.q.copy()
    plant.pose(GOAL, 2.0)
    pass_time(plant, 1.0)
    half = (plant.q - start) / (GOAL - start)
    # Half of a minimum-jerk path; shorted windings lag by 0.1 s at most.
    assert half == pytest.approx(np.full(7, 0.5), abs=0.1)
    assert np.abs(plant.qd).max() < 2.0 * np.abs(GOAL - start).max() / 2.0


@pytest.mark.parametrize(
    ("seed", "joint", "side"),
    swept(
        [
            (1, 1, "low"),
            (2, 1, "high"),
            (3, 2, "low"),
            (1, 3, "high"),
            (2, 4, "high"),
            (3, 5, "high"),
            (1, 6, "high"),
            (2, 6, "low"),
            (3, 7, "low"),
        ],
        {(1, 1, "low"), (2, 4, "high"), (3, 7, "low")},
    ),
)
def test_hands_turn_a_joint_until_its_stop(seed, joint, side):
    plant = make_plant(friction=1.0, seed=seed)
    ends = plant.ends.lower if side == "low" else plant.ends.upper
    near = GOAL.copy()
    near[joint - 1] = ends[joint - 1] + (0.4 if side == "low" else -0.4)
    plant.q = near
    before = plant.q.copy()
    plant.turn_to_stop(joint, side)
    assert not plant.is_hand_done
    wait(plant)
    pass_time(plant, 0.1)
    beyond = plant.q[joint - 1] - ends[joint - 1]
    assert 0.0 < (beyond if side == "high" else -beyond) < PRESSED
    moved = np.abs(plant.q - before)
    moved[joint - 1] = 0.0
    assert moved.max() < OTHERS


def test_a_pose_beyond_a_stop_ends_at_the_stop():
    plant = make_plant(friction=0.4, seed=1)
    plant.pose([*GOAL[:5], 2.5, GOAL[6]], 1.0)
    pass_time(plant, 1.5)
    assert plant.q[5] == pytest.approx(CONSTANTS.q_upper[5], abs=PRESSED)


def test_the_arm_sinks_when_the_hands_let_go():
    plant = make_plant(friction=0.4, seed=1, support=Support.NONE)
    hold_at_goal(plant)
    held = plant.q.copy()
    plant.let_go()
    pass_time(plant, 0.3)
    assert np.abs(plant.q - held).max() > 0.02
    assert plant.hand.phase is HandPhase.AWAY


def test_a_supported_arm_stays_where_the_hands_left_it():
    plant = make_plant(friction=0.4, seed=1, support=Support.PERSON)
    hold_at_goal(plant)
    plant.let_go()
    pass_time(plant, 0.5)
    assert np.abs(plant.q - GOAL).max() < POSED


def test_a_hand_on_the_foot_after_a_pose_keeps_its_orientation():
    plant = make_plant(friction=0.4, seed=1)
    hold_at_goal(plant)
    plant.hand.carry()
    pass_time(plant, 1.0)
    # The hand holds the foot alone: joints turn a little in its null space.
    assert np.abs(plant.q - GOAL).max() < 0.2


def tilted(x=0.0, y=0.0, z=0.0):
    down = np.array([x, y, z])
    return tuple((down / np.linalg.norm(down)).tolist())


@pytest.mark.parametrize("down", [(0.0, 0.0, -1.0), tilted(0.3, -0.2, -0.9)])
@pytest.mark.parametrize("seed", SEEDS)
def test_a_hung_weight_reads_as_its_weight_vertically(seed, down):
    plant = make_plant(friction=1.0, seed=seed, down=down)
    hold_at_goal(plant)
    free = np.array(plant.sensor_load(plant.t_ns))
    plant.hang(2.0)
    pass_time(plant, 0.5)
    hung = np.array(plant.sensor_load(plant.t_ns)) - free
    rotation = MODEL.sole_pose(plant.q)[1]
    shown = rotation @ hung[:3]
    # The arm yields by milliradians, which turns the foot's own weight.
    assert shown == pytest.approx(2.0 * 9.81 * np.array(down), abs=0.1)
    assert np.abs(plant.q - GOAL).max() < POSED
    plant.hang(0.0)
    pass_time(plant, 0.5)
    again = np.array(plant.sensor_load(plant.t_ns))
    assert again == pytest.approx(free, abs=0.05)


def test_a_hung_weight_acts_at_the_sole():
    plant = make_plant(friction=1.0, seed=1)
    hold_at_goal(plant)
    free = np.array(plant.sensor_load(plant.t_ns))
    plant.hang(2.0)
    pass_time(plant, 0.5)
    hung = np.array(plant.sensor_load(plant.t_ns)) - free
    lever = MODEL.tool.sole - [0.0, 0.0, MODEL.tool.sensor_height]
    assert hung[3:] == pytest.approx(np.cross(lever, hung[:3]), abs=0.01)


def test_a_push_is_measured_by_the_sensor_and_ends():
    plant = make_plant(friction=1.0, seed=1)
    hold_at_goal(plant)
    free = np.array(plant.sensor_load(plant.t_ns))
    force = np.array([5.0, -3.0, 2.0])
    plant.push_with(force, 0.4)
    pass_time(plant, 0.3)
    shown = np.array(plant.sensor_load(plant.t_ns)) - free
    rotation = MODEL.sole_pose(plant.q)[1]
    assert rotation @ shown[:3] == pytest.approx(force, abs=0.05)
    pass_time(plant, 0.4)
    after = np.array(plant.sensor_load(plant.t_ns))
    assert after == pytest.approx(free, abs=0.05)


def test_a_push_moves_an_unsupported_arm():
    def moved(force):
        plant = make_plant(friction=0.4, seed=1, has_hand=False, support=Support.NONE)
        plant.short_windings([False] * 7)
        plant.push_with(force, 0.2)
        pass_time(plant, 0.2)
        return MODEL.sole_pose(plant.q)[0]

    # 30 N for 0.2 s against some kg: centimetres, less the sinking in both cases.
    aside = moved([0.0, 30.0, 0.0]) - moved([0.0, 0.0, 0.0])
    assert aside[1] > 0.01


def test_a_twist_is_measured_turns_joint_7_and_ends():
    plant = make_plant(friction=0.4, seed=1, has_hand=False, support=Support.NONE)
    pass_time(plant, 0.1)
    free, before = np.array(plant.sensor_load(plant.t_ns)), plant.q[6]
    plant.twist(0.6, 0.5)
    pass_time(plant, 0.1)
    early = np.array(plant.sensor_load(plant.t_ns)) - free
    pass_time(plant, 0.35)
    late = np.array(plant.sensor_load(plant.t_ns)) - free
    # The twist grows at 2 N m/s, and the foot's inertia takes a little of it.
    assert early[5] == pytest.approx(0.2, abs=0.03)
    assert late[5] == pytest.approx(0.6, abs=0.03)
    assert plant.q[6] - before > 0.01
    pass_time(plant, 0.3)
    assert (np.array(plant.sensor_load(plant.t_ns)) - free)[5] == pytest.approx(
        0.0, abs=0.05
    )
