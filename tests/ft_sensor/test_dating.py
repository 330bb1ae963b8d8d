from itertools import pairwise

from ft_sensor.bota import BotaFrame
from ft_sensor.dating import FrameDating
from ft_sensor.sensor_settings import SensorSettings

MS = 1_000_000


def test_non_finite_numbers_are_invalid():
    dating = FrameDating(SensorSettings("/dev/sensor"))
    frame = BotaFrame(0, (0.0, float("nan"), 0.0, 0.0, 0.0, 0.0), 5, 25.0)
    (sample,) = dating.date([frame], 10 * MS)
    assert not sample.is_valid


def test_dates_rise_when_a_late_batch_reaches_back():
    dating = FrameDating(SensorSettings("/dev/sensor"))
    frames = [
        BotaFrame(0, (k, 0.0, 0.0, 0.0, 0.0, 0.0), 1250 * k, 25.0) for k in range(4)
    ]
    found = dating.date(frames[:1], 100 * MS)
    found += dating.date(frames[1:], 101 * MS)
    assert all(before.t_ns < after.t_ns for before, after in pairwise(found))


def test_a_jump_of_the_device_clock_does_not_move_the_dates():
    dating = FrameDating(SensorSettings("/dev/sensor"))
    frames = [
        BotaFrame(0, (k, 0.0, 0.0, 0.0, 0.0, 0.0), t_us, 25.0)
        for k, t_us in enumerate([1000, 2250, 2_000_000_000, 2_000_001_250])
    ]
    found = dating.date(frames, 100 * MS)
    assert found[-1].t_ns - found[0].t_ns == 2 * 1_250_000


def test_wrap_inside_a_run_loses_nothing():
    dating = FrameDating(SensorSettings("/dev/sensor"))
    frames = [
        BotaFrame(
            0, (k, 0.0, 0.0, 0.0, 0.0, 0.0), (2**32 - 2500 + 1250 * k) % 2**32, 25.0
        )
        for k in range(5)
    ]
    found = dating.date(frames, 100 * MS)
    assert all(sample.is_valid for sample in found)
    assert dating.lost == 0
    assert found[-1].t_ns - found[0].t_ns == 4 * 1_250_000
