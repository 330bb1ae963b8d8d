"""Identification of friction: the path, the reduction, the fit, the file."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from acquisition.errors import SettingsError
from tests.wam.model.test_friction import example
from wam.calibration.excitation import LegPurpose, plan_friction
from wam.calibration.free_space import UPRIGHT, FreeSpace
from wam.calibration.friction_file import (
    FrictionCalibration,
    friction_from_toml,
    friction_to_toml,
    truth_to_toml,
)
from wam.calibration.friction_fit import check_friction, fit_friction
from wam.calibration.joint_friction import (
    joint_asymmetry,
    joint_breakaway,
    speed_curve,
)
from wam.calibration.poses import POINT_SPEED
from wam.calibration.sliding import RecordedLeg, SlidingRows, sliding_rows
from wam.control.position_control import JointMove
from wam.model.arm_model import ArmModel
from wam.model.constants import load_constants
from wam.model.friction import MotorFriction, joint_coulomb, largest_motor_ratios

CONSTANTS = load_constants()
TURNS = largest_motor_ratios(CONSTANTS)
SPACE = FreeSpace(0.33)
IN_CONTAINER = np.array([0.0, 0.7, 0.0, 1.25, 0.0, 1.15, 0.0])
KNOWN = np.full(21, 0.02)  # kg m
HEAVIER = np.random.default_rng(0).normal(0.0, 0.01, 21)  # than the model [kg m]
BLOCK = 100  # rows whose residuals are alike


@pytest.fixture(scope="module")
def model(example_tool):
    return ArmModel(load_constants(), example_tool)


@pytest.fixture(scope="module")
def legs(model):
    return plan_friction(model, IN_CONTAINER, SPACE)


def truth():
    return replace(
        example(),
        coulomb=np.array([0.06, 0.045, 0.044, 0.06, 0.02, 0.021, 0.0067]),
        asymmetry=np.array([0.004, -0.002, 0.003, 0.0, 0.001, -0.001, 0.0003]),
        stribeck=0.02 * TURNS,
        breakaway=np.array([1.2, 1.1, 1.3, 1.25, 1.15, 1.35, 1.2]),
        presliding=2e-3 * TURNS,
    )


def rows_of(friction, seed, *, noise=0.02, correlated=False, count=2000):
    """Return simulated rows of all motors; noise as a share of Coulomb friction."""
    rng = np.random.default_rng(seed)
    speed = (
        rng.choice([-1.0, 1.0], (count, 7)) * rng.uniform(0.004, 0.5, (count, 7)) ** 2
    )
    speed = np.where(rng.random((count, 7)) < 0.03, 1e-9 * speed, speed * TURNS)
    angle = rng.uniform(-20.0, 20.0, (count, 7))
    load = rng.uniform(-0.4, 0.4, (count, 7))
    inertia = 0.05 * friction.coulomb * rng.standard_normal((count, 7))
    gravity = rng.standard_normal((count, 7, 21)) / TURNS[:, None]
    error = rng.standard_normal((count, 7))
    if correlated:
        error = np.repeat(error[:: BLOCK // 2], BLOCK // 2, axis=0)
    shown = friction.steady(angle, load, speed) + gravity @ HEAVIER
    shown += noise * friction.coulomb * error
    return [
        SlidingRows(
            angle=angle[:, i],
            speed=np.where(np.abs(speed[:, i]) < 1e-6, 0.0, speed[:, i]),
            sense=np.where(speed[:, i] < 0.0, -1.0, 1.0),
            load=load[:, i],
            friction=shown[:, i],
            inertia=inertia[:, i],
            gravity=gravity[:, i],
            block=np.arange(count) // BLOCK,
        )
        for i in range(7)
    ]


@pytest.fixture(scope="module")
def fit():
    return fit_friction(CONSTANTS, rows_of(truth(), 1), rows_of(truth(), 2), KNOWN)


def at_load(friction, load_at):
    growth = friction.load * (load_at - friction.load_at)
    return replace(friction, coulomb=friction.coulomb + growth, load_at=load_at)


def test_friction_is_recovered_from_rows(fit):
    found, wanted = fit.friction, at_load(truth(), fit.friction.load_at)
    assert found.coulomb == pytest.approx(wanted.coulomb, rel=0.02)
    error = np.abs(found.asymmetry - wanted.asymmetry)
    assert (error < 0.02 * wanted.coulomb).all()
    assert found.load == pytest.approx(wanted.load, abs=0.01)
    ripple = np.hypot(
        found.ripple_sin - wanted.ripple_sin, found.ripple_cos - wanted.ripple_cos
    )
    assert ripple.max() < 0.01
    assert joint_breakaway(CONSTANTS, found) == pytest.approx(
        joint_breakaway(CONSTANTS, wanted), rel=0.03
    )
    speeds = np.geomspace(0.01, 0.4, 20)
    for joint in range(7):
        curves = [speed_curve(CONSTANTS, f, joint, speeds) for f in (found, wanted)]
        assert curves[0] == pytest.approx(curves[1], rel=0.04)
    check_friction(fit)


def test_intervals_hold_the_true_coulomb_friction(fit):
    error = np.abs(
        fit.friction.coulomb - at_load(truth(), fit.friction.load_at).coulomb
    )
    assert (error < 3.0 * fit.deviation).all()
    assert (fit.lower_bound < fit.friction.coulomb).all()


@pytest.mark.slow
def test_correlated_residuals_within_a_block_widen_the_interval():
    quiet = rows_of(truth(), 4, noise=1e-4)
    wide, narrow = (
        fit_friction(
            CONSTANTS, rows_of(truth(), 3, noise=0.1, correlated=alike), quiet, KNOWN
        )
        for alike in (True, False)
    )
    # fifty equal rows count as one
    assert np.median(wide.asymmetry_deviation / narrow.asymmetry_deviation) > 1.3


def test_one_weight_correction_explains_all_motors(fit):
    assert fit.moments.ravel() == pytest.approx(HEAVIER, abs=1e-3)


@pytest.mark.slow
def test_presliding_is_the_displacement_up_to_breakaway():
    rows = rows_of(truth(), 1)
    broken = truth().coulomb * truth().breakaway
    bent = 1.3e-3 * TURNS / broken  # rad per N m of an elastic bristle
    pairs = zip(rows, bent, strict=True)
    shown = [replace(r, compliance=np.full(5, b)) for r, b in pairs]
    shown[6] = rows[6]
    found = fit_friction(CONSTANTS, shown, rows_of(truth(), 2), KNOWN)
    there = at_load(truth(), found.friction.load_at)
    wanted = 1.3e-3 * there.coulomb / truth().coulomb
    presliding = found.friction.presliding / TURNS
    assert presliding[:6] == pytest.approx(wanted[:6], rel=0.05)
    assert presliding[6] == 2e-3  # ASSUMED: it gave way on no leg


@pytest.mark.slow
def test_a_friction_of_another_form_is_refused():
    held_out = rows_of(truth(), 2)
    other = [
        replace(r, friction=r.friction * (1 + 0.5 * np.sin(r.load * 9)))
        for r in held_out
    ]
    with pytest.raises(SettingsError, match="model does not fit"):
        check_friction(fit_friction(CONSTANTS, rows_of(truth(), 1), other, KNOWN))


def test_a_motor_that_slid_in_one_direction_only_is_reported():
    rows = rows_of(truth(), 1)
    forwards = rows[3].sense > 0.0
    names = set(SlidingRows.__slots__) - {"compliance"}
    columns = {n: getattr(rows[3], n)[forwards] for n in names}
    rows[3] = SlidingRows(**columns)
    with pytest.raises(SettingsError, match="Motor 4"):
        fit_friction(CONSTANTS, rows, rows_of(truth(), 2), KNOWN)


def test_the_path_stays_within_its_time_budget(legs):
    here, seconds = IN_CONTAINER, 0.0
    for leg in legs:
        move = JointMove(here, leg.waypoint.q, leg.waypoint.speed)
        seconds += move.duration + 0.54  # the arm settles after each move
        here = leg.waypoint.q
    assert 120.0 < seconds < 360.0


def test_the_path_returns_to_its_start_and_rises_first(legs):
    assert (legs[-1].waypoint.q == IN_CONTAINER).all()
    assert (legs[0].waypoint.q == UPRIGHT).all()


def test_no_leg_is_too_fast_or_too_low(model, legs):
    ends = [IN_CONTAINER, *(leg.waypoint.q for leg in legs)]
    for (here, goal), leg in zip(pairwise(ends), legs, strict=True):
        move = JointMove(here, goal, leg.waypoint.speed)
        steps = [move.at(t)[0] for t in np.arange(0.0, move.duration, 0.1)]
        sole = model.sole_path(np.array([*steps, goal])).position
        speed = np.linalg.norm(np.diff(sole, axis=0), axis=1) / 0.1
        assert (speed < 1.1 * POINT_SPEED).all()
        if leg.use is not LegPurpose.TRANSIT:
            assert SPACE.is_clear(model, here, goal)
            assert sole[:, 2].min() > SPACE.floor


def test_every_motor_turns_in_both_directions_slowly_and_fast(legs):
    turned = {}
    for before, leg in pairwise(legs):
        if leg.use is LegPurpose.TRANSIT:
            continue
        travel = CONSTANTS.j2mp @ (leg.waypoint.q - before.waypoint.q) / TURNS
        rate = (
            leg.waypoint.speed
            * travel
            / np.abs(leg.waypoint.q - before.waypoint.q).max()
        )
        for motor in np.flatnonzero(np.abs(rate) > 1e-9):
            turned.setdefault(int(motor), []).append(float(rate[motor]))
    for motor in range(7):
        rates = np.array(turned[motor])
        for side in (rates[rates > 0.0], -rates[rates < 0.0]):
            assert side.min() < 0.01
            assert side.max() > 0.1


def test_the_held_out_path_is_not_among_the_fitted_ones(legs):
    displacements = {use: set() for use in LegPurpose}
    for before, leg in pairwise(legs):
        displacements[leg.use].add(
            tuple(np.round(leg.waypoint.q - before.waypoint.q, 6))
        )
    assert displacements[LegPurpose.HELD_OUT]
    assert not displacements[LegPurpose.HELD_OUT] & displacements[LegPurpose.FIT]


def test_a_lack_of_clearance_is_refused(model):
    with pytest.raises(SettingsError, match="poses"):
        plan_friction(model, np.array(UPRIGHT), FreeSpace(0.62))


def leg_of(model, motor_torque, sign):
    """Return a leg at 0.1 rad/s of joint 4 to one side and back."""
    t = np.arange(2000) * 0.002
    shift = 0.1 * np.where(t < 2.0, t, 4.0 - t)
    q = np.array(UPRIGHT) + shift[:, None] * np.eye(7)[3]
    sense = np.where(t < 2.0, 1.0, -1.0)
    tau = np.array([model.gravity(row) for row in q])
    tau[:, 3] += 18.0 * motor_torque * sense * sign
    return RecordedLeg(q, tau, 0.1)


def test_rows_contain_the_motor_torque_not_explained_by_weight(model):
    rows = sliding_rows(model, model, [leg_of(model, 0.05, 1.0)])[3]
    away = np.abs(np.abs(rows.friction) - 0.05)
    assert np.abs(rows.speed) == pytest.approx(1.8, abs=0.02)
    assert away.max() < 0.001
    assert (np.sign(rows.friction) == rows.sense).all()
    assert {-1.0, 1.0} == set(rows.sense)  # motor 4 turns against its joint


def test_no_row_is_taken_before_the_bristle_has_reversed(model):
    rows = sliding_rows(model, model, [leg_of(model, 0.05, 1.0)])[3]
    turning = -18.0 * (UPRIGHT[3] + 0.2)
    back = rows.angle[rows.sense > 0.0]
    assert np.abs(back - turning).min() > 18.0 * 6e-3


def test_a_motor_at_rest_gives_no_rows(model):
    rows = sliding_rows(model, model, [leg_of(model, 0.05, 1.0)])
    assert [len(shown) for shown in rows] == [0, 0, 0, len(rows[3]), 0, 0, 0]


def jumping_leg(model, peak):
    """Return a leg of joint 7, stuck up to `peak` [N m at the motor], then thrown.

    The torque grows within 80 ms; 40 rad/s^2 for 40 ms follow.
    """
    time = np.arange(600) * 0.002
    begun, loose = 0.8, 0.88  # s
    after = np.clip(time - loose, 0.0, None)
    q7 = np.where(after < 0.04, 20.0 * after**2, 0.032 + 1.6 * (after - 0.04))
    accelerating = (after > 0.0) & (after < 0.04)
    resisting = peak * np.clip((time - begun) / (loose - begun), 0.0, 1.0)
    resisting = np.where(after > 0.0, 0.6 * peak, resisting)
    q = np.tile(UPRIGHT, (600, 1))
    q[:, 6] += q7
    tau = np.array([model.gravity(row) for row in q])
    thrown = np.array([model.mass_matrix(row)[:, 6] for row in q])
    tau += np.where(accelerating, 40.0, 0.0)[:, None] * thrown
    tau[:, 6] += TURNS[6] * resisting
    return RecordedLeg(q, tau, 0.015)


def test_breakaway_of_a_light_joint_is_seen_before_it_accelerates(model):
    peak = 0.007
    rows = sliding_rows(model, model, [jumping_leg(model, peak)])[6]
    broken = rows.friction[rows.speed == 0.0]
    assert np.abs(broken) == pytest.approx([peak], rel=0.15)


def calibration(fit):
    return FrictionCalibration(fit, "tread", "cad", "2027-01-15T08:00:00Z", True)


def test_a_calibration_round_trips_bit_for_bit(fit):
    before = calibration(fit)
    after = friction_from_toml(friction_to_toml(before, CONSTANTS), "friction.toml")
    assert after.fit.rows == before.fit.rows
    for name in MotorFriction.__slots__:
        pair = [getattr(c.fit.friction, name) for c in (before, after)]
        assert (pair[0] == pair[1]).all()
    names = ("foot", "gravity", "measured_utc", "is_simulated")
    assert [getattr(after, n) for n in names] == [getattr(before, n) for n in names]


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("is_simulated = true", "is_simulated = 1"),
        ("foot =", "hand ="),
        ("[motors]", "[other]"),
        ("breakaway = [1", "breakaway = [-1"),
    ],
)
def test_a_file_that_is_not_a_calibration_is_refused_by_name(fit, old, new):
    text = friction_to_toml(calibration(fit), CONSTANTS)
    broken = text.replace(old, new) if old != "breakaway = [1" else _worse(text)
    assert broken != text
    with pytest.raises(SettingsError, match=r"friction\.toml"):
        friction_from_toml(broken, "friction.toml")


def _worse(text):
    head, motors = text.split("[motors]")
    return head + "[motors]" + motors.replace("breakaway = [1", "breakaway = [-1")


def test_truth_and_calibration_list_the_same_joint_parameters(fit):
    import tomllib

    load_at = fit.friction.load_at
    true = tomllib.loads(truth_to_toml(truth(), load_at, CONSTANTS))
    found = tomllib.loads(friction_to_toml(calibration(fit), CONSTANTS))
    wanted = at_load(truth(), load_at)
    assert true["coulomb"] == pytest.approx(joint_coulomb(CONSTANTS, wanted.coulomb))
    assert found["coulomb"] == pytest.approx(true["coulomb"], rel=0.02)
    assert true["asymmetry"] == pytest.approx(
        joint_asymmetry(CONSTANTS, truth().asymmetry)
    )
    assert true["motors"]["load_at"] == pytest.approx(load_at)
