import numpy as np
import pytest

from acquisition.devices import SafetyMode
from fakes.pucks.ft_puck import RANGES, STEPS, Load
from fakes.pucks.network import PuckNetwork
from fakes.pucks.options import NetworkOptions
from fakes.sensor.errors import SensorErrors
from tests.fakes.stepped import Motors
from wam.bus.frames import decode_force, decode_torque

MS = 1_000_000
LOAD = (1.0, -2.5, -9.76, 0.099, -0.249, 0.015)  # whole steps of the sensor
REST = [0.0] * 6


class Host:
    """Exchanges frames with the sensor of a network without a bus."""

    def __init__(self, load=REST, **options):
        self.load = list(load)
        options = NetworkOptions(has_sensor=True, **options)
        felt = Load(lambda _: self.load)
        self.network = PuckNetwork(Motors(), options, load=felt)
        self.t_ns = 0

    def say(self, data, can_id=8):
        """Send a frame; return the replies within a millisecond."""
        self.network.receive(self.t_ns, can_id, bytes.fromhex(data))
        return self.hear(MS)

    def hear(self, duration_ns):
        self.t_ns += duration_ns
        return [
            f"{can_id:03x} {data.hex(' ')}"
            for _, can_id, data in self.network.due(self.t_ns)
        ]

    def wrench(self):
        """Request force and torque; return them and the status."""
        force, torque = self.say("36")
        return (
            decode_force(bytes.fromhex(force[4:])),
            *decode_torque(bytes.fromhex(torque[4:])),
        )


@pytest.mark.parametrize(
    ("request_", "reply"),
    [
        ("05", "506 85 00 02 00"),
        ("01", "506 81 00 06 00"),
        ("03", "506 83 00 08 00"),
        ("1a", "506 9a 00 0a 00"),  # GRPA
        ("2a", "506 aa 00 00 08"),  # SG1 at rest: 2048
        ("2f", "506 af 00 00 08"),  # SG6
        ("3d", "506 bd 00 00 08"),  # T1
        ("40", "50c 00 00 00 00 3a 27"),
        ("39", "506 b9 00 3a 27"),  # AZ
    ],
)
def test_a_get_is_answered_with_the_known_bytes(request_, reply):
    assert Host().say(request_) == [reply]


def test_one_wrench_request_has_two_replies():
    host = Host((1.0, -2.5, -9.76, 0.0, -0.249, 0.015))
    force, torque = host.say("36")
    assert force == "50a 00 01 80 fd 3d f6"  # 256 counts a newton
    assert torque == "50b 00 00 04 fc 3d 00"  # 4096 counts a newton metre


def test_the_wrench_is_sampled_at_a_fixed_delay_after_the_request():
    host = Host()
    host.network.receive(0, 8, b"\x36")
    host.network.advance(74_999)
    host.load[0] = 8.0
    (ready_ns, _, data), _ = host.network.due(MS)
    assert (ready_ns, decode_force(data)[0]) == (75_000, 8.0)


def test_single_components_agree_with_the_frames():
    host = Host(LOAD)
    force, torque = host.say("36")
    parts = "".join(
        host.say(f"{n:02x}")[0][-5:].replace(" ", "") for n in range(48, 54)
    )
    assert parts == (force[4:] + torque[4:]).replace(" ", "")


def test_readings_have_the_data_sheet_resolution():
    host = Host([0.51 * step for step in STEPS])
    force, torque, _ = host.wrench()
    # Half a count of the frame.
    assert force == pytest.approx(STEPS[:3], abs=0.002)
    assert torque == pytest.approx(STEPS[3:], abs=0.00013)


def test_a_set_has_no_reply_but_an_led_is_stored():
    host = Host()
    assert host.say("bc 00 01 00 00 00") == []
    assert host.say("3c") == ["506 bc 00 01 00"]


@pytest.mark.parametrize(("number", "count"), [("ba", 36), ("bb", 6)])
def test_calibrations_are_accepted_without_a_reply(number, count):
    host = Host(LOAD)
    before = host.say("36")
    for _ in range(count):
        assert host.say(f"{number} 00 85 ff ff ff") == []  # -123
    assert host.say("36") == before
    assert host.say(f"{int(number, 16) & 0x7F:02x}") == []


def test_a_tare_is_not_answered_and_zeroes_the_present_load():
    host = Host(LOAD)
    assert host.say("b6 00 00 00 00 00") == []
    assert host.wrench() == ((0, 0, 0), (0, 0, 0), 0)
    host.load[2] += 5.04
    assert host.wrench()[0][2] == pytest.approx(5.04, abs=0.002)


