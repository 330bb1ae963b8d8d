import pytest
from hypothesis import given
from hypothesis import strategies as st

from acquisition.devices import SafetyMode
from fakes.pucks.network import PuckNetwork
from fakes.pucks.options import NetworkOptions
from tests.fakes.stepped import Motors
from wam.bus.frames import encode_set, encode_torques
from wam.driver.pendant import SafetyLevel, decode_pendant

MS = 1_000_000
HOME_COUNTS = (0, -36833, 36832, -36728, 0, 0, 0)
ASLEEP = NetworkOptions(are_asleep=True)
STOPPED = NetworkOptions(safety_mode=SafetyMode.E_STOP)


class Host:
    """Exchanges frames with a network without a bus."""

    def __init__(self, options=None, counts=HOME_COUNTS):
        self.motors = Motors(counts)
        self.network = PuckNetwork(self.motors, options)
        self.t_ns = 0

    def say(self, can_id, data):
        """Send a frame; return the replies within a millisecond."""
        data = bytes.fromhex(data) if isinstance(data, str) else data
        self.network.receive(self.t_ns, can_id, data)
        return self.hear(MS)

    def hear(self, duration_ns):
        self.t_ns += duration_ns
        return [
            f"{can_id:03x} {data.hex(' ')}"
            for _, can_id, data in self.network.due(self.t_ns)
        ]

    def activate(self):
        self.network.pendant("activate")
        self.hear(MS)

    def poll(self, cycles):
        for _ in range(cycles):
            self.say(0x404, "30")


@pytest.mark.parametrize(
    ("can_id", "request_", "reply"),
    [
        (1, "05", "426 85 00 02 00"),
        (1, "00", "426 80 00 c8 00"),
        (1, "01", "426 81 00 00 01"),
        (1, "44", "426 c4 00 00 10 00 00"),
        (1, "56", "426 d6 00 8c 0a"),
        (7, "56", "4e6 d6 00 42 44"),
        (7, "5a", "4e6 da 00 06 00"),
        (0x00A, "05", "546 85 00 02 00"),
        (0x00A, "01", "546 81 00 02 00"),
        (0x00A, "08", "546 88 00 01 00"),
        (0x00A, "2a", "546 aa 00 01 00"),
        (0x00A, "2b", "546 ab 00 49 12 3f 0d"),
    ],
)
def test_a_get_is_answered_with_the_known_bytes(can_id, request_, reply):
    assert Host().say(can_id, request_) == [reply]


def test_replies_follow_requests_within_the_documented_delay():
    host = Host()
    host.network.receive(0, 3, b"\x05")
    ((ready_ns, _, _),) = host.network.due(MS)
    assert 75_000 <= ready_ns <= 150_000


def test_the_whole_arm_reports_its_position_in_node_order():
    assert Host().say(0x404, "30") == [
        "423 00 00 00",
        "443 3f 70 1f",
        "463 00 8f e0",
        "483 3f 70 88",
        "4a3 00 00 00",
        "4c3 00 00 00",
        "4e3 00 00 00",
    ]


def test_positions_are_latched_at_a_fixed_delay_after_the_request():
    host = Host()
    host.network.receive(0, 1, b"\x30")
    host.network.advance(74_999)
    host.motors.position[0] = 5
    host.network.advance(75_000)
    host.motors.position[0] = 9
    ((ready_ns, _, data),) = host.network.due(MS)
    assert (ready_ns, data[2]) == (75_000, 5)


def test_a_group_get_is_answered_by_each_member():
    replies = Host().say(0x404, "08")
    nodes = ("426", "446", "466", "486", "4a6", "4c6", "4e6")
    assert tuple(reply[:3] for reply in replies) == nodes


@pytest.mark.parametrize("node", [8, 9, 11, 31])
def test_an_unused_node_is_silent(node):
    assert Host().say(node, "05") == []


@pytest.mark.parametrize("data", ["2b 00", "7f", "85", "", "85 01 02 00"])
def test_unknown_requests_are_not_answered(data):
    assert Host().say(1, data) == []


def test_a_set_is_stored_without_a_reply():
    host = Host()
    assert host.say(1, "ab 00 e8 03 00 00") == []
    assert host.say(1, "2b") == ["426 ab 00 e8 03"]


