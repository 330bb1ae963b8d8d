import numpy as np
import pytest

from fakes.sensor.errors import (
    FORCE_ERRORS,
    NO_SHIFT,
    ErrorScale,
    LoadErrors,
    SensorErrors,
)

MS, S = 1_000_000, 1_000_000_000
NOTHING = {"walk": 0.0, "drift": 0.0, "white": 0.0, "resolution": 0.0}
QUIET = ErrorScale(**NOTHING)
FREE = (0.0,) * 6


def make_errors(seed=0, **scale) -> SensorErrors:
    """Return a sensor with only the force errors of `scale`."""
    force = ErrorScale(**(NOTHING | scale))
    return SensorErrors(np.random.default_rng(seed), force, QUIET)


def errors_of(count: int, seed: int = 0, **scale) -> np.ndarray:
    """Return readings without load at 800 Hz, shape (count, 6)."""
    errors = make_errors(seed, **scale)
    return np.array([errors.apply(k * 1_250_000, FREE) for k in range(count)])


def test_white_noise_has_its_deviation():
    shown = errors_of(4000, white=0.3)
    # 12,000 values: 0.3 N to within 3 sigma = 3 * 0.3 / sqrt(24,000).
    assert shown[:, :3].std() == pytest.approx(0.3, abs=0.006)
    assert not shown[:, 3:].any()


def test_resolution_rounds_to_steps():
    shown = errors_of(500, white=0.3, resolution=0.02)[:, :3]
    steps = shown / 0.02
    assert np.abs(steps - np.round(steps)).max() < 1e-9


@pytest.mark.parametrize("gap_s", [0.3, 3.0, 30.0])
@pytest.mark.parametrize(("name", "time"), [("drift", 3.0), ("walk", 120.0)])
def test_a_zero_wanders_with_its_deviation_and_time_constant(name, time, gap_s):
    def around_gap(seed):
        errors = make_errors(seed, **{name: 1.0})
        shown = [errors.apply(k * MS, FREE)[:3] for k in range(3)]
        return shown[-1], errors.apply(2 * MS + int(gap_s * 1e9), FREE)[:3]

    before, after = np.hstack([around_gap(seed) for seed in range(400)])
    # 1200 paths: a correlation is known to within 1 / sqrt(1200) = 0.029, a
    # deviation to 0.021; warmth adds 0.3 x 0.15 N to the last axis, 0.1 % at most.
    assert before.std() == pytest.approx(1.0, abs=0.08)
    assert after.std() == pytest.approx(1.0, abs=0.08)
    expected = np.exp(-gap_s / time)
    assert np.corrcoef(before, after)[0, 1] == pytest.approx(expected, abs=0.08)


def test_drift_needs_time_to_pass():
    errors = make_errors(drift=0.22)
    first = errors.apply(5 * MS, FREE)
    assert errors.apply(5 * MS, FREE) == first
    assert errors.apply(6 * MS, FREE) != first


def test_the_same_generator_gives_the_same_sensor():
    def shown(seed):
        errors = SensorErrors(np.random.default_rng(seed))
        return [errors.apply(k * 10 * MS, (1.0,) * 6) for k in range(20)]

    assert shown(7) == shown(7)
    assert shown(7) != shown(8)


def test_a_new_generator_changes_only_future_errors():
    def path(seed):
        errors = make_errors(walk=0.2, drift=0.22)
        before = errors.apply(0, FREE)[0]
        errors.draw_from(np.random.default_rng(seed))
        errors.apply(MS, FREE)
        return before, errors.apply(2 * MS, FREE)[0], errors.apply(60 * S, FREE)[0]

    before, soon, late = path(1)
    # 2 ms of a drift of 0.22 N over 3 s are 0.008 N rms.
    assert soon == pytest.approx(before, abs=0.04)
    assert path(2)[2] != late


def test_a_tare_removes_the_present_reading():
    remains = []
    for seed in range(150):
        errors = make_errors(seed, walk=FORCE_ERRORS.walk, drift=FORCE_ERRORS.drift)
        tare = np.mean([errors.apply(k * 20 * MS, FREE)[:3] for k in range(50)], axis=0)
        remains.append(np.array(errors.apply(20 * S, FREE)[:3]) - tare)
    # The drift is independent of the tare: sqrt(0.22^2 + 0.21^2), and 0.06 of the walk.
    # 450 values: known to 3.3 %, here at 4 sigma.
    assert np.std(remains) == pytest.approx(0.31, rel=0.13)


def test_a_shifted_zero_stays_until_the_shift_ends():
    errors = make_errors()
    before = errors.apply(0, FREE)[0]
    errors.shift = (1.5, 0.0, 0.0, 0.0, 0.0, 0.0)
    # The shift appears within 10 ms.
    assert errors.apply(10 * MS, FREE)[0] == pytest.approx(before + 1.5, abs=0.01)
    assert errors.apply(S, FREE)[0] == pytest.approx(before + 1.5, abs=0.01)
    errors.shift = NO_SHIFT
    assert errors.apply(2 * S, FREE)[0] == pytest.approx(before, abs=0.01)


def load_errors(**scale) -> LoadErrors:
    scales = [ErrorScale(**(NOTHING | {"span": 100.0} | scale))] * 6
    return LoadErrors(scales, np.random.default_rng(3))


PRESSED = (0.0, 0.0, 10.0, 0.0, 0.0, 0.0)


def test_creep_delays_but_does_not_lose_a_load():
    errors = load_errors(creep=0.01)
    errors.update(0.0, FREE)
    assert errors.update(0.0, PRESSED)[2] == pytest.approx(-0.1)
    assert errors.update(20.0, PRESSED)[2] == pytest.approx(-0.1 * np.exp(-1.0))
    assert errors.update(200.0, PRESSED)[2] == pytest.approx(0.0, abs=1e-4)


def test_loading_and_unloading_differ_by_the_hysteresis():
    errors = load_errors(hysteresis=0.01)
    errors.update(0.0, FREE)
    loads = [(0.0, 0.0, load, 0.0, 0.0, 0.0) for load in (10.0, 20.0, 10.0)]
    going, _, coming = (errors.update(0.1, load)[2] for load in loads)
    # Both ways the reading lags by 1 % of 5 N, a twentieth of the span.
    assert (going, coming) == pytest.approx((-0.05, 0.05))


def test_crosstalk_is_proportional_and_off_diagonal():
    errors = load_errors(cross_talk=0.003)
    loads = np.outer((1.0, 2.0), PRESSED)
    once, twice = (np.array(errors.update(0.0, load)) for load in loads.tolist())
    assert once[2] == 0.0
    assert np.abs(once[:2]).max() > 0.001
    assert twice == pytest.approx(2 * once)


def test_nearly_all_tares_of_a_sound_sensor_pass_the_known_pose_check():
    shown = [SensorErrors(np.random.default_rng(k)).apply(0, FREE) for k in range(2000)]
    white = 3 * FORCE_ERRORS.white**2  # averages away in a tare
    sizes = np.sqrt(np.maximum((np.array(shown)[:, :3] ** 2).sum(axis=1) - white, 0.0))
    # 1 N, the limit, is four deviations of an axis: one tare in a thousand.
    assert np.quantile(sizes, 0.95) < 1.0
