import struct

import pytest

from acquisition.errors import DeviceFaultError, LinkTimeoutError, SettingsError
from fakes.sensor.optoforce import SENSITIVITY, SERIAL_NUMBER
from ft_sensor.serial_line.link import PortSettings
from ft_sensor.vendors import optoforce
from ft_sensor.vendors.optoforce import OptoForceFrame, encode_configuration
from ft_sensor.vendors.optoforce_device import OptoForceDevice, OptoForceSettings
from tests.ft_sensor.sensor_bench import MS, SensorBench

NORMAL = bytes.fromhex("AA07081012340000" + "00B7FF4801A80117FEFC01C0" + "0689")
OVERLOAD = bytes.fromhex("AA07081012350280" + "7D00FF4801A80117FEFC01C0" + "06D2")
THREE_AXES = bytes.fromhex("AA07080A2D6A0000FFF7FFFB00070551")
GOLDEN_CONFIGURATIONS = {
    (1, 2, 0): "AA00320301020000E2",
    (1, 2, 255): "AA0032030102FF01E1",
    (1, 0, 0): "AA00320301000000E0",
    (10, 4, 0): "AA0032030A040000ED",
    (0, 0, 0): "AA00320300000000DF",
}


def test_golden_frame_decodes_to_its_load():
    frame = OptoForceFrame(0x1234, 0, (183, -184, 424, 279, -260, 448))
    assert optoforce.decode_frame(NORMAL) == frame
    assert optoforce.encode_frame(frame) == NORMAL
    (reading,) = optoforce.scanner(SENSITIVITY).feed(NORMAL)
    # Rounded to counts of 0.05, 0.47 N and 0.004 N m.
    assert reading.wrench == pytest.approx((10.01, -9.99, 200, 1, -1, 1), abs=0.01)
    assert (reading.ticks, reading.saturated, reading.is_trusted) == (0x1234, 0, True)


def test_golden_overload_names_both_axes():
    (reading,) = optoforce.scanner(SENSITIVITY).feed(OVERLOAD)
    assert reading.saturated == 0b101
    assert optoforce.status_texts(0x0280) == ("Fx overloaded", "Fz overloaded")


@pytest.mark.parametrize("sign", [-1, 1])
@pytest.mark.parametrize("axis", range(6))
def test_an_axis_at_full_counts_is_saturated_whatever_the_status_says(axis, sign):
    counts = [1, 2, 3, 4, 5, 6]
    counts[axis] = sign * optoforce.FULL_COUNTS
    data = optoforce.encode_frame(OptoForceFrame(1, 0, tuple(counts)))
    (reading,) = optoforce.scanner(SENSITIVITY).feed(data)
    assert reading.saturated == 1 << axis


@pytest.mark.parametrize(
    ("status", "words"),
    [
        (0x2000, ("DAQ error",)),
        (0x4000, ("DAQ communication error",)),
        (0x0400, ("sensor not detected",)),
        (0x1000, ("temperature error",)),
        (0xE000, ("DAQ state 7",)),
        (0x0800, ("sensor failure",)),
        (0x0010, ("Tz overloaded",)),
        (0, ()),
    ],
)
def test_a_status_is_described(status, words):
    assert optoforce.status_texts(status) == words


@pytest.mark.parametrize("status", [0x2000, 0x0400])
def test_a_failing_sensor_is_not_trusted(status):
    data = optoforce.encode_frame(OptoForceFrame(1, status, (1, 2, 3, 4, 5, 6)))
    (reading,) = optoforce.scanner(SENSITIVITY).feed(data)
    assert not reading.is_trusted


@pytest.mark.parametrize(("wish", "golden"), GOLDEN_CONFIGURATIONS.items())
def test_configurations_are_the_documented_bytes(wish, golden):
    made = encode_configuration(*wish)
    assert made.hex().upper() == golden
    assert optoforce.decode_configuration(made) == wish


def test_golden_answers_are_found_inside_the_stream():
    ok = bytes.fromhex("AA0050010000FB")
    serial = bytes.fromhex("AA001208" + "4845583030303432" + "029F")
    assert optoforce.encode_configuration_answer(0) == ok
    assert optoforce.encode_serial_number("HEX00042") == serial
    data = NORMAL[5:] + serial + NORMAL + ok + NORMAL[:10]
    assert optoforce.find_configuration_answer(data) == 0
    assert optoforce.find_serial_number(data) == "HEX00042"
    assert optoforce.find_configuration_answer(NORMAL) is None
    assert bytes.fromhex("AB00120800C5") == optoforce.ASK_SERIAL


def test_a_three_axis_frame_is_not_accepted():
    assert optoforce.decode_frame(THREE_AXES + THREE_AXES) is None


def test_a_value_out_of_range_is_refused():
    with pytest.raises(struct.error):
        optoforce.encode_frame(OptoForceFrame(70000, 0, (0, 0, 0, 0, 0, 0)))


def test_lost_frames_are_counted_across_a_counter_wrap():
    bench = SensorBench("optoforce", counter_start=65536 - 600).opened()
    bench.run(100 * MS)
    bench.device.go_silent()
    bench.run(40 * MS)
    bench.device.speak()
    bench.run(500 * MS)
    assert bench.sensor.counters.lost == pytest.approx(40, abs=1)
    assert bench.sensor.counters.jumps == 0


def test_another_unit_than_that_of_the_report_is_refused():
    other = SensorBench("optoforce", serial_number="HEX00099")
    with pytest.raises(DeviceFaultError, match="is HEX00099, the sensitivities"):
        other.sensor.open()


def test_a_refused_configuration_is_reported():
    with pytest.raises(DeviceFaultError, match="refused its configuration with code 3"):
        SensorBench("optoforce", refusal=3).sensor.open()


def test_a_failing_sensor_is_refused_at_the_start():
    bench = SensorBench("optoforce")
    bench.device.status = 0x0400
    with pytest.raises(DeviceFaultError, match="reports: sensor not detected"):
        bench.sensor.open()


def test_firmware_of_the_older_protocol_is_reported():
    bench = SensorBench("optoforce", is_deaf=True)
    bench.device.firmware.frame = lambda shown, status: bytes((55, 67)) + bytes(20)
    with pytest.raises(DeviceFaultError, match="older protocol"):
        bench.sensor.open()


def test_a_sensor_without_serial_number_is_refused():
    bench = SensorBench("optoforce")
    bench.device.firmware.receive = lambda t_ns, data: (
        []
        if data == optoforce.ASK_SERIAL
        else [(t_ns + MS, optoforce.encode_configuration_answer(0))]
    )
    with pytest.raises(LinkTimeoutError, match="serial number"):
        bench.sensor.open()


@pytest.mark.parametrize(
    ("baudrate", "settings"),
    [
        (115200, {}),
        (1_000_000, {"filter_hz": 100}),
        (1_000_000, {"sensitivity": (0.0, 1, 1, 1, 1, 1)}),
    ],
)
def test_unsupported_settings_are_refused(baudrate, settings):
    values = {"sensitivity": SENSITIVITY, "serial_number": SERIAL_NUMBER} | settings
    with pytest.raises(SettingsError):
        OptoForceDevice(
            PortSettings("/dev/sensor", baudrate), OptoForceSettings(**values)
        )
