"""Fault injection in the simulated arm and its bus, by the names of a rehearsal."""

from collections.abc import Callable, Iterable
from functools import partial
from typing import Protocol

from acquisition.clock import PERIOD_NS
from fakes.plant.plant import ArmPlant
from fakes.pucks.bus_faults import BusFaults
from fakes.pucks.event_queue import FRAME_NS
from fakes.pucks.network import PuckNetwork
from fakes.pucks.safety_module import NOMINAL_VOLTAGE
from fakes.sensor.errors import NO_SHIFT
from fakes.sensor.stream import SensorStream
from wam.bus.frames import (
    MOTOR_NODES,
    SAFETY_NODE,
    SENSOR_NODE,
    Group,
    decode_position,
    encode_position,
    group_id,
    position_reply_id,
)

PUCK = 3  # the failing puck: its joint carries little load, so the arm stays up
FOREIGN_LOAD = 0.6  # bus load, half above and half below the arm's priority
_OTHER_NODE = 20  # node of a second master
_LOW_VOLTAGE = 20.0  # below the limit of the safety module [V]
_OTHER_IPNM = 2500  # wrong motor constant reported by PUCK
_HOT = 72  # above OTEMP [degrees Celsius]
_USUAL = {"TEMP": 35, "ERROR": 0}
# A reply delayed by six others comes last; one delayed by almost a cycle comes between
# the next request and its reply.
_AFTER_THE_OTHERS_NS = 7 * FRAME_NS[3]
_AFTER_NEXT_REQUEST_NS = 1_950_000
_LATE_EVERY = 50  # cycles
# Late by one cycle and by two: mistaken for the replies of the current cycle.
_PAST_NS, _LONG_PAST_NS = 2_000_000, 3_950_000
_LOSING_MODE = (2, 4, 7)  # pucks
LAST_PUCK = 7  # the last to reply in a cycle
_TWIN_NS, _TWIN_COUNTS = 50_000, 100  # delay and offset of a second puck's replies
_LOST_SHARE = 0.01  # lost share of the replies of each puck


def network_faults(network: PuckNetwork) -> dict[str, Callable[[], None]]:
    """Return the network faults by name; `clear_network_faults` undoes them."""
    faults = network.faults
    return {
        **_reply_faults(faults),
        "puck-missing": lambda: network.silence(5),
        "puck-silent": lambda: network.silence(PUCK),
        "puck-reboot": lambda: network.reboot(PUCK),
        "puck-hot": lambda: network.set_property(PUCK, "TEMP", _HOT),
        "puck-changed": lambda: network.set_property(PUCK, "IPNM", _OTHER_IPNM),
        **{
            f"mode-lost-{node}": partial(network.lose_mode, node)
            for node in _LOSING_MODE
        },
        "puck-restart": lambda: network.restart_at_once(LAST_PUCK),
        "torques-lost": lambda: _lose_torques(faults, Group.LOWER_TORQUE),
        "torques-lost-wrist": lambda: _lose_torques(faults, Group.WRIST_TORQUE),
        "puck-error": lambda: network.set_property(PUCK, "ERROR", 7),
        "can-silence": lambda: _silence_all(network),
        "bus-off": faults.go_off,
        "interface-down": faults.go_down,
        "unacknowledged": faults.stop_acknowledging,
        "can-down": faults.go_down,
        "not-zeroed": network.forget_positions,
        "bus-shared": network.other_master.join,
        "bus-shared-as-node": lambda: network.other_master.join(_OTHER_NODE),
        "bus-flooded": lambda: faults.flood(FOREIGN_LOAD),
        "safety-speed": lambda: network.trip("velocity"),
        "safety-torque": lambda: network.trip("torque"),
        "safety-heartbeat": lambda: network.trip("heartbeat"),
        "safety-voltage": lambda: network.set_bus_voltage(_LOW_VOLTAGE),
        "position-jump": lambda: network.faults.corrupt(
            position_reply_id(PUCK), 1, None
        ),
        "safety-silent": lambda: network.silence(SAFETY_NODE),
        "safety-disobedient": network.disobey,
        "safety-false-idle": lambda: _report_false_idle(network),
        "estop": lambda: network.pendant("estop"),
        "pendant-idle": lambda: network.pendant("idle"),
    }