def test_only_a_set_to_zero_tares():
    host = Host(LOAD)
    host.say("b6 00 01 00 00 00")
    assert host.wrench()[0][0] == 1.0


def test_a_saturated_gauge_stays_flagged_until_the_tare():
    host = Host()
    assert len(host.say("36")[1]) == len("50b") + 3 * 6  # six bytes
    host.load[2] = -140.0
    assert host.wrench()[2] == 0xC4
    host.load[2] = 0.0
    assert host.wrench()[2] == 0x84
    host.say("b6 00 00 00 00 00")
    assert host.wrench()[2] == 0


@pytest.mark.parametrize("axis", range(6))
def test_each_gauge_ends_at_the_range_of_its_axis(axis):
    host = Host()
    host.load[axis] = 0.99 * RANGES[axis]
    assert host.wrench()[2] == 0
    host.load[axis] = 1.01 * RANGES[axis]
    force, torque, status = host.wrench()
    assert status == 0xC0 | 1 << axis
    shown = (*force, *torque)[axis]
    # Values beyond the frame are clipped; half a count of torque.
    assert shown == pytest.approx(min(RANGES[axis], 127.996), abs=0.001)
    assert host.say(f"{42 + axis:02x}")[0][-5:] == "ff 0f"


def test_a_force_beyond_the_frame_is_clipped_without_a_saturated_gauge():
    host = Host((0, 0, 130.0, 0, 0, 0))
    force, _, status = host.wrench()
    assert (force[2], status) == (0x7FFF / 256, 0)


def test_the_same_errors_as_on_a_serial_sensor_are_added():
    network = PuckNetwork(
        Motors(),
        NetworkOptions(has_sensor=True),
        load=Load(lambda _: REST, SensorErrors(np.random.default_rng(1))),
    )
    twin = SensorErrors(np.random.default_rng(1))
    network.receive(0, 8, b"\x36")
    force = decode_force(network.due(MS)[0][2])
    # Half a step of the sensor.
    assert force[0] == pytest.approx(twin.apply(75_000, REST)[0], abs=0.03)


def test_a_sleeping_sensor_has_only_monitor_properties():
    host = Host(are_asleep=True)
    assert host.say("05") == ["506 85 00 00 00"]
    assert host.say("00") == ["506 80 00 05 00"]
    assert host.say("01") == ["506 81 00 06 00"]
    for other in ("36", "2a", "40", "b6 00 00 00 00 00"):
        assert host.say(other) == []


def test_a_reset_sensor_is_in_its_monitor_without_its_tare():
    host = Host(LOAD)
    host.say("b6 00 00 00 00 00")
    host.say("85 00 00 00 00 00")
    assert host.say("05") == []
    host.hear(500 * MS)
    assert host.say("05") == ["506 85 00 00 00"]
    host.say("85 00 02 00 00 00")
    host.hear(600 * MS)
    assert host.wrench()[0][0] == 1.0


def test_a_rebooted_sensor_sleeps():
    host = Host()
    host.network.reboot(8)
    assert host.say("05") == ["506 85 00 00 00"]


def test_an_e_stop_removes_the_sensor_even_during_a_reply():
    host = Host()
    host.network.receive(0, 8, b"\x36")
    host.network.pendant("estop")
    assert host.hear(MS) == ["540 88 00 00 00"]
    assert host.say("05") == []
    host.network.pendant("idle")
    host.hear(MS)
    assert host.say("05") == ["506 85 00 00 00"]


def test_a_stopped_arm_has_no_sensor():
    assert Host(safety_mode=SafetyMode.E_STOP).say("05") == []


def test_a_mute_sensor_receives_but_does_not_send():
    host = Host(LOAD)
    host.network.silence(8)
    assert host.say("05") == host.say("36") == host.say("40") == []
    host.say("b6 00 00 00 00 00")
    host.network.silence(8, is_mute=False)
    assert host.wrench()[0] == (0, 0, 0)


def test_the_sensor_ignores_frames_to_the_whole_bus_or_arm():
    host = Host()
    heard = host.say("05", 0x400) + host.say("05", 0x404)
    assert heard
    assert not [frame for frame in heard if frame.startswith("50")]


def test_a_network_without_a_sensor_refuses_to_silence_it():
    network = PuckNetwork(Motors())
    network.silence(8)
    network.reboot(8)
    network.set_bus_voltage(47.0)
    network.receive(0, 8, b"\x05")
    assert network.due(MS) == []
