import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st

from acquisition.errors import DeviceFaultError, LinkTimeoutError, SettingsError
from ft_sensor.serial_line.link import PortSettings
from ft_sensor.vendors import robotous
from ft_sensor.vendors.robotous import RobotousFrame, encode_command
from ft_sensor.vendors.robotous_device import RobotousDevice, RobotousSettings
from tests.ft_sensor.sensor_bench import MS, SensorBench

NORMAL = bytes.fromhex("550B004BFF9C01F400C8FF9C01F40000003EAA")
OVERLOAD = bytes.fromhex("550B004BFF9C32C800C8FF9C01F40800004BAA")
GOLDEN_COMMANDS = {
    encode_command(robotous.STREAM): "550B000000000000000BAA",
    encode_command(robotous.STOP): "550C000000000000000CAA",
    encode_command(robotous.SET_RATE, 7): "550F0700000000000016AA",
    encode_command(robotous.SET_RATE, 8): "550F0800000000000017AA",
    encode_command(robotous.SET_BAUDRATE, 1): "55060100000000000007AA",
    encode_command(robotous.SET_FILTER, 0): "55080000000000000008AA",
    encode_command(robotous.SET_FILTER, 1, 4): "5508010400000000000DAA",
    encode_command(robotous.MODEL): "55010000000000000001AA",
    encode_command(robotous.BIAS, 1): "55110100000000000012AA",
    encode_command(robotous.BIAS, 0): "55110000000000000011AA",
}


def test_golden_sample_decodes_to_its_load():
    frame = RobotousFrame((75, -100, 500, 200, -100, 500), 0)
    assert robotous.decode_frame(NORMAL) == frame
    assert robotous.encode_frame(frame) == NORMAL
    (reading,) = robotous.scanner(lambda: 2000.0).feed(NORMAL)
    assert reading.wrench == pytest.approx((1.5, -2.0, 10.0, 0.1, -0.05, 0.25))
    assert (reading.saturated, reading.is_trusted) == (0, True)


def test_golden_overload_names_its_axis():
    (reading,) = robotous.scanner(lambda: 2000.0).feed(OVERLOAD)
    assert reading.wrench[2] == pytest.approx(260.0)
    assert reading.saturated == 0b100
    assert robotous.status_texts(reading.status) == (
        "Fz more than 20 % above rated load",
    )


@pytest.mark.parametrize(("made", "golden"), GOLDEN_COMMANDS.items())
def test_commands_are_the_documented_bytes(made, golden):
    assert made.hex().upper() == golden


def test_golden_answers_are_found_between_samples():
    ok = robotous.encode_answer(robotous.SET_RATE, 1, 0)
    refused = robotous.encode_answer(robotous.SET_RATE, 0, 2)
    assert ok.hex().upper() == "550F010000000000000000000000000000" + "10AA"
    assert refused.hex().upper() == "550F000200000000000000000000000000" + "11AA"
    firmware = bytes.fromhex("550356312E302E30000000000000000000" + "46AA")
    data = NORMAL[4:] + firmware + NORMAL + ok + NORMAL[:9]
    assert robotous.find_answer(data, robotous.SET_RATE)[0] == 1
    found = robotous.find_answer(data, robotous.FIRMWARE)
    assert robotous.text_of(found) == "V1.0.0"
    assert robotous.find_answer(data, robotous.MODEL) is None


def test_torque_scale_follows_the_model():
    (reading,) = robotous.scanner(lambda: 1000.0).feed(NORMAL)
    assert reading.wrench[3] == pytest.approx(0.2)


def test_a_reply_or_single_sample_is_not_a_streamed_sample():
    frame = RobotousFrame((0, 0, 0, 0, 0, 0), 0)
    single = robotous.encode_frame(frame, robotous.SAMPLE)
    assert robotous.decode_frame(single) is None


@given(st.binary(min_size=11, max_size=11))
def test_hostile_commands_decode_or_are_ignored(data):
    found = robotous.decode_command(data)
    assert found is None or encode_command(found[0], *found[1]) == data


def test_a_count_out_of_range_is_refused():
    with pytest.raises(struct.error):
        robotous.encode_frame(RobotousFrame((40000, 0, 0, 0, 0, 0), 0))


def test_the_sensor_is_identified_and_its_settings_are_read_back():
    bench = SensorBench("robotous").opened()
    fields = bench.sensor.describe()
    assert fields["model"] == "Robotous RFT60-HA01"
    assert fields["filter"] == "low-pass 150 Hz"
    assert fields["overloads"] == "0 0 0 0 0 0"
    assert fields["ranges"] == "150 150 200 4 4 4"


def test_a_model_with_another_torque_scale_shows_the_same_load():
    bench = SensorBench("robotous", model="RFT82-HA02").opened()
    bench.device.errors = None
    assert bench.run(20 * MS)[-1].wrench[4] == pytest.approx(0.2, abs=0.001)


def test_a_setting_that_was_not_applied_is_detected():
    with pytest.raises(DeviceFaultError, match="reads back filter code"):
        SensorBench("robotous", forgets=True).sensor.open()


def test_a_refused_setting_is_reported_with_its_reason():
    refusing = SensorBench("robotous", refused=(robotous.SET_RATE,))
    with pytest.raises(DeviceFaultError, match="refused command 0x0f 8: out of range"):
        refusing.sensor.open()


def test_a_model_without_a_known_scale_is_refused():
    with pytest.raises(DeviceFaultError, match="'RFT99-XX00', whose scale is unknown"):
        SensorBench("robotous", model="RFT99-XX00").sensor.open()


def test_a_model_that_is_too_slow_is_refused():
    with pytest.raises(DeviceFaultError, match="200 Hz at most"):
        SensorBench("robotous", model="RFT40-SA01").sensor.open()


def test_a_new_sensor_is_set_to_its_baud_rate_and_needs_a_power_cycle():
    bench = SensorBench("robotous", baudrate=115200)
    driver = RobotousDevice(
        PortSettings("/dev/sensor", 115200, 0.25), RobotousSettings()
    )
    bench.sensor.device = driver
    with pytest.raises(DeviceFaultError, match="921600 baud from its next") as error:
        bench.sensor.open()
    assert "Cycle its power and set baudrate = 921600" in error.value.hint


def test_an_absurd_load_at_the_start_is_refused():
    with pytest.raises(DeviceFaultError, match="times its rated load"):
        SensorBench("robotous", load=(0, 0, 0, 9.0, 0, 0)).sensor.open()


def test_a_sensor_that_stops_answering_is_reported():
    bench = SensorBench("robotous", is_running=True, is_deaf=True)
    with pytest.raises(LinkTimeoutError, match="command 0x01"):
        bench.sensor.open()


def test_an_undetected_loss_is_found_from_arrival_times():
    bench = SensorBench("robotous").opened()
    bench.run(1500 * MS)
    for _ in range(3):
        bench.device.pause(bench.clock.now_ns() + 4 * MS)
        bench.run(700 * MS)
    assert bench.sensor.counters.lost == pytest.approx(12, abs=1)
    newest = bench.run(20 * MS)[-1]
    assert bench.clock.now_ns() - newest.t_ns < 2 * MS


@pytest.mark.parametrize(
    ("line", "settings"),
    [
        ((57600,), {}),
        ((230400,), {"rate": 1000}),
        ((921600,), {"rate": 333}),
        ((921600,), {"filter_hz": 123}),
        ((921600, 0.0), {}),
    ],
)
def test_unsupported_settings_are_refused(line, settings):
    with pytest.raises(SettingsError):
        RobotousDevice(PortSettings("/dev/sensor", *line), RobotousSettings(**settings))
