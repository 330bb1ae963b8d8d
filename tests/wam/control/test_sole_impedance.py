"""The law of the sole: forces that grow slowly, places, and what it refuses."""

import math
from dataclasses import replace

import numpy as np
import pytest

from acquisition.control_loop.law import SoleGoal
from tests.wam.control.test_controller import DOWN, reading
from wam.control.sole_impedance import LARGEST_F_N, LARGEST_F_T, SoleAxes, SoleImpedance

DT, TICK_NS = 0.002, 2_000_000
NAN = math.nan


def forces(axes: SoleAxes, goal: SoleGoal, cycles: int, *, x: float = 0.1):
    """Return the forces of a sole that rests at `x`, asked anew every 20 ms."""
    found = []
    for k in range(cycles):
        if k % 10 == 0:
            axes.aim(goal, x, 0.0, k * TICK_NS)
        found.append(axes.force((x, 0.0), (0.0, 0.0), k * TICK_NS))
    return found


@pytest.fixture
def axes() -> SoleAxes:
    law = SoleAxes(0.3, DT)
    law.begin(0.1, 0.0, 0)
    return law


def test_traction_grows_at_20_and_load_at_40_newtons_a_second(axes):
    along, down = forces(axes, SoleGoal(6.0, 12.0, 0.1, 0.0, 0.0), 50)[-1]

    assert along == pytest.approx(2.0)
    assert down == pytest.approx(-4.0)


def test_traction_is_let_go_faster_than_it_grows(axes):
    forces(axes, SoleGoal(6.0, 12.0, 0.1, 0.0, 0.0), 150)
    axes.aim(SoleGoal(0.0, 12.0, 0.1, 0.0, 0.0), 0.1, 0.0, 300_000_000)

    assert axes.force((0.1, 0.0), (0.0, 0.0), 300_000_000)[0] == pytest.approx(5.8)


def test_a_moving_sole_is_damped(axes):
    forces(axes, SoleGoal(6.0, 12.0, 0.1, 0.0, 0.0), 150)

    assert axes.force((0.1, 0.0), (0.1, 0.0), 298_000_000)[0] == pytest.approx(2.0)


def test_an_old_command_asks_for_no_traction_and_keeps_the_load(axes):
    forces(axes, SoleGoal(6.0, 12.0, 0.1, 0.0, 0.0), 200)
    late = [axes.force((0.1, 0.0), (0.0, 0.0), 10**9 + k) for k in range(60)]

    assert late[-1] == pytest.approx((0.0, -12.0))


def test_no_traction_is_asked_for_beyond_the_container(axes):
    assert forces(axes, SoleGoal(6.0, 12.0, 0.4, 0.0, 0.0), 200, x=0.36)[-1][0] == 0.0


def test_a_place_is_approached_at_its_speed(axes):
    along, _ = forces(axes, SoleGoal(NAN, 4.0, 0.3, 0.0, 0.05), 50)[-1]

    assert along == pytest.approx(400.0 * 0.05 * 0.1)


def test_a_foot_that_is_lifted_begins_where_it_stands(axes):
    forces(axes, SoleGoal(6.0, 12.0, 0.1, 0.0, 0.0), 200)
    axes.aim(SoleGoal(NAN, NAN, 0.1, 0.02, 0.1), 0.13, -0.004, 402_000_000)

    along, up = axes.force((0.13, -0.004), (0.0, 0.0), 402_000_000)
    assert abs(along) < 0.2
    assert 0.0 < up < 0.2


@pytest.mark.parametrize(
    "goal",
    [
        SoleGoal(LARGEST_F_T + 0.1, 5.0, 0.0, 0.0, 0.0),
        SoleGoal(5.0, LARGEST_F_N + 0.1, 0.0, 0.0, 0.0),
        SoleGoal(-0.1, 5.0, 0.0, 0.0, 0.0),
        SoleGoal(math.inf, 5.0, 0.0, 0.0, 0.0),
        SoleGoal(NAN, 5.0, NAN, 0.0, 0.1),
        SoleGoal(NAN, NAN, 0.0, 0.0, 0.3),
    ],
)
def test_what_no_sole_is_to_do_is_refused(axes, goal):
    with pytest.raises(ValueError, match=r"sole|bounds"):
        axes.aim(goal, 0.1, 0.0, 0)


