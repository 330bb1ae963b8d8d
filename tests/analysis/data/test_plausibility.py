"""Implausible trials are doubted, and the cause of each doubt is named."""

import tarfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from analysis.data.load import load_trial
from analysis.data.plausibility import doubt_summary, doubts_of, doubts_of_record
from analysis.data.prepare import PrepareOptions, prepare_trial
from analysis.data.series import TractionSeries
from analysis.data.tare_bracket import LARGEST_CHANGE, TareBracket

RECORDED = Path(__file__).parents[2] / "data" / "recorded" / "session-1.0.tar.xz"
TIME, SPEED, LOAD, ALONG = range(4)


def pushed(seconds=3.0):
    """Return t, v_t, F_n, F_t of a foot that sticks and slips, shape (n, 4)."""
    t = np.arange(0.0, seconds, 0.002)
    phase = np.sin(2 * np.pi * 1.5 * t)
    v_t = np.where(phase > 0.0, 0.1 * phase, -0.002)
    F_n = 5.0 + 2.0 * np.sin(2 * np.pi * 0.7 * t)
    F_t = np.where(phase > 0.0, 0.8 * F_n, 0.3 * F_n)
    return np.column_stack([t, v_t, F_n, F_t])


def names(table):
    series = TractionSeries("S0", "T01", *table.T)
    return {doubt.name for doubt in doubts_of(prepare_trial(series, PrepareOptions()))}


def times(column, factor):
    def disturb(table):
        table[:, column] *= factor
        return table

    return disturb


def test_a_normal_push_raises_no_doubt():
    assert names(pushed()) == set()


def test_a_foot_that_never_moves_is_not_judged():
    table = pushed()
    table[:, SPEED] = 0.0
    assert names(table) == set()


def test_a_foot_that_is_carried_through_the_air_is_not_judged():
    table = pushed()
    table[:, LOAD] = -0.1
    assert names(table) == set()


@pytest.mark.parametrize(
    ("disturb", "expected"),
    [
        (times(ALONG, -1), {"power", "ratio"}),
        (times(LOAD, -1), {"normal"}),
        (times(SPEED, -1), {"direction", "power", "ratio"}),
        (times(SPEED, 1e3), {"unit"}),
        (times(TIME, 1e3), {"unit"}),
        (times(LOAD, 1e3), {"unit"}),
        (times(LOAD, 1e-3), {"unit"}),
        (times(ALONG, 1e3), {"friction"}),
        (times(ALONG, 0.1), {"friction"}),
    ],
    ids=[
        *("sign of F_t", "sign of F_n", "heading by 180 degrees"),
        *("mm/s", "ms", "mN", "kN", "F_t in mN", "friction of ice"),
    ],
)
def test_a_disturbed_table_is_doubted_for_its_disturbance(disturb, expected):
    assert names(disturb(pushed())) == expected


def test_a_suspicious_unit_is_reported_with_the_remedy():
    series = TractionSeries("S0", "T01", *times(SPEED, 1e3)(pushed()).T)
    (doubt,) = doubts_of(prepare_trial(series, PrepareOptions()))
    assert doubt.remedy.startswith("--unit v_t=mm/s if its table states none")


def test_doubts_of_one_kind_share_one_line():
    series = TractionSeries("S0", "T01", *times(ALONG, 1e3)(pushed()).T)
    doubts = doubts_of(prepare_trial(series, PrepareOptions()))
    (line,) = doubt_summary([("T01", doubts), ("T02", doubts)])
    assert line.startswith("T01, T02: ")


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    """Return a trial of the recorded session."""
    folder = tmp_path_factory.mktemp("recorded")
    with tarfile.open(RECORDED) as archive:
        archive.extractall(folder, filter="data")
    path = min(p for p in folder.rglob("trials/T*.mcap") if "truth" not in p.name)
    return load_trial(path)


def kinds(recorded):
    return {doubt.name for doubt in doubts_of_record(recorded)}


def turned(recorded, degrees):
    """Return the trial as recorded by a sensor that is turned about z."""
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    v_t, F_t, F_n = recorded.traction.T
    along, across = c * F_t - s * recorded.lateral, s * F_t + c * recorded.lateral
    return replace(
        recorded, traction=np.column_stack([v_t, along, F_n]), lateral=across
    )


def test_a_recorded_trial_raises_no_doubt(recorded):
    prepared = prepare_trial(recorded.series(), PrepareOptions())
    assert kinds(recorded) == set()
    assert doubts_of(prepared) == []


def test_a_sensor_turned_sideways_shows_more_force_across_than_along(recorded):
    assert kinds(turned(recorded, 90)) == {"lateral"}


def test_a_reversed_sensor_shows_a_ground_that_drives_the_foot(recorded):
    half = turned(recorded, 180)
    prepared = prepare_trial(half.series(), PrepareOptions())
    assert {doubt.name for doubt in doubts_of(prepared)} == {"power", "ratio"}


@pytest.mark.parametrize("axis", range(6))
def test_a_frozen_channel_is_doubted_by_name(recorded, axis):
    cycles = recorded.cycles.copy()
    cycles["wrench_raw"][500:, axis] = cycles["wrench_raw"][500, axis]
    found = {d.name: d for d in doubts_of_record(replace(recorded, cycles=cycles))}
    name = ("Fx", "Fy", "Fz", "Tx", "Ty", "Tz")[axis]
    assert found["frozen"].seen.startswith(f"{name} stands at ")


def test_a_sample_repeated_over_cycles_is_not_a_frozen_channel(recorded):
    """A sensor that is slower than the loop, or lost for a while, is not frozen."""
    cycles = recorded.cycles.copy()
    held = slice(600, 1000)
    for field in ("wrench_raw", "ft_ns"):
        cycles[field][held] = cycles[field][600]
    assert "frozen" not in kinds(replace(recorded, cycles=cycles))


def test_an_unloaded_foot_with_a_frozen_channel_is_doubted(recorded):
    """Without normal force no other doubt is raised."""
    cycles = recorded.cycles.copy()
    cycles["wrench_raw"][:, 2] = cycles["wrench_raw"][0, 2]
    unloaded = recorded.traction * np.array([1.0, 1.0, 0.0])
    found = replace(recorded, cycles=cycles, traction=unloaded)
    assert kinds(found) == {"frozen"}


@pytest.mark.parametrize(("share", "is_doubted"), [(0.99, False), (1.01, True)])
def test_a_zero_that_moved_around_a_trial_is_doubted(recorded, share, is_doubted):
    biases = np.zeros((2, 6))
    biases[1, :2] = share * LARGEST_CHANGE / np.sqrt(2.0)
    about = replace(recorded, bracket=TareBracket((-2.0, 8.0), biases))
    assert ("zero" in kinds(about)) is is_doubted


def test_swapped_moment_axes_contradict_the_force(recorded):
    cycles = recorded.cycles.copy()
    raw = cycles["wrench_raw"]
    raw[:, [3, 4]] = raw[:, [4, 3]]
    swapped = replace(recorded, cycles=cycles)
    assert kinds(swapped) == {"moment", "pressure"}
