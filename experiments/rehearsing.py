"""What a session may ask of a simulation and never of a rig."""

from typing import Literal, Protocol

from acquisition.sample import Record


class Rehearsing(Protocol):
    """What only a simulated rig can be asked; see fakes.rig.Rehearsal."""

    @property
    def fault_names(self) -> tuple[str, ...]:
        """Names that `inject` knows."""
        ...

    def prepare(self, trial: int) -> None:
        """Rake the bed for `trial`."""
        ...

    def lift(self) -> None:
        """Let the hand lift the foot above the far end."""
        ...

    def put_down(self) -> None:
        """Let the hand put the foot down there."""
        ...

    def push(self) -> None:
        """Let the hand push the foot across; the truth is written from here on."""
        ...

    def pendant(self, button: Literal["activate", "idle", "estop"]) -> None:
        """Press the pendant."""
        ...

    def inject(self, fault: str) -> None:
        """Let a device fail."""
        ...

    def mend(self) -> None:
        """End every fault that can be ended without the arm."""
        ...

    def take_truth(self) -> Record:
        """Return traction_msgs/Truth records since the push began."""
        ...

    def parameters(self) -> dict[str, str]:
        """Return the true parameters of the ground."""
        ...
