from dataclasses import replace

import numpy as np
import pytest

from acquisition.devices import WrenchSample
from ft_sensor.tare import TareError, take_mean
from ft_sensor.weighing import (
    LARGEST_TURN,
    WeightCause,
    WeightChange,
    compare_weights,
    measured_weight,
    weight_change,
)
from tests.ft_sensor.test_payload import attitude, mounted

PERIOD_NS = 1_250_000


def measure(samples, spread_limit=0.5):
    return take_mean(samples, spread_limit)


def samples(forces, **changes):
    """800 Hz samples with `forces` in z, 2 N in x and 0.5 N m about x."""
    values = {"status": 0, "is_valid": True, "saturated": 0} | changes
    return [
        WrenchSample(
            t_ns=5_000_000_000 + k * PERIOD_NS,
            counter=k,
            wrench=(2.0, 0.0, float(fz), 0.5, 0.0, 0.0),
            **values,
        )
        for k, fz in enumerate(forces)
    ]


def noise(count, deviation=0.3):
    return np.random.default_rng(3).normal(4.0, deviation, count)


def test_tare_is_the_mean_of_the_samples():
    values = noise(1600)
    result = measure(samples(values))
    assert result.wrench == pytest.approx((2, 0, values.mean(), 0.5, 0, 0))
    assert result.t_ns == 5_000_000_000 + 1599 * PERIOD_NS


def test_white_noise_hardly_changes_the_window_means():
    # 160 samples a window: 0.3 N / sqrt(160) = 0.024 N each, ten of them.
    assert 0 < measure(samples(noise(1600))).spread < 0.12


def test_spread_is_between_the_extreme_window_means():
    steps = np.repeat([0.0, 0.1, -0.2, 0.05, 0.0], 160)
    assert measure(samples(steps)).spread == pytest.approx(0.3)


def test_the_last_window_counts_fully():
    steps = np.repeat([0.0, 0.0, 0.0, 0.0, 0.4], 160)
    assert measure(samples(steps)).spread == pytest.approx(0.4)


def test_a_touch_is_refused_with_its_spread():
    touch = np.repeat([0.0, 0.0, 3.2, 0.0, 0.0], 160)
    with pytest.raises(TareError) as refused:
        measure(samples(touch))
    assert str(refused.value) == (
        "Force varied 3.2 N during tare (0.2 s means, limit 0.5). "
        "Is the foot touching? [space] to try again."
    )


def test_the_spread_limit_is_configurable():
    steps = np.repeat([0.0, 0.0, 0.9, 0.0, 0.0], 160)
    assert measure(samples(steps), spread_limit=1.0).spread == pytest.approx(0.9)
    with pytest.raises(TareError, match=r"limit 0\.8"):
        measure(samples(steps), spread_limit=0.8)


def test_a_spread_at_the_limit_is_accepted():
    steps = np.repeat([0.0, 0.0, 0.5, 0.0, 0.0], 160)
    assert measure(samples(steps), spread_limit=0.5).spread == 0.5


def test_the_shortest_allowed_tare_is_accepted():
    second = samples(noise(800))
    assert measure(second).t_ns == second[-1].t_ns


@pytest.mark.parametrize("count", [0, 1, 2, 780, 799])
def test_a_shorter_tare_is_refused(count):
    with pytest.raises(TareError, match="too few"):
        measure(samples(noise(count)))


@pytest.mark.parametrize(("short_ns", "is_enough"), [(0, True), (1, False)])
def test_half_a_period_less_than_the_duration_is_accepted(short_ns, is_enough):
    """Twelve samples stand for 0.96 s, and 0.04 s of grace."""
    slow = [
        replace(sample, t_ns=k * 80_000_000)
        for k, sample in enumerate(samples([4.0] * 12))
    ]
    slow[-1] = replace(slow[-1], t_ns=slow[-1].t_ns - short_ns)
    if is_enough:
        assert take_mean(slow, 0.5, 12.5).t_ns == slow[-1].t_ns
        return
    with pytest.raises(TareError, match=r"12 F/T samples over 0\.96 s are too few"):
        take_mean(slow, 0.5, 12.5)


