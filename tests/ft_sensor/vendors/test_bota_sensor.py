import math
from itertools import pairwise

import numpy as np
import pytest

from acquisition.devices import WrenchSample
from acquisition.errors import DeviceFaultError, SettingsError
from fakes.sensor.bota import BotaOptions, bota_stream
from fakes.sensor.errors import SensorErrors
from fakes.sensor.port import FakeSerialPort
from ft_sensor.serial_line.link import PortSettings, SerialLink
from ft_sensor.serial_line.sensor import SerialSensor
from ft_sensor.vendors.bota import BotaStatus
from ft_sensor.vendors.bota_device import BotaDevice, BotaSettings
from tests.ft_sensor.sensor_bench import LOAD, MS, SteppedTime


def sensor_on(port, clock, baudrate=460800, **settings) -> SerialSensor:
    line = PortSettings("/dev/sensor", baudrate, rate_check=0.25)
    device = BotaDevice(line, BotaSettings(**settings))
    return SerialSensor(SerialLink(port), clock, device)


class Bench:
    """A sensor and its simulated device."""

    def __init__(self, options=BotaOptions(), line_xor=0, load=LOAD, **settings):  # noqa: B008
        self.clock = SteppedTime()
        errors = SensorErrors(np.random.default_rng(1))
        start = self.clock.now_ns()
        self.device = bota_stream(lambda t_ns: load, errors, options, start)
        self.port = FakeSerialPort(self.device, self.clock, line_xor)
        self.clock.world = self.port
        self.sensor = sensor_on(self.port, self.clock, **settings)

    def opened(self) -> "Bench":
        self.sensor.open()
        return self

    def run(self, duration_ns: int, period_ns: int = 2 * MS) -> list[WrenchSample]:
        """Poll every `period_ns`."""
        found: list[WrenchSample] = []
        for _ in range(duration_ns // period_ns):
            self.clock.sleep_until(self.clock.now_ns() + period_ns)
            found += self.sensor.poll(self.clock.now_ns())
        return found


class RecordingPort(FakeSerialPort):
    """Remembers what was written to it."""

    def __init__(self, stream, clock) -> None:
        super().__init__(stream, clock)
        self.written = b""

    def write(self, data, /):
        self.written += data
        return super().write(data)


class ForgetfulPort(FakeSerialPort):
    """Loses the first byte written to it."""

    forgotten = False

    def write(self, data, /):
        if self.forgotten:
            return super().write(data)
        self.forgotten = True
        return len(data)


def test_a_device_reset_by_opening_the_port_opens():
    bench = Bench(BotaOptions(is_running=True, resets_on_open=True)).opened()
    assert all(sample.is_valid for sample in bench.run(100 * MS))


def test_opening_sends_the_documented_commands_only():
    bench = Bench(BotaOptions(is_running=True))
    port = RecordingPort(bench.device, bench.clock)
    bench.clock.world = port
    sensor_on(port, bench.clock).open()
    assert port.written == b"Cc,0,1,0,4f,64,0,0,0R"


def test_a_sensor_left_in_configuration_mode_opens():
    bench = Bench(BotaOptions(is_running=True)).opened()
    bench.sensor.close()
    assert bench.device.next_event_ns() is not None  # the answer to the stop
    port = FakeSerialPort(bench.device, bench.clock)
    bench.clock.world = port
    bench.sensor = sensor_on(port, bench.clock)
    assert bench.opened().run(100 * MS)


@pytest.mark.parametrize(("letter", "text"), [("c", "c,0,1,0,4"), ("f", "f,64,0,0,0")])
def test_refused_command_is_reported(letter, text):
    bench = Bench(BotaOptions(refused=letter))
    with pytest.raises(DeviceFaultError, match=f"refused '{text}' with code 1"):
        bench.sensor.open()


def test_an_inactive_matrix_is_restarted():
    bench = Bench(BotaOptions(raw_starts=2)).opened()
    assert not any(s.status & BotaStatus.RAW_GAUGE for s in bench.run(100 * MS))


def test_a_matrix_that_stays_inactive_is_refused():
    bench = Bench(BotaOptions(raw_starts=100))
    with pytest.raises(DeviceFaultError, match="raw gauge data"):
        bench.sensor.open()


@pytest.mark.parametrize("axis", range(6))
def test_absurd_numbers_without_a_flag_are_refused(axis):
    load = tuple(600.0 if k == axis else 0.0 for k in range(6))
    with pytest.raises(DeviceFaultError, match="absurd forces"):
        Bench(load=load).sensor.open()


def test_a_stopped_device_clock_is_refused_at_start():
    bench = Bench()
    bench.device.is_clock_frozen = True
    with pytest.raises(DeviceFaultError, match="stands still"):
        bench.sensor.open()


def test_a_lost_command_is_repeated():
    bench = Bench(BotaOptions(is_running=True))
    port = ForgetfulPort(bench.device, bench.clock)
    bench.clock.world = port
    bench.sensor = sensor_on(port, bench.clock)
    assert bench.opened().run(100 * MS)


def test_a_rate_too_low_for_the_loop_is_refused():
    bench = Bench(BotaOptions(sinc=104))
    with pytest.raises(DeviceFaultError, match=r"sends 49[12]\.\d Hz, at least 495"):
        bench.sensor.open()


def test_a_slow_device_clock_does_not_set_the_rate():
    # It counts 800 Hz in seconds that last 1.67 s.
    bench = Bench(BotaOptions(clock_error_ppm=-400_000))
    with pytest.raises(DeviceFaultError, match=r"sends 4[78]\d\.\d Hz"):
        bench.sensor.open()


def test_a_rate_just_above_nominal_is_accepted():
    fields = Bench(BotaOptions(sinc=102)).opened().sensor.describe()
    # counted over a quarter of a second: good to a frame or two
    assert float(fields["measured_rate"].split()[0]) == pytest.approx(502.0, abs=5.0)


def test_the_description_states_identity_and_rate():
    fields = Bench(BotaOptions(clock_error_ppm=50)).opened().sensor.describe()
    assert fields["serial_number"] == "20001"
    assert fields["name"] == "Fake F/T sensor"
    assert fields["filter"] == "sinc 64, FIR on"
    # One frame more or less in a quarter of a second is 4 Hz.
    assert float(fields["measured_rate"].split()[0]) == pytest.approx(800, abs=4)


def test_the_description_of_a_running_stream_has_no_serial_number():
    fields = Bench(BotaOptions(is_running=True)).opened().sensor.describe()
    assert fields["serial_number"].startswith("unknown")


@pytest.mark.parametrize("period_ns", [2 * MS, 500_000, 23 * MS])
def test_sample_times_rise_and_differ_like_the_device_clock(period_ns):
    bench = Bench(BotaOptions(clock_error_ppm=80)).opened()
    period = None
    for _ in range(20):
        batch = bench.run(period_ns, period_ns)
        for before, after in pairwise(batch):
            period = after.t_ns - before.t_ns
            assert period == (after.counter - before.counter) * 1000
    assert period is not None or period_ns < 1_250_000
    times = [sample.t_ns for sample in bench.run(400 * MS, period_ns)]
    assert all(before < after for before, after in pairwise(times))


def test_newest_sample_is_one_wire_time_before_its_arrival():
    bench = Bench().opened()
    newest = bench.run(20 * MS)[-1]
    assert newest.t_ns == bench.clock.now_ns() - 802_951


def test_true_sampling_times_precede_their_time_stamps_by_at_most_a_period():
    bench = Bench().opened()
    start = bench.device.on_since_ns
    for sample in bench.run(100 * MS):
        late = sample.t_ns - (start + sample.counter * 1000)
        assert -1000 <= late <= 1_250_000  # the counter shows whole microseconds


@pytest.mark.parametrize(
    ("status", "is_valid", "saturated"),
    [
        (BotaStatus.SKIPPED, True, 0),
        (BotaStatus.OVER_RANGE, True, 0x3F),  # the axis is not reported
        (BotaStatus.INVALID, False, 0),
        (BotaStatus.RAW_GAUGE, False, 0),
    ],
)
def test_status_bits_reach_the_sample(status, is_valid, saturated):
    bench = Bench().opened()
    bench.device.status = int(status)
    last = bench.run(50 * MS)[-1]
    assert (last.is_valid, last.saturated) == (is_valid, saturated)
    assert last.status == status


def shown_with(bench, axis, value):
    """Let the device show `value` on one axis while the others keep measuring."""
    bench.device.faults.show = lambda wrench: (
        *wrench[:axis],
        value,
        *wrench[axis + 1 :],
    )
    return bench.run(20 * MS)[4:]


@pytest.mark.parametrize(
    ("axis", "value"),
    [
        *((0, value) for value in (1e30, -1e30, math.inf, math.nan)),
        *((axis, 5000.0) for axis in range(6)),
    ],
)
def test_an_implausible_value_is_invalid_despite_its_checksum(axis, value):
    bench = Bench().opened()
    found = shown_with(bench, axis, value)
    assert found
    assert not any(sample.is_valid for sample in found)
    assert bench.sensor.counters.bad_checks == 0


def test_a_value_somewhat_beyond_the_range_is_valid():
    bench = Bench().opened()
    found = shown_with(bench, 0, -1.5 * bench.sensor.device.ranges[0])
    assert found
    assert all(sample.is_valid for sample in found)


def test_device_time_continues_across_32_bits():
    bench = Bench(BotaOptions(clock_start_us=2**32 - 1_600_000)).opened()
    found = bench.run(300 * MS)
    counters = [sample.counter for sample in found]
    total = (counters[-1] - counters[0]) % 2**32
    assert counters[0] > counters[-1]
    assert total == (len(found) - 1) * 1250
    assert bench.sensor.counters.lost == 0


@pytest.mark.parametrize(
    "wrong",
    [{"baudrate": 12345}, {"baudrate": 115200}, {"sinc": 0}, {"rate_check": 0.0}],
)
def test_unsupported_settings_are_refused(wrong):
    settings = {"baudrate": 460800, "sinc": 64, "rate_check": 0.25} | wrong
    with pytest.raises(SettingsError):
        BotaDevice(
            PortSettings("/dev/sensor", settings["baudrate"], settings["rate_check"]),
            BotaSettings(sinc=settings["sinc"]),
        )
