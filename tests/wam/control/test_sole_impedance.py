"""The law of the sole: forces that grow slowly, places, and what it refuses."""

import math

import pytest

from acquisition.control_loop import SoleGoal
from wam.control import LARGEST_F_N, LARGEST_F_T, SoleAxes

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
