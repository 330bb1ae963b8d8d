"""Every wrist sensor fulfils one contract, those with a frame stream a second one."""

import contextlib
from itertools import pairwise

import numpy as np
import pytest

from acquisition.errors import DeviceFaultError, LinkError, LinkTimeoutError
from fakes.sensor.stream import ByteFault
from ft_sensor.reading import axis_names, largest_traction
from tests.ft_sensor.sensor_bench import LOAD, MAKES, MS, BusBench, SensorBench

KINDS = tuple(MAKES)
S = 1000 * MS
CHUNKS = (1, 7, 44, 4096)


@pytest.fixture(params=KINDS)
def kind(request):
    return request.param


@pytest.fixture(params=(*KINDS, "barrett"))
def any_bench(request):
    """Each of the five sensors, opened."""
    is_on_bus = request.param == "barrett"
    bench = BusBench() if is_on_bus else SensorBench(request.param)
    return bench.opened()


def test_every_sensor_shows_its_load_in_newtons_and_newton_metres(any_bench):
    mean = np.mean([sample.wrench for sample in any_bench.run(300 * MS)], axis=0)
    # Bias and drift at three sigma, and half a count of the coarsest sensor.
    assert (np.abs(mean - LOAD) < np.repeat([1.3, 0.06], 3)).all()


def test_every_sensor_gives_valid_samples_dated_before_now(any_bench):
    found = any_bench.run(100 * MS)
    newest = found[-1]
    assert newest.is_valid
    assert not newest.saturated
    assert 0 < any_bench.clock.now_ns() - newest.t_ns < 5 * MS
    assert all(before.t_ns < after.t_ns for before, after in pairwise(found))


def test_every_silent_sensor_gives_no_samples(any_bench):
    any_bench.run(20 * MS)
    any_bench.silence()
    any_bench.run(6 * MS)
    assert any_bench.run(40 * MS) == []


def test_every_sensor_reports_identity_and_sample_counters(any_bench):
    any_bench.run(20 * MS)
    facts = any_bench.sensor.describe()
    assert {"model", "serial_number", "firmware", "measured_rate", "time"} <= set(facts)
    assert min(map(float, facts["ranges"].split())) > 0
    fields = any_bench.sensor.stream_metadata()
    assert any(int(count) > 0 for count in fields.values())


def test_every_sensor_can_be_closed_twice(any_bench):
    any_bench.sensor.close()
    any_bench.sensor.close()
    # nothing is left over to be read
    with contextlib.suppress(LinkError):
        assert any_bench.sensor.poll(any_bench.clock.now_ns()) == []


@pytest.mark.parametrize("chunk", CHUNKS)
def test_the_load_is_decoded_in_chunks_of_any_size(kind, chunk):
    bench = SensorBench(kind, chunk=chunk).opened()
    found = bench.run(S)
    # One or two are on the wire at each end.
    assert len(found) == pytest.approx(bench.make.rate, abs=3)
    mean = np.mean([sample.wrench for sample in found], axis=0)
    # Bias and drift: 0.33 N and 0.014 N m rms; three times that, and a count.
    limit = np.repeat([1.0, 0.05], 3) + bench.make.resolution
    assert (np.abs(mean - LOAD) < limit).all()
    assert all(sample.is_valid and not sample.saturated for sample in found)
    assert bench.sensor.counters.discarded == 0


@pytest.mark.parametrize("start", ["quiet_start", "running_start"])
def test_a_sensor_opens_in_any_device_state(kind, start):
    options = getattr(MAKES[kind], start)
    assert len(SensorBench(kind, **options).opened().run(100 * MS)) > 70


def test_a_sensor_opens_again_after_a_killed_program(kind):
    bench = SensorBench(kind).opened()
    bench.run(20 * MS)
    bench.replug()
    assert len(bench.opened().run(100 * MS)) > 70


def test_a_sensor_opens_again_after_closing(kind):
    bench = SensorBench(kind).opened()
    bench.sensor.close()
    bench.sensor.close()
    bench.clock.sleep_until(bench.clock.now_ns() + 50 * MS)
    bench.device.due(bench.clock.now_ns())
    assert bench.device.next_event_ns() is None  # nothing streams
    bench.replug()
    assert len(bench.opened().run(100 * MS)) > 70


