import sys

import numpy as np
import pytest

from ft_sensor.serial_line.clock_fit import ClockFit

S = 1_000_000_000
PERIOD = 1_250_000  # ns, 800 Hz


def late(rng, count, worst_ns):
    """Return one-sided delays: most are short, some wait for a busy machine."""
    return rng.uniform(0.0, 1.0, count) ** 2 * worst_ns


def errors(ppm, worst_ns, seconds=20, lost=0.0, seed=1):
    """Return the error of every fitted time after two seconds [ns]."""
    rng = np.random.default_rng(seed)
    count = int(seconds * S / PERIOD)
    true_ns = 5 * S + PERIOD * np.arange(count)
    device_ns = ((true_ns - 5 * S) * (1 + ppm * 1e-6)).astype(np.int64) + 123
    arrival_ns = (true_ns + late(rng, count, worst_ns)).astype(np.int64)
    fit, found = ClockFit(), []
    for k in np.flatnonzero(rng.uniform(size=count) >= lost):
        fit.offer(int(device_ns[k]), int(arrival_ns[k]))
        if true_ns[k] > 7 * S:
            found.append(fit.host_ns(int(device_ns[k])) - int(true_ns[k]))
    return np.array(found)


@pytest.mark.parametrize("ppm", [0.0, 50.0, -50.0, 200.0])
@pytest.mark.parametrize("worst_ns", [500_000, 8_000_000])
def test_a_device_time_is_mapped_accurately(ppm, worst_ns):
    found = errors(ppm, worst_ns)
    assert np.abs(found).max() < 100_000


def test_lost_messages_do_not_bias_the_fit():
    assert np.abs(errors(50.0, 4_000_000, lost=0.5)).max() < 100_000


def test_a_burst_of_delayed_messages_does_not_bias_the_fit():
    rng = np.random.default_rng(2)
    fit = ClockFit()
    worst = 0
    for k in range(8000):
        t = k * PERIOD
        stalled = 4 * S <= t < 4.5 * S
        arrival = int(4.5 * S) if stalled else t + int(late(rng, 1, 400_000)[0])
        fit.offer(t, arrival)
        if t > 2 * S:
            worst = max(worst, abs(fit.host_ns(t) - t))
    assert worst < 100_000


def test_before_the_first_fit_the_smallest_delay_counts():
    fit = ClockFit()
    for k, delay in enumerate([900_000, 50_000, 700_000]):
        fit.offer(k * PERIOD, k * PERIOD + delay)
    assert fit.host_ns(2 * PERIOD) == 2 * PERIOD + 50_000


def test_a_restarted_clock_is_fitted_again():
    fit = ClockFit()
    for k in range(2000):
        fit.offer(k * PERIOD, k * PERIOD + 7 * S)
    fit.restart()
    fit.offer(10, 30 * S)
    assert fit.host_ns(10 + PERIOD) == 30 * S + PERIOD


def test_clock_drift_is_bounded_by_crystal_tolerance():
    fit = ClockFit()
    for k in range(4000):
        fit.offer(k * PERIOD, k * PERIOD + k * PERIOD // 100)  # one per cent
    ahead = fit.host_ns(5 * S + S) - fit.host_ns(5 * S)
    assert abs(ahead - S) <= 500_001


@pytest.mark.slow
def test_memory_does_not_grow_with_duration():
    fit = ClockFit()
    for k in range(86_400 // 10):  # a message every 10 s shows the arithmetic
        t = 10 * k * S
        fit.offer(t, t + 30_000 + (k * 7919) % 1_000_000)
    assert len(fit.least) == 32
    assert sys.getsizeof(fit.least) < 2000
    end = 86_400 * S
    assert abs(fit.host_ns(end) - end) < 700_000  # one message per window
