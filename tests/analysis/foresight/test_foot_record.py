"""The filters of the loop over whole records: gaps, missing values, slips."""

import numpy as np
import pytest

from analysis.foresight.engine import EVERY
from analysis.foresight.foot_record import FootRecord, ticks_of_record
from analysis.foresight.signals import FEATURES, MEMORY


def made(seed, count):
    """Return a foot that stands, creeps and slips, its forces with noise."""
    random = np.random.default_rng(seed)
    speed = np.repeat(random.choice([0.0, 0.004, 0.05, 0.4], count // 60 + 1), 60)
    x = np.cumsum(speed[:count] * 0.002) + 1e-5 * random.normal(size=count)
    F_t, F_n = np.cumsum(random.normal(0.0, 0.3, (2, count)), axis=1)
    cycle = np.arange(count)
    return FootRecord(cycle, 10**18 + cycle * 2_000_000, x, F_t, F_n)


def part(record, rows):
    """Return some rows of a record."""
    return FootRecord(
        record.cycle[rows],
        record.host_ns[rows],
        record.x[rows],
        record.F_t[rows],
        record.F_n[rows],
    )


def test_ticks_have_the_number_and_the_time_of_their_cycle():
    record = made(1, 300)
    ticks = ticks_of_record(record)
    assert ticks.tick.tolist() == list(range(MEMORY // EVERY, 60))
    assert ticks.host_ns.tolist() == record.host_ns[ticks.tick * EVERY].tolist()


@pytest.mark.parametrize("is_missing", [True, False])
def test_a_missing_cycle_or_force_restarts_the_filters(is_missing):
    record, at = made(2, 700), 350
    if is_missing:
        whole = ticks_of_record(part(record, np.arange(700) != at))
    else:
        record.F_t[at] = np.nan
        whole = ticks_of_record(record)
    parts = [part(record, slice(0, at)), part(record, slice(at + 1, 700))]
    found = [ticks_of_record(each) for each in parts]
    for name in ("tick", "host_ns", "features", "motion"):
        wanted = np.concatenate([getattr(each, name) for each in found])
        assert getattr(whole, name).tobytes() == wanted.tobytes()


def test_a_record_that_slips_has_its_slips_in_the_features():
    found = ticks_of_record(made(3, 5000))
    largest = FEATURES.index("F_t over its largest since the last slip")
    waited = FEATURES.index("log time since the last slip")
    assert np.unique(found.features[:, waited]).size > 50
    assert np.unique(found.features[:, largest]).size > 50


@pytest.mark.parametrize("count", [1, MEMORY])
def test_a_record_too_short_to_look_back_on_has_no_ticks(count):
    ticks = ticks_of_record(made(4, count))
    assert ticks.features.shape == (0, len(FEATURES))
    assert ticks.motion.shape == (0, 3)


def test_a_record_of_nothing_has_no_ticks():
    assert ticks_of_record(part(made(5, 60), slice(0, 0))).tick.size == 0