def test_silence_is_reported_with_power_and_cable(kind):
    bench = SensorBench(kind)
    bench.device.go_silent()
    with pytest.raises(
        LinkTimeoutError, match="Check the sensor's power and cable"
    ) as error:
        bench.sensor.open()
    assert "port open, 0 bytes" in error.value.message


@pytest.mark.parametrize(
    "kind", [k for k in KINDS if not MAKES[k].drops_damaged_frames]
)
def test_garbage_is_attributed_to_a_wrong_baud_rate(kind):
    bench = SensorBench(kind, line_xor=0x5B, **MAKES[kind].running_start)
    with pytest.raises(LinkError, match="Wrong speed") as error:
        bench.sensor.open()
    assert "no valid frame" in error.value.message


def test_an_unresponsive_sensor_is_reported(kind):
    options = {**MAKES[kind].running_start, "is_deaf": True}
    with pytest.raises(LinkTimeoutError, match="did not answer"):
        SensorBench(kind, **options).sensor.open()


def test_a_sensor_reports_its_identity_and_rate(kind):
    facts = SensorBench(kind).opened().sensor.describe()
    rate = MAKES[kind].rate
    assert {"model", "serial_number", "firmware", "filter", "time"} <= set(facts)
    assert float(facts["nominal_rate"].split()[0]) == rate
    # One frame more or less in a quarter of a second.
    assert float(facts["measured_rate"].split()[0]) == pytest.approx(rate, abs=9)
    assert len(facts["ranges"].split()) == 6


@pytest.mark.parametrize(
    ("fault", "index"),
    [
        *((ByteFault.FLIP, index) for index in (0, 1, 9, -1)),
        *((ByteFault.DROP, index) for index in (0, -1)),
        *((ByteFault.DOUBLE, index) for index in (0, 9, -1)),
    ],
)
def test_a_damaged_byte_costs_one_frame_at_most(kind, fault, index):
    bench = SensorBench(kind).opened()
    bench.run(20 * MS)
    before = bench.sensor.counters
    bench.device.damage_next(fault, index % bench.driver.timing.frame_size)
    bench.run(100 * MS)
    counters = bench.sensor.counters
    lost = 100 * bench.make.rate / 1000 - (counters.frames - before.frames)
    # A doubled byte at the edge of a frame leaves it whole.
    assert 0 <= lost <= 1 if fault is ByteFault.DOUBLE else lost == 1
    assert counters.lost == lost
    assert counters.resyncs == int(not bench.make.drops_damaged_frames)


def test_a_stream_of_bad_checksums_gives_no_sample(kind):
    bench = SensorBench(kind).opened()
    bench.run(20 * MS)
    bench.device.faults.is_garbled = True
    bench.run(3 * MS)
    assert bench.run(50 * MS) == []
    assert bench.make.drops_damaged_frames or bench.sensor.counters.bad_checks > 30
    bench.device.faults.clear_faults()
    assert len(bench.run(50 * MS)) > 35


def test_silence_of_a_running_stream_gives_no_samples_and_ends(kind):
    bench = SensorBench(kind).opened()
    bench.run(20 * MS)
    bench.device.go_silent()
    assert bench.run(50 * MS) == []
    bench.device.speak()
    later = bench.run(50 * MS)
    assert len(later) > 35
    # Dated at its arrival, not at the start of the silence.
    assert bench.clock.now_ns() - later[-1].t_ns < 3 * MS


def test_a_pause_is_counted_in_lost_samples(kind):
    bench = SensorBench(kind).opened()
    bench.run(20 * MS)
    bench.device.pause(bench.clock.now_ns() + 80 * MS)
    bench.run(200 * MS)
    expected = 0.08 * bench.make.rate
    assert bench.sensor.counters.lost == pytest.approx(expected, abs=2)


def test_frozen_readings_are_invalid(kind):
    bench = SensorBench(kind).opened()
    bench.run(20 * MS)
    bench.device.faults.freeze()
    found = bench.run(1200 * MS)
    assert found[5].is_valid
    assert not found[-1].is_valid
    assert bench.sensor.counters.frozen > 0


