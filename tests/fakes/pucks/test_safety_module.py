"""The simulated safety module monitors speed and bus voltage by its limits."""

import numpy as np
import pytest

from acquisition.devices import SafetyMode
from fakes.pucks.network import PuckNetwork
from fakes.pucks.options import NetworkOptions
from fakes.pucks.speed_monitor import SpeedMonitor
from tests.fakes.scenes import MODEL, START_Q
from tests.fakes.stepped import Motors
from wam.bus.frames import encode_set
from wam.driver.pendant import SafetyLevel, decode_pendant
from wam.driver.settings import ArmSettings
from wam.driver.transmission import Transmission

MS = 1_000_000
CYCLE_NS = 2 * MS
TRANSMISSION = Transmission(
    ArmSettings().j2mp, (4096,) * 7, (2700,) * 4 + (6500,) * 2 + (17474,)
)
BENT = np.array([0.0, np.pi / 2, 0.0, 0.5, 0.0, 0.0, 0.0])
VL1, VL2, IFAULT, ZERO = 45, 46, 55, 42


class Host:
    """Polls positions every 2 ms while the joints move at a given speed."""

    def __init__(self, q=BENT, **options):
        self.q = np.array(q)
        self.motors = Motors(TRANSMISSION.counts(self.q))
        self.network = PuckNetwork(self.motors, NetworkOptions(**options))
        self.t_ns = 0
        self.network.pendant("activate")

    def tell(self, number, value):
        self.network.receive(self.t_ns, 0x00A, encode_set(number, value))

    def ask(self, number):
        self.network.due(self.t_ns)
        self.network.receive(self.t_ns, 0x00A, bytes((number,)))
        self.t_ns += MS
        ((_, _, data),) = self.network.due(self.t_ns)
        return int.from_bytes(data[2:], "little", signed=True)

    def move(self, qd, cycles):
        """Move for `cycles`, or until the module is no longer in its mode."""
        mode = self.network.safety_mode
        for cycle in range(cycles):
            self.q = self.q + np.array(qd) * CYCLE_NS * 1e-9
            self.motors.position = TRANSMISSION.counts(self.q)
            self.network.receive(self.t_ns, 0x404, b"\x30")
            self.t_ns += CYCLE_NS
            self.network.advance(self.t_ns)
            if self.network.safety_mode is not mode:
                return cycle + 1
        return cycles

    @property
    def mode(self):
        return self.network.safety_mode

    @property
    def velocity(self):
        return self.network.pendant_state.velocity


def joint(number, speed):
    qd = np.zeros(7)
    qd[number - 1] = speed
    return qd


# With q2 = 90 degrees the elbow is 0.55 m from the axes of joints 1 and 2; the forearm
# point 0.35 m from that of joint 4. Rounding of counts is worth 0.01 m/s here.
@pytest.mark.parametrize(
    ("number", "arm"), [(1, 0.55), (2, 0.55), (4, 0.35)], ids=["j1", "j2", "j4"]
)
@pytest.mark.parametrize(
    ("speed", "level", "mode"),
    [
        (0.45, SafetyLevel.SAFE, SafetyMode.ACTIVE),
        (0.55, SafetyLevel.WARNING, SafetyMode.ACTIVE),
        (0.95, SafetyLevel.WARNING, SafetyMode.ACTIVE),
        (-1.05, SafetyLevel.FAULT, SafetyMode.IDLE),
    ],
)
def test_the_speed_of_elbow_and_forearm_is_judged(number, arm, speed, level, mode):
    host = Host()
    host.move(joint(number, speed / arm), 20)
    assert (host.velocity, host.mode) == (level, mode)


def test_speeds_of_elbow_and_forearm_add_up():
    host = Host()
    host.move(joint(2, 0.6 / 0.55) + joint(4, 0.6 / 0.35), 20)
    assert host.mode is SafetyMode.IDLE


def test_an_elbow_on_the_axis_of_joint_1_does_not_move():
    host = Host(q=np.zeros(7))
    host.move(joint(1, 4.0), 20)
    assert host.velocity is SafetyLevel.SAFE


