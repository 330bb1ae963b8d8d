from itertools import pairwise

from ft_sensor.reading import Reading, StreamTiming
from ft_sensor.serial_line.timestamps import SampleTimestamper

MS = 1_000_000
SHOWN = StreamTiming(1.25 * MS, 802_951, 1 << 32, 1000.0, 50 * MS, 37)


def reading(ticks, force):
    return Reading(ticks, (force, 0.0, 0.0, 0.0, 0.0, 0.0), 0, True, 0)


def test_non_finite_numbers_are_invalid():
    timestamper = SampleTimestamper(SHOWN)
    frame = reading(5, float("nan"))
    (sample,) = timestamper.date([frame], 10 * MS)
    assert not sample.is_valid


def test_time_stamps_increase_despite_a_late_batch():
    timestamper = SampleTimestamper(SHOWN)
    frames = [reading(1250 * k, k) for k in range(4)]
    found = timestamper.date(frames[:1], 100 * MS)
    found += timestamper.date(frames[1:], 101 * MS)
    assert all(before.t_ns < after.t_ns for before, after in pairwise(found))


def test_a_wrap_within_a_run_loses_no_sample():
    timestamper = SampleTimestamper(SHOWN)
    frames = [reading((2**32 - 2500 + 1250 * k) % 2**32, k) for k in range(5)]
    found = timestamper.date(frames, 100 * MS)
    assert all(sample.is_valid for sample in found)
    assert timestamper.lost == 0
    assert found[-1].t_ns - found[0].t_ns == 4 * 1_250_000