FINE = ["bota", "ati"]  # whose steps are far below their noise


@pytest.mark.parametrize("kind", FINE)
@pytest.mark.parametrize("axis", [0, 2, 5])
def test_one_frozen_reading_is_invalid_until_it_changes(kind, axis):
    bench = SensorBench(kind).opened()
    bench.run(300 * MS)
    bench.device.faults.freeze(axis)
    found = bench.run(600 * MS)
    assert all(sample.is_valid for sample in found[:50])
    late = [s for s in found if s.t_ns - found[0].t_ns > 510 * MS]  # two spans
    assert late
    assert not any(sample.is_valid for sample in late)
    bench.device.faults.clear_faults()
    assert all(sample.is_valid for sample in bench.run(600 * MS)[2:])


def test_a_sound_sensor_has_no_frozen_reading(kind):
    bench = SensorBench(kind).opened()
    assert all(sample.is_valid for sample in bench.run(5000 * MS))


@pytest.mark.parametrize("kind", FINE)
def test_an_axis_at_exactly_zero_is_not_a_fault(kind):
    bench = SensorBench(kind).opened()
    show = bench.device.faults.show
    bench.device.faults.show = lambda wrench: show((*wrench[:5], 0.0))
    assert all(sample.is_valid for sample in bench.run(1200 * MS))


@pytest.mark.parametrize("kind", FINE)
def test_an_axis_at_the_end_of_its_range_is_saturated(kind):
    load = [0.1, 0.2, 5.0, 0.1, 0.1, 0.1]
    bench = SensorBench(kind, load=load).opened()
    bench.device.ranges = bench.driver.ranges
    load[2] = 1.5 * bench.driver.ranges[2]
    found = bench.run(1200 * MS)[50:]
    assert all(sample.saturated & 0b100 for sample in found)
    assert all(sample.is_valid for sample in found)


@pytest.mark.parametrize("kind", FINE)
def test_pauses_do_not_freeze_an_axis(kind):
    bench = SensorBench(kind).opened()
    for _ in range(10):
        bench.device.pause(bench.clock.now_ns() + 260 * MS)
        assert all(sample.is_valid for sample in bench.run(300 * MS))


@pytest.mark.parametrize("kind", ["bota", "optoforce"])
def test_a_stopped_device_clock_makes_samples_invalid(kind):
    bench = SensorBench(kind).opened()
    bench.run(20 * MS)
    bench.device.is_clock_frozen = True
    assert not any(sample.is_valid for sample in bench.run(30 * MS)[4:])


def test_a_device_clock_jump_does_not_shift_time_stamps(kind):
    bench = SensorBench(kind).opened()
    bench.run(1500 * MS)
    bench.device.jump_clock(20_000_000)
    found = bench.run(100 * MS)
    steps = np.diff([sample.t_ns for sample in found])
    assert steps.max() < 4 * MS
    assert bench.clock.now_ns() - found[-1].t_ns < 4 * MS
    counters = bench.sensor.counters
    assert (counters.jumps, counters.lost) == (int(MAKES[kind].has_clock), 0)


def test_a_reboot_is_a_gap_without_wrong_time_stamps(kind):
    bench = SensorBench(kind).opened()
    bench.run(1500 * MS)
    bench.device.reset(bench.clock.now_ns())
    later = bench.run(3 * S)
    assert all(before.t_ns < after.t_ns for before, after in pairwise(later))
    # One waits for its start; the others send with factory settings: unusable.
    assert not any(sample.is_valid for sample in later[1:])
    bench.replug()
    assert bench.opened().run(20 * MS)[-1].is_valid


@pytest.mark.parametrize("axis", range(6))
def test_saturation_is_reported_by_axis(kind, axis):
    bench = SensorBench(kind).opened()
    bench.run(20 * MS)
    bench.device.errors = None
    bench.device.ranges = tuple(
        abs(LOAD[k]) / 2 if k == axis else 1e9 for k in range(6)
    )
    last = bench.run(20 * MS)[-1]
    if kind in {"bota", "ati"}:  # these report a saturation, but not its axis
        assert last.saturated == 0x3F
    else:
        assert last.saturated == 1 << axis
        assert axis_names(last.saturated) == (
            ("Fx", "Fy", "Fz", "Tx", "Ty", "Tz")[axis],
        )
    assert last.is_valid
    assert bench.driver.status_texts(last.status)