def test_the_wrist_is_not_counted():
    host = Host()
    host.move([0, 0, 0, 0, 4.0, 4.0, 4.0], 20)
    assert host.velocity is SafetyLevel.SAFE


def test_a_fast_slip_of_the_foot_is_not_a_fault():
    host = Host(q=START_Q)
    for _ in range(60):
        J = MODEL.sole_jacobian(host.q)[:3]
        slip = np.linalg.pinv(J) @ np.array([-0.43, 0.0, 0.0])
        assert host.move(slip, 1) == 1
        assert host.mode is SafetyMode.ACTIVE
    assert host.velocity is not SafetyLevel.FAULT


def test_a_warning_clears_itself_but_a_fault_needs_shift_idle():
    host = Host()
    host.move(joint(2, 1.2), 10)
    assert host.velocity is SafetyLevel.WARNING
    host.move(joint(2, 0.0), 10)
    assert host.velocity is SafetyLevel.SAFE
    host.move(joint(2, 2.0), 10)
    host.move(joint(2, 0.0), 10)
    assert host.velocity is SafetyLevel.FAULT
    host.network.pendant("activate")
    assert host.mode is SafetyMode.IDLE
    host.network.pendant("idle")
    host.network.pendant("activate")
    assert (host.velocity, host.mode) == (SafetyLevel.SAFE, SafetyMode.ACTIVE)


def test_a_velocity_fault_is_one_bit_of_the_word():
    host = Host()
    host.move(joint(2, 2.0), 10)
    assert decode_pendant(host.ask(43) & 0xFFFFFFFF).faults == ("velocity",)


def test_a_lasting_excess_speed_removes_power():
    host = Host()
    host.move(joint(1, 2.2), 10)
    assert host.mode is SafetyMode.IDLE
    cycles = host.move(joint(1, 2.2), 300)
    assert host.mode is SafetyMode.E_STOP
    assert 240 <= cycles <= 252  # 0.5 s less the first movement
    assert host.motors.is_idle


def test_a_speed_reduced_in_time_keeps_power():
    host = Host()
    host.move(joint(1, 2.2), 10)
    for _ in range(3):
        host.move(joint(1, 2.2), 200)
        host.move(joint(1, 0.0), 10)
    assert host.mode is SafetyMode.IDLE


def test_a_fault_limit_of_zero_is_off():
    host = Host()
    host.tell(VL2, 0)
    host.move(joint(1, 6.0), 300)
    assert (host.velocity, host.mode) == (SafetyLevel.WARNING, SafetyMode.ACTIVE)


def test_another_limit_is_obeyed():
    host = Host()
    host.tell(VL2, 8192)  # 2 m/s
    host.move(joint(1, 1.9 / 0.55), 20)
    assert host.mode is SafetyMode.ACTIVE
    host.move(joint(1, 2.1 / 0.55), 20)
    assert host.mode is SafetyMode.IDLE


@pytest.mark.parametrize(
    ("number", "speed", "mode"),
    [
        (1, 0.95, SafetyMode.ACTIVE),
        (1, 1.05, SafetyMode.IDLE),
        (3, 1.05, SafetyMode.IDLE),  # moves neither elbow nor forearm point
    ],
)
def test_an_arm_that_is_not_zeroed_is_judged_by_joint_speeds(number, speed, mode):
    host = Host(is_zeroed=False)
    host.move(joint(number, speed), 20)
    assert host.mode is mode


def jump(host):
    """Move motor 1 to another position at once."""
    host.q = host.q + joint(1, 0.05)


def test_a_jump_of_the_positions_is_a_fault():
    host = Host()
    host.move(np.zeros(7), 10)
    jump(host)
    assert host.move(np.zeros(7), 10) == 1
    assert host.velocity is SafetyLevel.FAULT


@pytest.mark.parametrize(("ignored", "left"), [(5, 0), (8, 3)])
def test_a_jump_uses_up_its_ignored_faults(ignored, left):
    host = Host()
    host.move(np.zeros(7), 10)
    host.tell(IFAULT, ignored)
    jump(host)
    host.move(np.zeros(7), 10)
    assert (host.velocity, host.mode) == (SafetyLevel.SAFE, SafetyMode.ACTIVE)
    assert host.ask(IFAULT) == left