def clear_network_faults(network: PuckNetwork) -> None:
    """Clear every fault that needs no action at the arm.

    Faults latched by the safety module wait for Shift-idle; a rebooted puck sleeps
    until a start-up wakes it and must be zeroed, as on a real arm.
    """
    network.faults.clear_faults()
    network.other_master.leave()
    network.reset_monitors()
    for node in (SAFETY_NODE, SENSOR_NODE):
        network.silence(node, is_mute=False)
    network.disobey(is_disobedient=False)
    network.report_false_idle(reports_idle=False)
    network.set_bus_voltage(NOMINAL_VOLTAGE)
    network.set_property(PUCK, "IPNM", network.options.ipnm[PUCK - 1])
    for node in MOTOR_NODES:
        network.silence(node, is_mute=False)
        network.deafen(node, is_deaf=False)
        for name, value in _USUAL.items():
            network.set_property(node, name, value)


def _reply_faults(faults: BusFaults) -> dict[str, Callable[[], None]]:
    """Return the faults of the position replies by name."""
    reply = position_reply_id(PUCK)
    return {
        "reply-lost": lambda: faults.drop(reply),
        "reply-lost-3": lambda: faults.drop(reply, 3),
        "reply-lost-10": lambda: faults.drop(reply, 10),
        "reply-lost-some": lambda: _lose_a_share(faults),
        "reply-late": lambda: _answer_too_late(faults),
        "replies-late": lambda: _answer_always_late(faults, MOTOR_NODES, _PAST_NS),
        "puck-late": lambda: _answer_always_late(faults, [LAST_PUCK], _LONG_PAST_NS),
        "reply-doubled": lambda: faults.duplicate(reply, 3),
        "puck-doubled": lambda: faults.answer_twice(reply, _second_position, _TWIN_NS),
        "reply-swapped": lambda: _swap_replies(faults),
        "reply-spoilt": lambda: faults.corrupt(reply, 0, 3),
    }


def _answer_always_late(faults: BusFaults, nodes: Iterable[int], late_ns: int) -> None:
    """Delay every reply of `nodes` permanently by `late_ns`, about whole cycles."""
    for node in nodes:
        faults.delay(position_reply_id(node), late_ns, None)


def _second_position(reply: bytes) -> bytes:
    """Return the reply of a second puck; the sole differs by some millimetres."""
    return encode_position(decode_position(reply) + _TWIN_COUNTS)


def _lose_a_share(faults: BusFaults) -> None:
    for node in MOTOR_NODES:
        faults.drop(position_reply_id(node), None, _LOST_SHARE)


def _report_false_idle(network: PuckNetwork) -> None:
    """Make the module report IDLE and ignore commands."""
    network.disobey()
    network.report_false_idle()


def _lose_torques(faults: BusFaults, group: Group) -> None:
    """Lose the torque frames of one group of motors."""
    faults.lose_from_host(lambda can_id, _: can_id == group_id(group))


def _silence_all(network: PuckNetwork) -> None:
    for node in MOTOR_NODES:
        network.silence(node)


def _swap_replies(faults: BusFaults) -> None:
    """Delay puck 3 after puck 7, and puck 6 now and then past the next request."""
    faults.delay(position_reply_id(3), _AFTER_THE_OTHERS_NS, count=None)
    _answer_too_late(faults)


def _answer_too_late(faults: BusFaults) -> None:
    faults.delay(position_reply_id(6), _AFTER_NEXT_REQUEST_NS, None, every=_LATE_EVERY)


_JOINT_6, _JOINT_7 = 5, 6
# A blow within the driver's plausible range [rad/s]; the safety module ignores the
# wrist, so the guard acts.
_BLOW = 10.0
# The joint lock of 20 N m/rad deflects by 50 mrad, where it counts as slipped, at
# 1 N m; the joint torque limit is 1.3 N m. A sudden twist would overshoot, so it ramps.
_TWIST, _TWIST_STEP = 1.2, 0.02  # N m
_LOAD = (0.0, 0.0, 120.0)  # on the foot, above the force limit of a trial [N]
_FINGER = (0.0, 0.0, 3.2)  # at the hanging sole, terrain frame [N]