def test_four_byte_sets_are_accepted():
    host = Host()
    host.say(0x00A, "b0 00 54 14")
    assert host.say(0x00A, "30") == ["546 b0 00 54 14"]


def test_set_p_moves_the_position_and_not_the_absolute_encoder():
    host = Host()
    mech = host.say(1, "42")
    host.say(1, "b0 00 1f 70 ff ff")
    assert host.say(1, "30") == ["423 3f 70 1f"]
    assert host.say(1, "42") == mech


def test_sleeping_pucks_answer_only_monitor_properties():
    host = Host(ASLEEP)
    assert host.say(1, "05") == ["426 85 00 00 00"]
    assert host.say(1, "00") == ["426 80 00 05 00"]
    assert host.say(1, "44") == []
    assert host.say(0x404, "30") == []


def test_power_up_loses_positions():
    host = Host(NetworkOptions(is_zeroed=False))
    assert host.say(2, "30") != ["443 3f 70 1f"]
    assert host.say(0x00A, "2a") == ["546 aa 00 00 00"]


def test_a_reset_puck_is_in_its_monitor():
    host = Host()
    host.say(3, "85 00 00 00 00 00")
    assert host.say(3, "05") == []
    host.hear(500 * MS)
    assert host.say(3, "05") == ["466 85 00 00 00"]


def test_a_rebooted_puck_forgets_torque_and_position():
    host = Host()
    host.activate()
    host.say(0x401, encode_torques((0, 100, 0, 0)))
    assert host.motors.units[1] == 100
    host.network.reboot(2)
    assert host.motors.units[1] == 0
    assert len(host.say(0x404, "30")) == 6


def test_a_mute_puck_receives_but_does_not_send():
    host = Host()
    host.activate()
    host.network.silence(1)
    assert host.say(1, "05") == []
    host.say(0x401, encode_torques((100, 0, 0, 0)))
    assert host.motors.units[0] == 100


def test_torque_is_applied_in_torque_mode_only():
    host = Host()
    host.say(0x401, encode_torques((1, 2, 3, 4)))
    assert host.motors.units == [0] * 7
    host.activate()
    host.say(0x401, encode_torques((1, 2, 3, 4)))
    host.say(0x402, encode_torques((5, 6, 7)))
    assert host.motors.units == [1, 2, 3, 4, 5, 6, 7]


def test_a_puck_reads_the_slot_of_its_index():
    host = Host()
    host.say(1, encode_set(70, 2))  # PIDX
    host.activate()
    host.say(0x401, encode_torques((1, 2, 3, 4)))
    assert host.motors.units[:4] == [2, 2, 3, 4]


def test_a_puck_clips_to_its_own_limit():
    host = Host()
    host.activate()
    host.say(0x402, encode_torques((0, 0, -4000)))
    assert host.motors.units[6] == -1600


def test_a_torque_frame_of_other_firmware_moves_nothing():
    host = Host()
    host.activate()
    host.say(0x401, encode_torques((1, 2, 3, 4), number=9))
    assert host.motors.units == [0] * 7


def test_activation_is_broadcast_and_releases_the_brakes():
    host = Host()
    assert host.motors.is_idle
    host.network.pendant("activate")
    assert host.hear(MS) == ["540 88 00 02 00"]
    assert not host.motors.is_idle
    assert host.say(0x404, "08")[0] == "426 88 00 02 00"


def test_pucks_that_are_idled_brake_though_the_module_is_active():
    host = Host()
    host.activate()
    host.say(0x404, "88 00 00 00 00 00")
    assert host.motors.is_idle


@pytest.mark.parametrize(
    ("options", "value", "expected"),
    [
        (None, 2, SafetyMode.IDLE),
        (STOPPED, 1, SafetyMode.E_STOP),
        (STOPPED, 2, SafetyMode.E_STOP),
        (None, 0, SafetyMode.E_STOP),
        (None, -1, SafetyMode.IDLE),
    ],
)
def test_the_host_can_lower_but_not_raise_the_mode(options, value, expected):
    host = Host(options)
    host.say(0x00A, encode_set(8, value))
    assert host.network.safety_mode is expected


def test_the_unlock_sequence_unlocks_nothing():
    host = Host()
    for value in (18384, 23, 3145, 1024, 1):
        host.say(0x00A, encode_set(13, value))
    host.say(0x00A, encode_set(8, 2))
    assert host.network.safety_mode is SafetyMode.IDLE