def test_a_tipped_foot_is_pushed_no_more(axes):
    forces(axes, SoleGoal(6.0, 12.0, 0.1, 0.0, 0.0), 200)
    axes.is_tipped = True
    given = forces(axes, SoleGoal(6.0, 12.0, 0.1, 0.0, 0.0), 50)

    assert given[-1] == pytest.approx((0.0, -12.0))


def test_a_tipped_foot_is_drawn_no_more(axes):
    axes.is_tipped = True
    drawn = forces(axes, SoleGoal(NAN, 4.0, 0.3, 0.0, 0.2), 50)

    assert drawn[-1][0] == 0.0


@pytest.mark.parametrize("load", [NAN, 4.0])
def test_a_foot_is_drawn_with_nine_newtons_at_most(axes, load):
    drawn = forces(axes, SoleGoal(NAN, load, 0.3, 0.0, 0.2), 300)

    assert drawn[-1][0] == pytest.approx(9.0)


def test_a_foot_that_was_drawn_in_vain_is_lifted_without_a_jerk(axes):
    forces(axes, SoleGoal(NAN, 4.0, 0.3, 0.0, 0.2), 300)
    axes.aim(SoleGoal(NAN, NAN, 0.1, 0.02, 0.15), 0.1, 0.0, 600_000_000)

    assert abs(axes.force((0.1, 0.0), (0.0, 0.0), 600_000_000)[0]) < 1.0


@pytest.mark.parametrize("speed", [-0.5, 0.5])
def test_no_damper_is_stronger_than_the_wrist(axes, speed):
    axes.aim(SoleGoal(NAN, NAN, 0.1, 0.0, 0.1), 0.1, 0.0, 0)

    assert abs(axes.force((0.1, 0.0), (speed, 0.0), 0)[0]) == 12.0


def test_a_place_pulls_by_spring_and_damper_in_both_directions(axes):
    axes.aim(SoleGoal(NAN, NAN, 0.1, 0.0, 0.1), 0.1, 0.0, 0)

    assert axes.force((0.09, -0.01), (0.02, 0.02), 0) == pytest.approx((3.2, 3.2))
    assert axes.force((0.11, 0.01), (-0.02, -0.02), 0) == pytest.approx((-3.2, -3.2))


def test_a_foot_is_lifted_with_25_newtons_at_most(axes):
    axes.aim(SoleGoal(NAN, NAN, 0.1, 0.0, 0.1), 0.1, 0.0, 0)

    assert axes.force((0.1, -0.5), (0.0, 0.0), 0)[1] == pytest.approx(25.0)
    assert axes.force((0.1, 0.5), (0.0, 0.0), 0)[1] == pytest.approx(-25.0)


def test_a_load_is_damped(axes):
    forces(axes, SoleGoal(0.0, 4.0, 0.1, 0.0, 0.0), 100)

    down = axes.force((0.1, 0.0), (0.0, 0.1), 200_000_000)[1]
    assert down == pytest.approx(-4.0 - 40.0 * 0.1)


@pytest.mark.parametrize(
    ("deep", "first"), [(0.015, 5.92), (-0.01, 0.08), (0.08, 21.92)]
)
def test_a_load_begins_with_what_the_lowered_foot_pressed(deep, first):
    axes = SoleAxes(0.3, DT)
    axes.begin(0.1, -deep, 0)
    axes.aim(SoleGoal(0.0, 4.0, 0.1, 0.0, 0.0), 0.1, 0.0, 0)
    asked = -axes.force((0.1, 0.0), (0.0, 0.0), 0)[1]

    assert asked == pytest.approx(first)


@pytest.mark.parametrize(
    ("age_ns", "grows"), [(100_000_000, True), (100_000_001, False)]
)
def test_a_command_is_old_after_a_tenth_of_a_second(axes, age_ns, grows):
    axes.aim(SoleGoal(6.0, 12.0, 0.1, 0.0, 0.0), 0.1, 0.0, 0)

    along = axes.force((0.1, 0.0), (0.0, 0.0), age_ns)[0]
    assert along == pytest.approx(0.04 if grows else 0.0)


def test_an_old_command_draws_the_foot_no_further(axes):
    forces(axes, SoleGoal(NAN, 4.0, 0.3, 0.0, 0.05), 50)
    late = [axes.force((0.1, 0.0), (0.0, 0.0), 10**9 + k)[0] for k in range(50)]

    assert late == pytest.approx([2.0] * 50)