def test_sample_times_are_recovered_from_buffered_bytes(kind):
    """An adapter passes on its buffered bytes every 16 ms."""
    bench = SensorBench(kind, clock_error_ppm=50.0).opened()
    bench.run(6 * S, 16 * MS)
    start = bench.clock.now_ns()
    found = bench.run(S, 16 * MS)
    period = 1e9 / bench.make.rate
    ideal = found[0].t_ns + period / (1 + 50e-6) * np.arange(len(found))
    wander = np.array([s.t_ns for s in found]) - ideal
    assert np.abs(wander - wander.mean()).max() < 100_000
    assert abs(found[0].t_ns - start) < 2 * period
    assert bench.sensor.counters.is_bursty


def test_a_prompt_stream_is_not_reported_as_bursty(kind):
    bench = SensorBench(kind).opened()
    bench.run(S)
    assert not bench.sensor.counters.is_bursty


def test_warming_up_shifts_the_zero_slowly(kind):
    bench = SensorBench(kind).opened()
    early = np.mean([s.wrench for s in bench.run(500 * MS)], axis=0)
    bench.device.warming = 6.0  # degrees per second since it was switched on
    late = np.mean([s.wrench for s in bench.run(500 * MS)], axis=0)
    assert late[2] - early[2] > 0.3  # 0.15 N per degree, drift is 0.22 N rms


def test_unplugging_is_a_link_error_and_closing_still_works(kind):
    bench = SensorBench(kind).opened()
    bench.port.unplug()
    with pytest.raises(LinkError, match="Unplugged"):
        bench.sensor.poll(bench.clock.now_ns())
    bench.sensor.close()


@pytest.mark.parametrize("chunk", CHUNKS)
def test_hostile_bytes_raise_no_error_and_use_bounded_memory(kind, chunk):
    rng = np.random.default_rng(3)
    bench = SensorBench(kind).opened()
    good = b"".join(data for _, data in bench.device.due(bench.clock.now_ns() + S))
    noise = bytearray(good)
    for index in rng.integers(0, len(noise), 400):
        noise[index] = rng.integers(0, 256)
    scanner = bench.driver.scanner()
    for start in range(0, len(noise), chunk):
        scanner.feed(bytes(noise[start : start + chunk]))
        assert scanner.held < bench.driver.timing.frame_size
    assert scanner.counters.frames > 300


def test_the_largest_traction_is_set_by_force_or_torque():
    ranges = (100.0, 80.0, 200.0, 4.0, 5.0, 4.0)
    assert largest_traction(ranges, 0.1) == pytest.approx(40.0)
    assert largest_traction(ranges, 0.01) == 80.0


def test_a_slow_sensor_is_refused(kind):
    bench = SensorBench(kind, clock_error_ppm=-600_000)
    with pytest.raises(DeviceFaultError, match="at least 495"):
        bench.sensor.open()


def damaged_seconds(kind, seconds):
    """Return a bench whose stream had one damaged byte in each of `seconds`."""
    bench = SensorBench(kind).opened()
    bench.run(20 * MS)
    rng = np.random.default_rng(5)
    faults = [ByteFault.FLIP, ByteFault.DROP]
    for second in range(seconds):
        index = int(rng.integers(bench.driver.timing.frame_size))
        bench.device.damage_next(faults[second % 2], index)
        bench.run(S, 10 * MS)
    return bench


def test_periodic_damaged_bytes_cost_only_the_damaged_frames(kind):
    counters = damaged_seconds(kind, 12).sensor.counters
    assert counters.lost == 12
    assert counters.resyncs == (0 if MAKES[kind].drops_damaged_frames else 12)


@pytest.mark.long
def test_a_long_stream_of_damaged_bytes_costs_only_damaged_frames(kind):
    counters = damaged_seconds(kind, 600).sensor.counters
    assert counters.lost == 600
    assert counters.resyncs == (0 if MAKES[kind].drops_damaged_frames else 600)
    assert counters.frames == pytest.approx(600 * MAKES[kind].rate - 600, abs=35)