Later = Callable[[int, Callable[[], None]], None]  # (delay [ns], action)


class BodyFaults:
    """Pushes and twists the arm until `clear_faults`; `later` schedules an action."""

    def __init__(self, plant: ArmPlant, later: Later) -> None:
        self._plant = plant
        self._later = later
        self._is_twisting = False

    def by_name(self) -> dict[str, Callable[[], None]]:
        """Return the faults of the arm by name."""
        return {
            "overspeed": self._hit,
            "joint7-slip": self._begin_twist,
            "residual": self._touch,
            "tare-moved": self._touch,
            "contact-force": self._load_foot,
        }

    def clear_faults(self) -> None:
        """Remove every torque and force on the foot."""
        self._plant.finger = (0.0, 0.0, 0.0)
        self._is_twisting = False
        self._plant.disturbance[_JOINT_7] = 0.0

    def _hit(self) -> None:
        if not self._plant.is_idle:  # a blow to damped joints has no effect
            self._plant.qd[_JOINT_6] = _BLOW

    def _touch(self) -> None:
        self._plant.finger = _FINGER

    def _load_foot(self) -> None:
        self._plant.finger = _LOAD

    def _begin_twist(self) -> None:
        self._is_twisting = True
        self._twist()

    def _twist(self) -> None:
        if not self._is_twisting:
            return
        torque = self._plant.disturbance[_JOINT_7] + _TWIST_STEP
        self._plant.disturbance[_JOINT_7] = min(torque, _TWIST)
        self._later(PERIOD_NS, self._twist)


class Cable(Protocol):
    """The cable between a serial sensor and its reader."""

    def unplug(self) -> None:
        """Unplug the cable."""
        ...

    def plug_in(self) -> None:
        """Plug the cable in again."""
        ...


_F_Z = 2  # index in a wrench
CLOCK_JUMP_US = 10_000_000
_JUMP = (1.5, 0.0, -1.5, 0.0, 0.0, 0.0)  # zero shift, too large to tare [N, N m]


def stream_faults(
    stream: SensorStream, unplug: Callable[[], None], now_ns: Callable[[], int]
) -> dict[str, Callable[[], None]]:
    """Return the faults of a sensor on a serial port by name.

    Args:
        stream: the sensor.
        unplug: unplugs the cable.
        now_ns: returns the time of the simulation [ns].
    """
    faults = stream.faults
    return {
        "ft-silent": stream.go_silent,
        "ft-stale": stream.go_silent,
        "ft-frozen": faults.freeze,
        "ft-stuck": lambda: faults.freeze(_F_Z),
        "ft-garbled": lambda: setattr(faults, "is_garbled", True),
        "ft-saturated": stream.saturate,
        "ft-not-a-number": lambda: setattr(faults, "is_nonsense", True),
        "ft-unplugged": unplug,
        "ft-reboot": lambda: stream.reset(now_ns()),
        "ft-jump": lambda: _shift_zero(stream),
        "ft-clock-jump": lambda: stream.jump_clock(CLOCK_JUMP_US),
    }


def clear_stream_faults(stream: SensorStream) -> None:
    """Clear every fault of a sensor on a serial port except an unplugged cable."""
    stream.recover()
    if stream.errors is not None:
        stream.errors.shift = NO_SHIFT


def _shift_zero(stream: SensorStream) -> None:
    if stream.errors is not None:
        stream.errors.shift = _JUMP


def bus_sensor_faults(network: PuckNetwork) -> dict[str, Callable[[], None]]:
    """Return the faults of a sensor on the arm's bus by name."""
    return {
        "ft-silent": lambda: network.silence(SENSOR_NODE),
        "ft-stale": lambda: network.silence(SENSOR_NODE),
        "ft-reboot": lambda: network.reboot(SENSOR_NODE),
    }