@pytest.mark.parametrize(
    ("x", "along"), [(-0.05, 0.04), (-0.051, 0.0), (0.35, 0.04), (0.351, 0.0)]
)
def test_traction_ends_50_millimetres_past_the_container(x, along):
    axes = SoleAxes(0.3, DT)
    axes.begin(x, 0.0, 0)
    axes.aim(SoleGoal(6.0, 12.0, 0.1, 0.0, 0.0), x, 0.0, 0)

    assert axes.force((x, 0.0), (0.0, 0.0), 0)[0] == pytest.approx(along)


def test_traction_that_was_given_up_begins_again_at_nothing(axes):
    forces(axes, SoleGoal(6.0, 12.0, 0.1, 0.0, 0.0), 150)
    axes.aim(SoleGoal(NAN, 12.0, 0.1, 0.0, 0.0), 0.1, 0.0, 300_000_000)
    axes.aim(SoleGoal(6.0, 12.0, 0.1, 0.0, 0.0), 0.1, 0.0, 300_000_000)

    assert axes.force((0.1, 0.0), (0.0, 0.0), 300_000_000)[0] == pytest.approx(0.04)


def test_a_foot_that_is_held_in_a_slip_is_held_where_it_is(axes):
    forces(axes, SoleGoal(6.0, 12.0, 0.1, 0.0, 0.0), 150)
    axes.aim(SoleGoal(NAN, 12.0, 0.15, 0.0, 0.0), 0.15, 0.0, 300_000_000)

    along = axes.force((0.16, 0.0), (0.0, 0.0), 300_000_000)[0]
    assert along == pytest.approx(-400.0 * 0.01)


def test_a_law_that_begins_again_forgets_its_forces(axes):
    forces(axes, SoleGoal(6.0, 12.0, 0.1, 0.0, 0.0), 150)
    axes.begin(0.2, 0.01, 300_000_000)

    assert axes.force((0.2, 0.01), (0.0, 0.0), 300_000_000) == (0.0, 0.0)
    axes.aim(SoleGoal(6.0, 12.0, 0.2, 0.0, 0.0), 0.2, 0.01, 300_000_000)
    assert axes.force((0.2, 0.01), (0.0, 0.0), 300_000_000) == pytest.approx(
        (0.04, -0.08)
    )


@pytest.mark.parametrize(
    "goal",
    [
        SoleGoal(LARGEST_F_T, LARGEST_F_N, 1.99, -1.99, 0.2),
        SoleGoal(0.0, 0.0, -1.99, 1.99, 0.0),
    ],
)
def test_what_is_just_within_the_bounds_is_taken(axes, goal):
    axes.aim(goal, 0.1, 0.0, 0)

    assert axes.force((0.1, 0.0), (0.0, 0.0), 0)[0] >= 0.0


@pytest.mark.parametrize(
    "goal",
    [
        SoleGoal(5.0, 5.0, 2.0, 0.0, 0.1),
        SoleGoal(5.0, 5.0, 0.0, -2.0, 0.1),
        SoleGoal(5.0, 5.0, 0.0, 0.0, -0.01),
        SoleGoal(5.0, 5.0, 0.0, 0.0, 0.201),
    ],
)
def test_places_out_of_reach_are_refused(axes, goal):
    with pytest.raises(ValueError, match="no place"):
        axes.aim(goal, 0.1, 0.0, 0)


# The terrain turned about the vertical, so that no two axes can be mistaken.
TURNED = np.array([[0.6, 0.8, 0.0], [-0.8, 0.6, 0.0], [0.0, 0.0, 1.0]])
TRAVELLED = 0.1  # m, of the sole along the container


def standing(model, began=DOWN, aside=0.0):
    """Return a law that holds its place.

    It began at `began` [rad], and the centre line lies `aside` [m] of the sole.
    """
    position, _ = model.sole_pose(DOWN)
    origin = position - TRAVELLED * TURNED[0] - aside * TURNED[1]
    law = SoleImpedance(model, TURNED, origin, 0.3, DT)
    law.begin(reading(0.0, q=began))
    law.aim(SoleGoal(NAN, NAN, TRAVELLED, 0.0, 0.0), reading(0.0))
    return law


def wrench_of(model, tau):
    """Return the force and moment at the sole that give `tau` but for joint 7."""
    J = model.sole_jacobian(DOWN)[:, :6]
    return np.linalg.solve(J.T, tau[:6])


