"""What a simulated rig offers beyond a real one, whichever process it runs in."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, Protocol

from acquisition.sample import Record

PendantAction = Literal["activate", "idle", "estop"]

ENDS = 100  # numbers of touches above it: the near end, the far end, and again


class Hands(Protocol):
    """A person who brings a simulated arm to poses and loads its foot."""

    @property
    def is_hand_done(self) -> bool:
        """Whether the hand has come to the end of its last order, and holds still."""
        ...

    def pose(self, q: Sequence[float], seconds: float) -> None:
        """Let two hands bring the joints truly to `q` [rad] in `seconds`, shape (7,).

        They bear the arm's weight and hold it there until another order, or `let_go`.
        No stop lets a joint further than it gives. The container is out of the way.
        """
        ...

    def turn_to_stop(self, joint: int, side: Literal["low", "high"]) -> None:
        """Let two hands turn joint 1-7 until its mechanical stop bears.

        They hold it there, and the other joints where they are. The container is out
        of the way.
        """
        ...

    def let_go(self) -> None:
        """Let the hand let go of the arm."""
        ...

    def hang(self, mass: float) -> None:
        """Hang `mass` [kg] on a string from the centre of the sole; 0 takes it off.

        It pulls where gravity truly does.
        """
        ...

    def push_with(self, force: Sequence[float], seconds: float) -> None:
        """Push the sole with `force` [N] in the base frame, shape (3,), so long [s]."""
        ...

    def twist(self, torque: float, seconds: float) -> None:
        """Twist the foot about joint 7 with `torque` [N m] so long [s]."""
        ...


class SimulationControl(Hands, Protocol):
    """Hand, pendant, ground and faults of a simulated rig."""

    @property
    def fault_names(self) -> tuple[str, ...]:
        """Names that `inject` knows."""
        ...

    def prepare(self, trial: int) -> None:
        """Rake the terrain for `trial`."""
        ...

    def lift(self) -> None:
        """Let the hand lift the foot above the far end."""
        ...

    def rest(self) -> None:
        """Let the hand stop pushing and lie on the arm."""
        ...

    def take(self) -> None:
        """Let the hand take the arm where it is and hold it there."""
        ...

    def put_down(self) -> None:
        """Let the hand put the foot down there."""
        ...

    def touch(self, number: int) -> None:
        """Let the hand touch the ground: the corners 1 to 4, then points between."""
        ...

    def push(self) -> None:
        """Let the hand push the foot across; the truth is written from here on."""
        ...

    def pendant(self, button: PendantAction) -> None:
        """Press the pendant."""
        ...

    def inject(self, fault: str) -> None:
        """Let a device fail."""
        ...

    def clear_faults(self) -> None:
        """End every fault that can be ended without the arm."""
        ...

    def take_truth(self) -> Record:
        """Return traction_msgs/Truth records since the push began."""
        ...

    def parameters(self) -> dict[str, str]:
        """Return the true parameters of the ground, and what moves the arm."""
        ...

    def friction(self) -> dict[str, list[float]]:
        """Return the true friction of the seven motors, by the names of its model."""
        ...


@dataclass(frozen=True, slots=True)
class ServedDevices:
    """Where the devices of a simulated rig can be reached.

    Attributes:
        interface: of its CAN bus, in python-can's words.
        channel: of its CAN bus.
        bitrate: of its CAN bus [bit/s].
        port: path of its serial sensor.
    """

    interface: str
    channel: str
    bitrate: int
    port: str