def test_an_e_stop_clears_power_positions_and_zero():
    host = Host()
    host.network.pendant("estop")
    host.hear(MS)
    assert host.motors.is_idle
    assert host.say(1, "05") == []
    assert host.say(0x00A, "2a") == ["546 aa 00 00 00"]
    assert host.say(0x00A, "2b") == ["546 ab 00 49 42 79 00"]


def test_released_pucks_return_asleep():
    host = Host(STOPPED)
    host.network.pendant("idle")
    host.hear(MS)
    assert host.network.safety_mode is SafetyMode.IDLE
    assert host.say(1, "05") == ["426 85 00 00 00"]


def test_activating_a_stopped_arm_has_no_effect():
    host = Host(STOPPED)
    host.network.pendant("activate")
    assert host.network.safety_mode is SafetyMode.E_STOP


def test_polling_positions_keeps_the_arm_active():
    host = Host()
    host.activate()
    host.poll(300)
    assert host.network.safety_mode is SafetyMode.ACTIVE


def test_without_polling_the_heartbeat_faults_and_brakes():
    host = Host()
    host.activate()
    host.poll(1)
    assert host.hear(98 * MS) == []
    assert host.hear(3 * MS) == ["540 88 00 00 00"]
    assert host.network.safety_mode is SafetyMode.IDLE
    assert host.motors.is_idle
    assert host.say(0x00A, "2b") == ["546 ab 00 49 18 3f 0d"]


def test_torques_alone_are_no_heartbeat():
    host = Host()
    host.activate()
    for _ in range(110):
        host.say(0x401, encode_torques((1, 1, 1, 1)))
    assert host.network.safety_mode is SafetyMode.IDLE


def test_an_idle_arm_needs_no_heartbeat():
    host = Host()
    host.hear(1000 * MS)
    assert host.network.pendant_state.faults == ()


def test_a_fault_bars_activation_until_shift_idle():
    host = Host()
    host.activate()
    host.hear(200 * MS)
    host.network.pendant("activate")
    assert host.network.safety_mode is SafetyMode.IDLE
    host.network.pendant("idle")
    host.network.pendant("activate")
    assert host.network.safety_mode is SafetyMode.ACTIVE


@pytest.mark.parametrize(
    ("units", "level", "mode"),
    [
        (4731, SafetyLevel.SAFE, SafetyMode.ACTIVE),
        (-4732, SafetyLevel.WARNING, SafetyMode.ACTIVE),
        (5204, SafetyLevel.WARNING, SafetyMode.ACTIVE),
        (-5205, SafetyLevel.FAULT, SafetyMode.IDLE),
    ],
)
def test_the_module_judges_commanded_torque(units, level, mode):
    host = Host()
    host.activate()
    host.say(0x401, encode_torques((0, 0, units, 0)))
    assert host.network.pendant_state.torque is level
    assert host.network.safety_mode is mode


def test_a_smaller_torque_clears_the_warning():
    host = Host()
    host.activate()
    host.say(0x401, encode_torques((0, 0, 5000, 0)))
    host.say(0x401, encode_torques((0, 0, 0, 0)))
    assert host.network.pendant_state.torque is SafetyLevel.SAFE


def test_limits_return_to_their_power_up_values():
    host = Host()
    host.say(0x00A, encode_set(48, 8100))
    host.say(0x00A, encode_set(32, 48))
    assert host.say(0x00A, "30") == ["546 b0 00 54 14"]


def test_a_value_beyond_its_width_wraps():
    host = Host()
    host.say(1, encode_set(86, 70000))
    assert host.say(1, "56") == ["426 d6 00 70 11"]


def test_the_next_event_is_the_answer_that_is_due():
    host = Host()
    assert host.network.next_event_ns() is None
    host.network.receive(0, 1, b"\x30")
    assert host.network.next_event_ns() == 75_000


@given(st.lists(st.tuples(st.integers(0, 0x7FF), st.binary(max_size=8)), max_size=20))
def test_no_bytes_disturb_the_network(frames):
    host = Host()
    host.network.pendant("activate")
    for can_id, data in frames:
        host.say(can_id, data)
    word = host.say(0x00A, "2b")
    assert word
    decode_pendant(int.from_bytes(bytes.fromhex(word[-1][10:]), "little"))
