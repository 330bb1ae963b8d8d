"""Requests to a simulated rig in another process, with handlers and client."""

import base64
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal, Protocol

import numpy as np

from acquisition.ipc.requests import Answer, Handlers, Request
from acquisition.sample import Record
from acquisition.schema import TRUTH
from acquisition.simulation import PendantAction, ServedDevices, SimulationControl

Order = Literal["lift", "rest", "take", "let_go", "put_down", "push"]
Side = Literal["low", "high"]


@dataclass(frozen=True, slots=True)
class AskDevices(Request[ServedDevices]):
    """Request the addresses of the devices."""


@dataclass(frozen=True, slots=True)
class OrderHand(Request[None]):
    """Start an action of the hand without parameters; see `SimulationControl`."""

    order: Order


@dataclass(frozen=True, slots=True)
class PoseArm(Request[None]):
    """See `Hands.pose`."""

    q: list[float]
    seconds: float


@dataclass(frozen=True, slots=True)
class TurnToStop(Request[None]):
    """See `Hands.turn_to_stop`."""

    joint: int
    side: Side


@dataclass(frozen=True, slots=True)
class HangMass(Request[None]):
    """See `Hands.hang`."""

    mass: float


@dataclass(frozen=True, slots=True)
class PushFoot(Request[None]):
    """See `Hands.push_with`."""

    force: list[float]
    seconds: float


@dataclass(frozen=True, slots=True)
class TwistFoot(Request[None]):
    """See `Hands.twist`."""

    torque: float
    seconds: float


@dataclass(frozen=True, slots=True)
class AskHandDone(Request[bool]):
    """See `Hands.is_hand_done`."""


@dataclass(frozen=True, slots=True)
class RakeGround(Request[None]):
    """See `SimulationControl.prepare`."""

    trial: int


@dataclass(frozen=True, slots=True)
class TouchGround(Request[None]):
    """See `SimulationControl.touch`."""

    number: int


@dataclass(frozen=True, slots=True)
class PressPendant(Request[None]):
    """See `SimulationControl.pendant`."""

    button: PendantAction


@dataclass(frozen=True, slots=True)
class AskFaults(Request[tuple[str, ...]]):
    """See `SimulationControl.fault_names`."""


@dataclass(frozen=True, slots=True)
class InjectFault(Request[None]):
    """See `SimulationControl.inject`."""

    fault: str


@dataclass(frozen=True, slots=True)
class ClearFaults(Request[None]):
    """See `SimulationControl.clear_faults`."""


@dataclass(frozen=True, slots=True)
class TakeTruth(Request[str]):
    """Take the oldest unread truth records, as base64; empty at the end.

    The number is limited, because the simulated bus waits meanwhile.
    """


@dataclass(frozen=True, slots=True)
class AskGround(Request[dict[str, str]]):
    """See `SimulationControl.parameters`."""


@dataclass(frozen=True, slots=True)
class AskFriction(Request[dict[str, list[float]]]):
    """See `SimulationControl.friction`."""


def simulation_handlers(
    simulation: SimulationControl, truth_part: Callable[[], Record]
) -> Handlers:
    """Return the handlers of all requests except `AskDevices`.

    Args:
        simulation: simulation in this process.
        truth_part: returns the next few unread traction_msgs/Truth records.
    """
    orders: dict[Order, Callable[[], None]] = {
        "lift": simulation.lift,
        "rest": simulation.rest,
        "take": simulation.take,
        "let_go": simulation.let_go,
        "put_down": simulation.put_down,
        "push": simulation.push,
    }

    def carry_out(order: Order) -> None:
        orders[order]()

    def take_truth() -> str:
        return base64.b64encode(truth_part().tobytes()).decode()

    return {
        OrderHand: carry_out,
        PoseArm: simulation.pose,
        TurnToStop: simulation.turn_to_stop,
        HangMass: simulation.hang,
        PushFoot: simulation.push_with,
        TwistFoot: simulation.twist,
        AskHandDone: lambda: simulation.is_hand_done,
        RakeGround: simulation.prepare,
        TouchGround: simulation.touch,
        PressPendant: simulation.pendant,
        AskFaults: lambda: simulation.fault_names,
        InjectFault: simulation.inject,
        ClearFaults: simulation.clear_faults,
        TakeTruth: take_truth,
        AskGround: simulation.parameters,
        AskFriction: simulation.friction,
    }