def test_an_arm_that_is_where_it_was_gets_nothing(foot_model):
    tau = standing(foot_model).torque(reading(0.0))

    assert np.abs(tau).max() < 1e-9


def test_forces_are_along_the_axes_of_the_terrain(foot_model):
    law = standing(foot_model)
    law.aim(SoleGoal(6.0, 12.0, TRAVELLED, 0.0, 0.0), reading(0.0))
    found = wrench_of(foot_model, law.torque(reading(0.0)))

    assert found[:3] == pytest.approx(0.04 * TURNED[0] - 0.08 * TURNED[2])
    assert found[3:] == pytest.approx(np.zeros(3), abs=1e-9)


@pytest.mark.parametrize(("aside", "force"), [(0.02, -8.0), (-0.02, 8.0), (0.5, -12.0)])
def test_a_foot_aside_is_drawn_to_the_centre_line(foot_model, aside, force):
    found = wrench_of(
        foot_model, standing(foot_model, aside=aside).torque(reading(0.0))
    )

    assert found[:3] == pytest.approx(force * TURNED[1], abs=1e-6)


def test_a_moving_arm_is_damped_in_all_six_directions(foot_model):
    qd = np.array([0.02, 0.01, -0.02, 0.01, 0.03, -0.02, 0.0])
    moving = replace(reading(0.0), qd=qd)
    twist = foot_model.sole_jacobian(DOWN).dot(qd)
    found = wrench_of(foot_model, standing(foot_model).torque(moving))

    along = TURNED @ twist[:3]
    assert TURNED @ found[:3] == pytest.approx(-40.0 * along)
    assert found[3:] == pytest.approx(-0.8 * twist[3:])


@pytest.mark.parametrize("joint", range(6))
@pytest.mark.parametrize("sense", [-1.0, 1.0])
def test_a_sole_that_turned_is_turned_back(foot_model, joint, sense):
    began = DOWN.copy()
    began[joint] += sense * 0.02
    _, before = foot_model.sole_pose(began)
    _, now = foot_model.sole_pose(DOWN)
    found = wrench_of(foot_model, standing(foot_model, began).torque(reading(0.0)))

    (_, xy, xz), (yx, _, yz), (zx, zy, _) = before @ now.T
    turn = 0.5 * np.array([zy - yz, xz - zx, yx - xy])  # back, of a small angle [rad]
    assert np.linalg.norm(turn) == pytest.approx(0.02, rel=1e-3)
    assert found[3:] == pytest.approx(12.0 * turn, abs=1e-9)


@pytest.mark.parametrize(("turned", "pushes"), [(0.095, True), (0.11, False)])
@pytest.mark.parametrize("sense", [-1.0, 1.0])
def test_a_foot_is_pushed_until_it_has_tipped(foot_model, turned, pushes, sense):
    began = DOWN.copy()
    began[5] += sense * turned
    law = standing(foot_model, began)
    law.aim(SoleGoal(6.0, 12.0, TRAVELLED, 0.0, 0.0), reading(0.0))
    along = TURNED[0] @ wrench_of(foot_model, law.torque(reading(0.0)))[:3]

    assert along == pytest.approx(0.04 if pushes else 0.0, abs=1e-9)


def test_joint_7_has_its_lock(foot_model):
    law = standing(foot_model, aside=0.02)

    assert law.torque(reading(0.0))[6] == 0.0


def test_a_foot_that_slipped_is_held_where_the_arm_is(foot_model):
    law = standing(foot_model)
    law.aim(SoleGoal(6.0, 12.0, TRAVELLED, 0.0, 0.0), reading(0.0))
    q = DOWN.copy()
    q[1] += 0.05
    now = reading(0.0, q=q)
    position, _ = foot_model.sole_pose(q)
    x = TRAVELLED + float(TURNED[0] @ (position - foot_model.sole_pose(DOWN)[0]))
    law.aim(SoleGoal(NAN, 12.0, x, 0.0, 0.0), now)
    J = foot_model.sole_jacobian(q)[:, :6]
    along = TURNED[0] @ np.linalg.solve(J.T, law.torque(now)[:6])[:3]

    assert abs(x - TRAVELLED) > 1e-3
    assert along == pytest.approx(0.0, abs=1e-6)