def test_a_tare_with_jittering_arrivals_is_accepted():
    jittered = samples(noise(800))
    jittered[0] = replace(jittered[0], t_ns=jittered[0].t_ns + 500_000)
    assert measure(jittered).t_ns == jittered[-1].t_ns


def test_a_touch_at_the_very_end_is_refused():
    # 80 of the 240 samples of the last window: a mean of 1 N.
    with pytest.raises(TareError, match=r"varied 1\.0 N"):
        measure(samples([*[0.0] * 800, *[3.0] * 80]))


def test_a_gap_is_refused():
    gapped = samples(noise(1600))
    with pytest.raises(TareError, match=r"Only \d+ F/T samples in one"):
        measure(gapped[:500] + gapped[780:])


@pytest.mark.parametrize("flag", [{"is_valid": False}, {"saturated": 4}, {"status": 1}])
def test_a_flagged_sample_is_refused(flag):
    good = samples(noise(1600))
    bad = samples(noise(1600), **flag)[700:701]
    with pytest.raises(TareError, match="1 of 1600"):
        measure(good[:700] + bad + good[701:])


def test_a_non_finite_sample_is_refused():
    with pytest.raises(TareError, match="non-finite"):
        measure(samples([*noise(1599), float("nan")]))


def test_too_few_samples_in_a_window_are_refused():
    far = [replace(sample, t_ns=k * 10**9) for k, sample in enumerate(samples([4, 4]))]
    with pytest.raises(TareError, match="Only 0"):
        measure(far)


def test_a_refused_tare_is_a_failed_preflight():
    assert TareError("x", hint="").exit_code == 3


@pytest.mark.parametrize(("rate", "is_enough"), [(250, True), (245, False)])
def test_half_of_the_nominal_samples_are_enough(rate, is_enough):
    slow = [
        replace(sample, t_ns=round(k * 1e9 / rate))
        for k, sample in enumerate(samples(noise(2 * rate)))
    ]
    if is_enough:
        assert measure(slow).t_ns == slow[-1].t_ns
        return
    with pytest.raises(TareError, match="Only"):
        measure(slow)