class Asks(Protocol):
    """Function that sends a request and returns its answer, e.g. `Child.ask`."""

    def __call__(self, request: Request[Answer], /) -> Answer:
        """Return the answer."""
        ...


class RemoteSimulation:
    """A simulation in another process; implements `SimulationControl`."""

    def __init__(self, ask: Asks) -> None:
        self._ask = ask

    @property
    def is_hand_done(self) -> bool:
        """Whether the hand has finished its last action."""
        return self._ask(AskHandDone())

    def pose(self, q: Sequence[float], seconds: float) -> None:
        """Bring the joints to the true positions `q` [rad] in `seconds`."""
        self._ask(PoseArm([float(value) for value in q], seconds))

    def turn_to_stop(self, joint: int, side: Side) -> None:
        """Turn joint 1-7 against its mechanical stop and hold it there."""
        self._ask(TurnToStop(joint, side))

    def hang(self, mass: float) -> None:
        """Hang `mass` [kg] on a string from the centre of the sole; 0 removes it."""
        self._ask(HangMass(mass))

    def push_with(self, force: Sequence[float], seconds: float) -> None:
        """Push the sole with `force` [N], base frame, for `seconds`."""
        self._ask(PushFoot([float(value) for value in force], seconds))

    def twist(self, torque: float, seconds: float) -> None:
        """Twist the foot about joint 7 with `torque` [N m] for `seconds`."""
        self._ask(TwistFoot(torque, seconds))

    def prepare(self, trial: int) -> None:
        """Rake the terrain for `trial`."""
        self._ask(RakeGround(trial))

    def lift(self) -> None:
        """Lift the foot above the far end."""
        self._ask(OrderHand("lift"))

    def rest(self) -> None:
        """Stop pushing; the hand rests on the arm."""
        self._ask(OrderHand("rest"))

    def take(self) -> None:
        """Grasp the arm and hold it in place."""
        self._ask(OrderHand("take"))

    def let_go(self) -> None:
        """Release the arm."""
        self._ask(OrderHand("let_go"))

    def put_down(self) -> None:
        """Put the foot down at the far end."""
        self._ask(OrderHand("put_down"))

    def touch(self, number: int) -> None:
        """Touch the ground: corners 1 to 4, then points in between."""
        self._ask(TouchGround(number))

    def push(self) -> None:
        """Push the foot across the container; truth is recorded from now on."""
        self._ask(OrderHand("push"))

    def pendant(self, button: PendantAction) -> None:
        """Press the pendant."""
        self._ask(PressPendant(button))

    @property
    def fault_names(self) -> tuple[str, ...]:
        """Names of the faults for `inject`."""
        return self._ask(AskFaults())

    def inject(self, fault: str) -> None:
        """Inject a fault."""
        self._ask(InjectFault(fault))

    def clear_faults(self) -> None:
        """Clear the faults that do not need a restart of the arm."""
        self._ask(ClearFaults())

    def take_truth(self) -> Record:
        """Return traction_msgs/Truth records since the push began."""
        parts = b""
        while part := base64.b64decode(self._ask(TakeTruth())):
            parts += part
        return np.frombuffer(bytearray(parts), TRUTH.dtype)

    def parameters(self) -> dict[str, str]:
        """Return the true parameters of ground, arm and hand."""
        return self._ask(AskGround())

    def friction(self) -> dict[str, list[float]]:
        """Return the true friction parameters of the seven motors, by name."""
        return self._ask(AskFriction())
