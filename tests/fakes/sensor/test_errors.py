import numpy as np
import pytest

from fakes.sensor.errors import FORCE_ERRORS, ErrorScale, SensorErrors

MS = 1_000_000
QUIET = ErrorScale(bias=0.0, drift=0.0, white=0.0, resolution=0.0)


def errors_of(count: int, seed: int = 0, **scale) -> np.ndarray:
    """What is shown under no load, 800 Hz, shape (count, 6)."""
    force = ErrorScale(**({"bias": 0, "drift": 0, "white": 0, "resolution": 0} | scale))
    errors = SensorErrors(np.random.default_rng(seed), force, QUIET)
    return np.array([errors.apply(k * 1_250_000, (0.0,) * 6) for k in range(count)])


def test_white_noise_has_its_deviation():
    shown = errors_of(4000, white=0.3)
    # 12,000 values: 0.3 N to within 3 sigma = 3 * 0.3 / sqrt(24,000).
    assert shown[:, :3].std() == pytest.approx(0.3, abs=0.006)
    assert not shown[:, 3:].any()


def test_resolution_rounds_to_steps():
    shown = errors_of(500, white=0.3, resolution=0.02)[:, :3]
    steps = shown / 0.02
    assert np.abs(steps - np.round(steps)).max() < 1e-9


def test_drift_has_its_deviation_and_its_time():
    shown = np.hstack([errors_of(400, seed, drift=0.22)[:, :3] for seed in range(150)])
    # 450 paths: the deviation is known to 0.22 / sqrt(900) = 0.007 N.
    assert shown[0].std() == pytest.approx(0.22, abs=0.025)
    assert shown[-1].std() == pytest.approx(0.22, abs=0.025)
    passed = 399 * 1.25e-3
    correlation = np.corrcoef(shown[0], shown[-1])[0, 1]
    assert correlation == pytest.approx(np.exp(-passed / 3.0), abs=0.05)


def test_bias_is_constant_in_a_trial_and_new_in_the_next():
    force = ErrorScale(bias=0.24, drift=0.0, white=0.0, resolution=0.0)
    errors = SensorErrors(np.random.default_rng(0), force, force)
    first = errors.apply(0, (0.0,) * 6)
    assert errors.apply(MS, (0.0,) * 6) == first
    errors.new_trial(np.random.default_rng(1))
    assert errors.apply(2 * MS, (0.0,) * 6) != first


def test_a_trial_is_reproducible_from_its_generator():
    errors = SensorErrors(np.random.default_rng(0))

    def trial() -> list[tuple[float, ...]]:
        errors.new_trial(np.random.default_rng(7))
        return [errors.apply(k * MS, (1.0,) * 6) for k in range(20)]

    assert trial() == trial()


def test_drift_stands_still_when_no_time_passes():
    force = ErrorScale(bias=0.0, drift=0.22, white=0.0, resolution=0.0)
    errors = SensorErrors(np.random.default_rng(0), force, QUIET)
    first = errors.apply(5 * MS, (0.0,) * 6)
    assert errors.apply(5 * MS, (0.0,) * 6) == first
    assert errors.apply(6 * MS, (0.0,) * 6) != first


@pytest.mark.parametrize("gap_s", [0.3, 3.0])
def test_drift_over_a_gap_is_that_of_the_time_passed(gap_s):
    force = ErrorScale(bias=0.0, drift=1.0, white=0.0, resolution=0.0)

    def around_gap(seed):
        errors = SensorErrors(np.random.default_rng(seed), force, QUIET)
        shown = [errors.apply(k * MS, (0.0,) * 6)[:3] for k in range(3)]
        return shown[-1], errors.apply(2 * MS + int(gap_s * 1e9), (0.0,) * 6)[:3]

    before, after = np.hstack([around_gap(seed) for seed in range(400)])
    # 1200 paths: a correlation is known to better than 1 / sqrt(1200) = 0.029.
    assert np.corrcoef(before, after)[0, 1] == pytest.approx(
        np.exp(-gap_s / 3.0), abs=0.08
    )


def test_what_remains_after_a_tare_has_the_spread_of_bias_and_drift():
    force = ErrorScale(bias=0.24, drift=0.22, white=0.0, resolution=0.0)
    errors = SensorErrors(np.random.default_rng(0), force, QUIET)
    remains = []
    for trial in range(400):
        errors.settle()
        tare = np.array(errors.apply(trial * MS, (0.0,) * 6)[:3])
        errors.new_trial(np.random.default_rng(trial))
        remains.append(np.array(errors.apply(trial * MS, (0.0,) * 6)[:3]) - tare)
    # 1200 values: known to 2 %; a tare that saw the last trial's would show 0.46 N
    assert np.std(remains) == pytest.approx(np.hypot(0.24, 0.22), rel=0.08)


def test_a_settled_sensor_stands_still_but_for_its_noise():
    force = ErrorScale(bias=0.24, drift=0.22, white=0.0, resolution=0.0)
    errors = SensorErrors(np.random.default_rng(0), force, QUIET)
    errors.settle()
    shown = {errors.apply(k * 100 * MS, (0.0,) * 6) for k in range(20)}
    assert len(shown) == 1
    assert any(shown.pop())  # there is an offset for the tare to take away


def test_no_session_begins_with_an_offset_that_its_tares_would_be_refused_for():
    sizes = []
    for seed in range(2000):
        errors = SensorErrors(np.random.default_rng(seed))
        sizes.append(np.linalg.norm(errors.offset[:3]))
    assert max(sizes) == pytest.approx(3.5 * FORCE_ERRORS.bias)
    assert np.median(sizes) == pytest.approx(1.54 * FORCE_ERRORS.bias, rel=0.05)
