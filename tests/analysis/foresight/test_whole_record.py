"""A whole record at once against the loop's own filters: the same bits."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from analysis.foresight.engine import EVERY
from analysis.foresight.signals import FEATURES, Signals
from analysis.foresight.whole_record import FootRecord, ticks_of_record
from tests.analysis.foresight.made import PLATE, STONES, trial


def by_samples(record):
    """Return (tick, host_ns, features, motion) as the loop finds them."""
    rows, signals, last = [], None, None
    for sample in record.samples:
        if not np.isfinite([sample.x, sample.F_t, sample.F_n]).all():
            continue
        if signals is None or sample.cycle != last + 1:
            signals = Signals(sample.x, sample.F_t, sample.F_n)
        else:
            signals.push(sample.x, sample.F_t, sample.F_n)
        last = sample.cycle
        if sample.cycle % EVERY == 0 and signals.is_warm:
            motion = (signals.v_t, signals.F_t, signals.F_n)
            number = sample.cycle // EVERY
            rows.append((number, sample.host_ns, signals.features(), motion))
    return rows


def assert_same_bits(record):
    found, wanted = ticks_of_record(record), by_samples(record)
    assert found.tick.tolist() == [row[0] for row in wanted]
    assert found.host_ns.tolist() == [row[1] for row in wanted]
    features = np.array([row[2] for row in wanted]).reshape(-1, len(FEATURES))
    assert found.features.tobytes() == features.tobytes()
    motion = np.array([row[3] for row in wanted], dtype=np.float64).reshape(-1, 3)
    assert found.motion.tobytes() == motion.tobytes()


def made(seed, count, scale=1.0):
    """Return a foot that stands, creeps and slips, its forces with noise."""
    random = np.random.default_rng(seed)
    speed = np.repeat(random.choice([0.0, 0.004, 0.05, 0.4], count // 60 + 1), 60)
    x = np.cumsum(speed[:count] * 0.002) + 1e-5 * random.normal(size=count)
    F_t, F_n = scale * np.cumsum(random.normal(0.0, 0.3, (2, count)), axis=1)
    cycle = np.arange(count) + int(random.integers(5))
    return FootRecord(cycle, 10**18 + cycle * 2_000_000, x, F_t, F_n)


@pytest.mark.parametrize("terrain", [STONES, PLATE])
def test_pushes_give_the_bits_of_the_loop(terrain):
    record = trial(terrain, 50).record
    assert_same_bits(record)
    ticks = ticks_of_record(record)
    assert ticks.features.tobytes() == trial(terrain, 50).features.tobytes()


@settings(max_examples=25, deadline=None)
@given(
    seed=st.integers(0, 1000),
    count=st.integers(1, 700),
    scale=st.sampled_from([0.0, 1.0, 1e6]),
    lost=st.lists(st.integers(0, 699), max_size=4),
    unknown=st.lists(st.integers(0, 699), max_size=4),
)
def test_records_with_gaps_and_missing_values_give_the_bits_of_the_loop(
    seed, count, scale, lost, unknown
):
    record = made(seed, count, scale)
    for row in unknown:
        record.F_t[row % count] = np.nan
    kept = np.setdiff1d(np.arange(count), np.array(lost, dtype=int))
    columns = (record.cycle, record.host_ns, record.x, record.F_t, record.F_n)
    assert_same_bits(FootRecord(*(column[kept] for column in columns)))


def test_a_record_that_slips_has_its_slips_in_the_features():
    found = ticks_of_record(made(3, 5000))
    largest = found.features[
        :, FEATURES.index("F_t over its largest since the last slip")
    ]
    waited = found.features[:, FEATURES.index("log time since the last slip")]
    assert np.unique(waited).size > 50
    assert np.unique(largest).size > 50


def test_a_record_of_nothing_has_no_ticks():
    nothing = np.zeros(0, dtype=np.intp)
    empty = np.zeros(0)
    assert ticks_of_record(FootRecord(nothing, nothing, *[empty] * 3)).tick.size == 0