def test_fewer_ignored_faults_are_not_enough_for_a_jump():
    host = Host()
    host.move(np.zeros(7), 10)
    host.tell(IFAULT, 4)
    jump(host)
    assert host.move(np.zeros(7), 10) == 5
    assert host.mode is SafetyMode.IDLE


def test_ignored_faults_do_not_count_down_at_rest():
    host = Host()
    host.tell(IFAULT, 5)
    host.move(joint(2, 1.2), 50)
    assert host.ask(IFAULT) == 5


def test_a_fault_while_idle_bars_the_activation():
    host = Host()
    host.network.pendant("idle")
    host.move(np.zeros(7), 10)
    jump(host)
    host.move(np.zeros(7), 10)
    host.network.pendant("activate")
    assert host.mode is SafetyMode.IDLE


def test_speeds_are_reset_by_a_stop():
    watch = SpeedMonitor((4096,) * 7)
    watch.on_positions(0, {1: 0})
    watch.on_positions(CYCLE_NS, {1: 100_000})
    assert watch.joint_speed() > 100
    watch.reset()
    watch.on_positions(2 * CYCLE_NS, {1: -100_000})
    assert watch.joint_speed() == 0.0


@pytest.mark.parametrize(
    ("voltage", "level", "mode"),
    [
        (48.0, SafetyLevel.SAFE, SafetyMode.ACTIVE),
        (36.0, SafetyLevel.SAFE, SafetyMode.ACTIVE),
        (35.9, SafetyLevel.WARNING, SafetyMode.ACTIVE),
        (54.1, SafetyLevel.WARNING, SafetyMode.ACTIVE),
        (30.0, SafetyLevel.WARNING, SafetyMode.ACTIVE),
        (57.0, SafetyLevel.WARNING, SafetyMode.ACTIVE),
        (29.9, SafetyLevel.FAULT, SafetyMode.E_STOP),
        (57.1, SafetyLevel.FAULT, SafetyMode.E_STOP),
    ],
)
def test_the_bus_voltage_is_judged(voltage, level, mode):
    host = Host()
    host.network.set_bus_voltage(voltage)
    assert (host.network.pendant_state.voltage, host.mode) == (level, mode)


def test_a_voltage_fault_returns_until_the_voltage_does():
    host = Host()
    host.network.set_bus_voltage(20.0)
    host.network.pendant("idle")
    assert host.mode is SafetyMode.E_STOP
    host.network.set_bus_voltage(48.0)
    host.network.pendant("idle")
    assert host.mode is SafetyMode.IDLE
    assert host.network.pendant_state.faults == ()


def test_pucks_measure_the_bus_voltage():
    host = Host()
    host.network.set_bus_voltage(44.6)
    host.network.due(host.t_ns)
    host.network.receive(host.t_ns, 3, b"\x15")
    ((_, can_id, data),) = host.network.due(host.t_ns + MS)
    assert (can_id, data.hex(" ")) == (0x466, "95 00 2d 00")


@pytest.mark.parametrize("name", [32, 31], ids=["DEF", "LOAD"])
@pytest.mark.parametrize(
    ("number", "value"), [(VL1, 2048), (VL2, 4096), (47, 4731), (48, 5204)]
)
def test_default_and_load_restore_a_limit(name, number, value):
    host = Host()
    host.tell(number, 1234)
    assert host.ask(number) == 1234
    host.tell(name, number)
    assert host.ask(number) == value


def test_default_of_another_property_changes_nothing():
    host = Host()
    host.tell(32, ZERO)
    assert host.ask(ZERO) == 1


def test_a_disobedient_module_stays_active_until_repaired():
    host = Host()
    host.network.disobey()
    host.tell(8, SafetyMode.IDLE)
    assert host.mode is SafetyMode.ACTIVE
    host.network.disobey(is_disobedient=False)
    host.tell(8, SafetyMode.IDLE)
    assert host.mode is SafetyMode.IDLE