def test_the_spread_is_of_the_force_and_not_of_the_moment():
    turned = [
        replace(sample, wrench=(*sample.wrench[:3], float(k // 400), 0.0, 0.0))
        for k, sample in enumerate(samples([4.0] * 1600))
    ]
    assert measure(turned).spread == 0.0


@pytest.mark.parametrize("axis", range(3))
def test_all_force_components_have_the_same_limit(axis):
    steps = np.repeat([0.0, 0.6, 0.0, 0.0, 0.0], 160)
    moved = [
        replace(sample, wrench=(*np.eye(3)[axis] * step, 0.0, 0.0, 0.0))
        for sample, step in zip(samples(steps), steps, strict=True)
    ]
    with pytest.raises(TareError, match=r"varied 0\.6 N") as refused:
        measure(moved)
    assert refused.value.spread == pytest.approx(0.6)


@pytest.mark.parametrize(("nominal", "is_enough"), [(400, True), (401, False)])
def test_a_sensor_with_a_lower_nominal_rate_may_send_fewer_samples(nominal, is_enough):
    slow = [
        replace(sample, t_ns=k * 5_000_000)
        for k, sample in enumerate(samples(noise(400)))
    ]
    if is_enough:
        assert take_mean(slow, 0.5, nominal).t_ns == slow[-1].t_ns
        return
    with pytest.raises(TareError, match="Only 40 F/T samples in one"):
        take_mean(slow, 0.5, nominal)


POSES = (attitude(0.1, 0.2, 0.3), attitude(0.1, -1.0, 0.3))


def change_of(tool, seen_with):
    """Compare readings of `seen_with` in two poses with those expected of `tool`."""
    readings = [seen_with.sign * seen_with.weight(R) + 7.0 for R in POSES]
    return weight_change(mounted(tool), POSES, readings)


def test_a_correctly_mounted_sensor_sees_the_weight_rotate(example_tool):
    assert change_of(example_tool, mounted(example_tool)).error < 1e-9


@pytest.mark.parametrize("degrees", [-90.0, -20.0, 20.0, 90.0, 179.0])
def test_a_turned_sensor_is_detected_with_its_angle(example_tool, degrees):
    change = change_of(example_tool, mounted(example_tool, angle=np.radians(degrees)))
    assert change.error > 1.0
    assert np.degrees(change.turned) == pytest.approx(degrees)


def test_an_inverted_sign_is_detected(example_tool):
    change = change_of(example_tool, mounted(example_tool, sign=-1.0))
    assert change.error > 5.0
    assert (change.cause, change.is_turned) == (WeightCause.SIGN, False)


@pytest.mark.parametrize("degrees", [-20.0, 20.0, 90.0])
def test_a_turn_is_not_mistaken_for_mass_or_sign(example_tool, degrees):
    change = change_of(example_tool, mounted(example_tool, angle=np.radians(degrees)))
    assert (change.cause, change.is_turned) == (WeightCause.TURNED, True)


def test_a_small_turn_is_within_tolerance(example_tool):
    turned = mounted(example_tool, angle=0.7 * LARGEST_TURN)
    assert not change_of(example_tool, turned).is_turned


def test_a_light_foot_also_reveals_a_turned_sensor(example_tool):
    """Its error is below the limit of 1 N for heavier feet."""
    foot = replace(example_tool.foot, mass=0.2)
    light = replace(example_tool, foot=foot)
    change = change_of(light, mounted(light, angle=np.radians(20.0)))
    assert change.error < 1.0
    assert change.is_turned


def test_a_turn_is_visible_by_the_weight_across_the_axis():
    turned = np.radians(20.0)
    for across, is_clear in ((0.8, False), (0.95, True)):
        expected = np.array([[across, 0.0, 9.0]])
        seen = across * np.array([[np.cos(turned), -np.sin(turned), 9.0 / across]])
        change = compare_weights(expected, seen)
        assert change.across == pytest.approx(across)
        assert change.turned == pytest.approx(turned)
        assert change.is_turned is is_clear


@pytest.mark.parametrize(
    "expected",
    [(9.0, 0, 0), (0, 9.0, 0), (3.0, 0, 9.0), (0, 3.0, 9.0), (5.0, 6.0, 7.0)],
)
@pytest.mark.parametrize("degrees", [-15.0, 15.0])
def test_a_rotation_about_z_is_a_turn_in_any_direction(expected, degrees):
    """And no component of the force is left unexplained."""
    x, y, z = expected
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    seen = np.array([[c * x + s * y, c * y - s * x, z]])
    change = compare_weights(np.array([expected], dtype=float), seen)
    assert np.degrees(change.turned) == pytest.approx(degrees)
    assert (change.cause, change.is_turned) == (WeightCause.TURNED, True)


@pytest.mark.parametrize(("share", "is_turned"), [(0.99, False), (1.01, True)])
@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_a_turn_beyond_that_of_a_sound_sensor_is_reported(side, share, is_turned):
    turn = side * share * LARGEST_TURN
    seen = 9.0 * np.array([[np.cos(turn), -np.sin(turn), 0.0]])
    change = compare_weights(np.array([[9.0, 0.0, 0.0]]), seen)
    assert change.turned == pytest.approx(turn)
    assert change.is_turned == is_turned


@pytest.mark.parametrize(
    ("more", "cause"), [(1.66, WeightCause.UNKNOWN), (1.80, WeightCause.MASS)]
)
def test_a_hypothesis_leaving_most_of_the_error_explains_nothing(more, cause):
    """1 N across the axis that no other mass of a foot above the sensor makes."""
    change = compare_weights(np.array([[0, 0, 9.0]]), np.array([[1.0, 0, 9.0 + more]]))
    assert change.cause is cause
    assert change.error == pytest.approx(np.hypot(1.0, more))


def test_a_hypothesis_leaving_half_of_the_error_explains_it():
    """Twice the weight in three poses, and 1 N aside along four axes."""
    expected = np.array([[0, 0, 2.0]] * 3)
    seen = np.array([[1.0, 1.0, 4.0], [1.0, 1.0, 4.0], [0, 0, 4.0]])
    change = compare_weights(expected, seen)
    assert (change.scale, change.cause) == (2.0, WeightCause.MASS)


def test_a_turn_must_exceed_the_tolerance_and_be_significant():
    turned = WeightChange(9.0, float(LARGEST_TURN), 1.0, 9.0, WeightCause.TURNED)
    assert not turned.is_turned
    assert replace(turned, turned=-1.0001 * LARGEST_TURN).is_turned
    across = replace(turned, turned=np.pi / 2, across=0.3)
    assert not across.is_turned
    assert replace(across, across=0.3001).is_turned


def test_a_nearly_weightless_foot_is_reported_with_its_mass():
    change = compare_weights(np.array([[0, 0, 0.5]]), np.array([[0, 0, 0.75]]))
    assert change.scale == pytest.approx(1.5)
    assert change.cause is WeightCause.MASS


def test_a_zero_reading_indicates_no_mass_rather_than_an_inverted_sign():
    change = compare_weights(np.array([[1.0, 2.0, 3.0]]), np.zeros((1, 3)))
    assert (change.scale, change.cause) == (0.0, WeightCause.MASS)


def test_without_an_expected_weight_no_mass_is_reported():
    change = compare_weights(np.zeros((1, 3)), np.array([[1.0, 2.0, -3.0]]))
    assert (change.scale, change.across) == (1.0, 0.0)
    assert (change.cause, change.is_turned) == (WeightCause.UNKNOWN, False)


def test_the_worst_of_several_poses_counts():
    expected = np.array([[3.0, 4.0, 9.0], [6.0, 8.0, 2.0], [0.0, 1.0, 5.0]])
    off = np.array([[0.0, 0.1, 0.0], [0.2, -0.3, 0.6], [0.0, 0.0, -0.5]])
    change = compare_weights(expected, expected + off)
    assert change.error == pytest.approx(0.7)
    assert change.across == pytest.approx(10.0)


@pytest.mark.parametrize("scale", [0.5, 1.5])
def test_a_wrong_mass_is_identified(example_tool, scale):
    foot = replace(example_tool.foot, mass=scale * example_tool.foot.mass)
    change = change_of(example_tool, mounted(replace(example_tool, foot=foot)))
    assert change.cause is WeightCause.MASS
    assert change.scale == pytest.approx(scale)


def test_a_touch_is_not_a_mounting_error(example_tool):
    payload = mounted(example_tool)
    readings = [payload.sign * payload.weight(R) for R in POSES]
    readings[1][:3] += np.cross(readings[1][:3] - readings[0][:3], [0.0, 0.0, 0.4])
    readings[1][:3] += [1.0, -2.0, 3.0]
    assert weight_change(payload, POSES, readings).cause is WeightCause.UNKNOWN


def test_a_single_tare_distinguishes_sign_from_mass(example_tool):
    payload, pose = mounted(example_tool), POSES[1]
    known = np.full(6, 0.7)
    for factor, cause in ((-1.0, WeightCause.SIGN), (1.4, WeightCause.MASS)):
        reading = known + factor * payload.sign * payload.weight(pose)
        change = measured_weight(payload.tared(reading, pose), pose, known)
        assert change.cause is cause
        assert change.scale == pytest.approx(factor)
