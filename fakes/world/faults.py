"""Faults of the simulated arm and its bus by the names a rehearsal calls them."""

from collections.abc import Callable

from fakes.pucks.bus_faults import BusFaults
from fakes.pucks.event_queue import FRAME_NS
from fakes.pucks.network import PuckNetwork
from fakes.pucks.safety_module import NOMINAL_VOLTAGE
from wam.bus.frames import MOTOR_NODES, position_reply_id

PUCK = 3  # of those that fail alone: its joint carries little, the arm stays up
FOREIGN_LOAD = 0.6  # of the bus, half of it before the arm's frames and half after
_LOW_VOLTAGE = 20.0  # below what the safety module tolerates [V]
_HOT = 72  # above OTEMP [degrees Celsius]
_USUAL = {"TEMP": 35, "ERROR": 0}
# A reply that waits for six others comes last; one that waits for almost a cycle comes
# between the next question and its answer.
_BEHIND_THE_OTHERS_NS = 7 * FRAME_NS[3]
_BEHIND_THE_NEXT_QUESTION_NS = 1_950_000
_LATE_EVERY = 50  # cycles
_LOST_SHARE = 0.01  # of the replies of each puck


def network_faults(network: PuckNetwork) -> dict[str, Callable[[], None]]:
    """Return what each name does to the network; `mend_network` undoes it."""
    faults = network.faults
    return {
        **_reply_faults(faults),
        "puck-missing": lambda: network.silence(5),
        "puck-silent": lambda: network.silence(PUCK),
        "puck-reboot": lambda: network.reboot(PUCK),
        "puck-hot": lambda: network.set_property(PUCK, "TEMP", _HOT),
        "puck-error": lambda: network.set_property(PUCK, "ERROR", 7),
        "can-silence": lambda: _silence_all(network),
        "bus-off": faults.go_off,
        "can-down": faults.go_off,
        "not-zeroed": network.forget_positions,
        "bus-flooded": lambda: faults.flood(FOREIGN_LOAD),
        "safety-speed": lambda: network.strain("velocity"),
        "safety-torque": lambda: network.strain("torque"),
        "safety-heartbeat": lambda: network.strain("heartbeat"),
        "safety-voltage": lambda: network.set_bus_voltage(_LOW_VOLTAGE),
        "estop": lambda: network.pendant("estop"),
        "pendant-idle": lambda: network.pendant("idle"),
    }


def mend_network(network: PuckNetwork) -> None:
    """End every fault that can be ended without the arm.

    What the safety module latched waits for Shift-idle; a puck that rebooted sleeps
    until a start-up wakes it and has to be zeroed, as on a real arm.
    """
    network.faults.mend()
    network.relax()
    network.set_bus_voltage(NOMINAL_VOLTAGE)
    for node in MOTOR_NODES:
        network.silence(node, is_mute=False)
        for name, value in _USUAL.items():
            network.set_property(node, name, value)


def _reply_faults(faults: BusFaults) -> dict[str, Callable[[], None]]:
    """Return what may happen to the positions on their way to the host."""
    reply = position_reply_id(PUCK)
    return {
        "reply-lost": lambda: faults.drop(reply),
        "reply-lost-3": lambda: faults.drop(reply, 3),
        "reply-lost-10": lambda: faults.drop(reply, 10),
        "reply-lost-some": lambda: _lose_some(faults),
        "reply-late": lambda: _answer_too_late(faults),
        "reply-doubled": lambda: faults.duplicate(reply, None),
        "reply-swapped": lambda: _swap_replies(faults),
        "reply-spoilt": lambda: faults.corrupt(reply, 0, 3),
    }


def _lose_some(faults: BusFaults) -> None:
    for node in MOTOR_NODES:
        faults.drop(position_reply_id(node), None, _LOST_SHARE)


def _silence_all(network: PuckNetwork) -> None:
    for node in MOTOR_NODES:
        network.silence(node)


def _swap_replies(faults: BusFaults) -> None:
    """Let puck 3 answer after puck 7, and puck 6 now and then a question too late."""
    faults.delay(position_reply_id(3), _BEHIND_THE_OTHERS_NS, count=None)
    _answer_too_late(faults)


def _answer_too_late(faults: BusFaults) -> None:
    faults.delay(
        position_reply_id(6), _BEHIND_THE_NEXT_QUESTION_NS, None, every=_LATE_EVERY
    )
