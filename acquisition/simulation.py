"""Interface to control a simulated rig, in this process or another."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, Protocol

from acquisition.sample import Record

PendantAction = Literal["activate", "idle", "estop"]

ENDS = 100  # touch numbers above it alternate between near end and far end


class Hands(Protocol):
    """A simulated person who moves the arm by hand and loads its foot."""

    @property
    def is_hand_done(self) -> bool:
        """Whether the hand has finished its last action and holds still."""
        ...

    def pose(self, q: Sequence[float], seconds: float) -> None:
        """Bring the joints to the true positions `q` [rad], shape (7,), in `seconds`.

        Two hands support the arm's weight and hold it there until the next action or
        `let_go`. Joint stops give way only elastically. The container is removed.
        """
        ...

    def turn_to_stop(self, joint: int, side: Literal["low", "high"]) -> None:
        """Turn joint 1-7 against its mechanical stop and hold it there.

        The other joints are held in place. The container is removed.
        """
        ...

    def let_go(self) -> None:
        """Release the arm."""
        ...

    def hang(self, mass: float) -> None:
        """Hang `mass` [kg] on a string from the centre of the sole; 0 removes it.

        The string follows the true direction of gravity.
        """
        ...

    def push_with(self, force: Sequence[float], seconds: float) -> None:
        """Push the sole with `force` [N], base frame, shape (3,), for `seconds`."""
        ...

    def twist(self, torque: float, seconds: float) -> None:
        """Twist the foot about joint 7 with `torque` [N m] for `seconds`."""
        ...


class SimulationControl(Hands, Protocol):
    """Hand, pendant, ground and faults of a simulated rig."""

    @property
    def fault_names(self) -> tuple[str, ...]:
        """Names of the faults for `inject`."""
        ...

    def prepare(self, trial: int) -> None:
        """Rake the terrain for `trial`."""
        ...

    def lift(self) -> None:
        """Lift the foot above the far end."""
        ...

    def rest(self) -> None:
        """Stop pushing; the hand rests on the arm."""
        ...

    def take(self) -> None:
        """Grasp the arm and hold it in place."""
        ...

    def put_down(self) -> None:
        """Put the foot down."""
        ...

    def touch(self, number: int) -> None:
        """Touch the ground: corners 1 to 4, then points in between."""
        ...

    def push(self) -> None:
        """Push the foot across the container; truth is recorded from now on."""
        ...

    def pendant(self, button: PendantAction) -> None:
        """Press the pendant."""
        ...

    def inject(self, fault: str) -> None:
        """Inject a fault."""
        ...

    def clear_faults(self) -> None:
        """Clear the faults that do not need a restart of the arm."""
        ...

    def take_truth(self) -> Record:
        """Return traction_msgs/Truth records since the push began."""
        ...

    def parameters(self) -> dict[str, str]:
        """Return the true parameters of ground, arm and hand."""
        ...

    def friction(self) -> dict[str, list[float]]:
        """Return the true friction parameters of the seven motors, by name."""
        ...


@dataclass(frozen=True, slots=True)
class ServedDevices:
    """Addresses of the devices of a simulated rig.

    Attributes:
        interface: python-can's name of the CAN adapter.
        channel: CAN channel.
        bitrate: bit rate of the CAN bus [bit/s].
        port: path of the serial sensor.
    """

    interface: str
    channel: str
    bitrate: int
    port: str
