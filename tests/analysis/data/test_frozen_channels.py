"""Frozen channels among changing ones are reported, coarse ones are not."""

import numpy as np
import pytest

from analysis.data.frozen_channels import frozen_channels

RATE = 500.0


def sliding(seconds=6.0, resolution=0.02, noise=0.1, seed=0):
    """Return times and the wrench of a sliding foot, quantised to `resolution`."""
    rng = np.random.default_rng(seed)
    n = round(seconds * RATE)
    load = np.cumsum(rng.normal(scale=0.05, size=(n, 6)), axis=0)
    shown = load + rng.normal(scale=noise, size=(n, 6))
    if resolution:
        shown = np.round(shown / resolution) * resolution
    return np.arange(n) / RATE, shown


def axes(t, wrench):
    return [channel.axis for channel in frozen_channels(t, wrench)]


@pytest.mark.parametrize("resolution", [0.0, 0.02, 0.1, 0.5])
@pytest.mark.parametrize("noise", [0.02, 0.3])
def test_a_sound_sensor_has_no_frozen_channel(resolution, noise):
    for seed in range(20):
        assert axes(*sliding(resolution=resolution, noise=noise, seed=seed)) == []


@pytest.mark.parametrize("axis", range(6))
@pytest.mark.parametrize(("begin", "end"), [(0.0, 6.0), (2.0, 6.0), (2.0, 2.4)])
def test_a_frozen_channel_is_reported_with_value_and_time(axis, begin, end):
    t, wrench = sliding()
    still = (t >= begin) & (t < end)
    wrench[still, axis] = -3.25
    (channel,) = frozen_channels(t, wrench)
    assert channel.axis == axis
    assert channel.value == pytest.approx(-3.25)
    assert channel.seconds == pytest.approx(end - begin, abs=0.02)
    unit = "N" if axis < 3 else "N m"
    assert f" stands at -3.25 {unit} for {end - begin:.1f} s" in channel.text


def test_a_channel_stuck_within_one_bit_is_reported():
    t, wrench = sliding()
    wrench[1000:, 2] = 5.0 + 0.02 * (np.arange(len(t) - 1000) % 3 == 0)
    assert axes(t, wrench) == [2]


def test_a_saturated_channel_is_reported():
    t, wrench = sliding()
    wrench[:, 1] = np.minimum(wrench[:, 1], wrench[:, 1].min() + 0.1)
    assert axes(t, wrench) == [1]


def test_a_rarely_updated_channel_is_reported():
    t, wrench = sliding()
    wrench[:, 4] = np.repeat(wrench[::500, 4], 500)[: len(t)]
    assert axes(t, wrench) == [4]


def test_several_frozen_channels_are_reported_separately():
    t, wrench = sliding()
    wrench[500:, [0, 5]] = wrench[500, [0, 5]]
    assert axes(t, wrench) == [0, 5]


def test_a_gap_of_the_record_is_not_a_frozen_channel():
    t, wrench = sliding()
    left = np.ones(len(t), bool)
    left[1000:1400] = False
    assert axes(t[left], wrench[left]) == []


@pytest.mark.parametrize("count", [0, 1, 2, 5])
def test_a_few_samples_give_no_report(count):
    t, wrench = sliding()
    assert axes(t[:count], wrench[:count]) == []
