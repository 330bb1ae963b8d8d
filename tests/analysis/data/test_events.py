import numpy as np
import pytest

from analysis.data.events import find_slips
from analysis.data.prepare import PrepareOptions, Smoothed, prepare_trial

DT = 0.002


def pulse(t, centre, width, height):
    shape = np.cos(np.pi * (t - centre) / width)
    return np.where(np.abs(t - centre) < width / 2, height * shape, 0.0)


def record(height=0.25, bounce=-0.05, sag=False):
    """One slip at 2 s: a ramp to 10 N, a drop to 1 N, a spike of 5 N at the catch."""
    t = np.arange(0.0, 4.0, DT)
    v = pulse(t, 2.2, 0.4, height) + pulse(t, 2.45, 0.1, bounce)
    F_t = np.interp(t, [0.0, 1.98, 2.0, 2.38, 2.40, 2.46, 4.0], [0, 10, 1, 1, 5, 5, 5])
    if sag:
        F_t = np.where((t > 1.90) & (t < 1.985), 8.0, F_t)
    return Smoothed(t=t, v_t=v, F_n=np.full(t.size, 4.0), F_t=F_t)


def test_a_slip_begins_and_ends_at_the_edge_speed():
    (slip,) = find_slips(record())
    # the half cosine is 0.03 at 0.4/pi acos(0.12) from its centre
    half = 0.4 / np.pi * np.arccos(0.03 / 0.25)
    assert slip.onset == pytest.approx(2.2 - half, abs=DT)
    assert slip.end == pytest.approx(2.2 + half, abs=DT)
    assert slip.peak_speed == pytest.approx(0.25, abs=1e-4)


def test_length_is_the_distance_between_onset_and_end():
    (slip,) = find_slips(record())
    # whole pulse 2/pi 0.4 0.25 m, of which the ends below 0.03 m/s are under 1 %
    assert slip.length == pytest.approx(0.2 / np.pi, rel=0.01)


@pytest.mark.parametrize(("height", "count"), [(0.119, 0), (0.121, 1)])
def test_only_motion_above_the_slip_speed_is_a_slip(height, count):
    assert len(find_slips(record(height=height))) == count


def test_peak_and_floor_are_the_forces_before_and_during():
    (slip,) = find_slips(record())
    assert slip.peak == pytest.approx(10.0, abs=0.1)
    assert slip.floor == pytest.approx(1.0, abs=0.01)


def test_bounce_back_has_its_lowest_speed_and_its_spike():
    (slip,) = find_slips(record())
    assert slip.has_bounce
    assert slip.bounce_speed == pytest.approx(-0.05, abs=1e-3)
    assert slip.spike == pytest.approx(4.0, abs=0.05)


def test_slow_backward_motion_is_not_a_bounce():
    (slip,) = find_slips(record(bounce=-0.0099))
    assert not slip.has_bounce
    assert slip.spike is None


def test_sag_is_force_lost_before_the_drop():
    assert find_slips(record(sag=True))[0].has_sag
    assert not find_slips(record(sag=False))[0].has_sag


def test_a_dip_that_stays_above_the_edge_speed_does_not_end_a_slip():
    trial = record()
    v = np.maximum(trial.v_t, np.where((trial.t > 2.3) & (trial.t < 2.6), 0.031, -9.0))
    v += pulse(trial.t, 2.6, 0.3, 0.2)
    one = Smoothed(t=trial.t, v_t=v, F_n=trial.F_n, F_t=trial.F_t)
    assert len(find_slips(one)) == 1


def test_a_slip_cut_off_by_the_end_of_the_record_is_still_described():
    trial = record()
    cut = trial.t < 2.2
    (slip,) = find_slips(
        Smoothed(trial.t[cut], trial.v_t[cut], trial.F_n[cut], trial.F_t[cut])
    )
    assert slip.end == pytest.approx(2.198)
    assert not slip.has_bounce


@pytest.mark.parametrize(
    ("key", "slips"),
    [
        ("S0/00", 5),
        ("S0/02", 4),
        ("S0/08", 6),
        ("B0/02", 5),
        ("B0/04", 4),
        ("B0/05", 3),
        ("TF/05", 0),
        ("TF/07", 0),
        ("TF/08", 0),
    ],
)
def test_slips_agree_with_an_independent_analysis(slice_trials, key, slips):
    (series,) = [s for s in slice_trials[key[:2]] if s.name.endswith(key)]
    assert len(find_slips(prepare_trial(series, PrepareOptions()).smooth)) == slips
