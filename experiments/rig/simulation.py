"""What a session may ask of a simulation and never of a rig."""

import base64
from typing import Literal, Protocol

import numpy as np

from acquisition.ipc.child import Child
from acquisition.sample import Record
from acquisition.schema import TRUTH


class SimulationControl(Protocol):
    """What only a simulated rig can be asked; see fakes.world.rig.Rehearsal."""

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

    def rest(self) -> None:
        """Let the hand stop pushing and lie on the arm."""
        ...

    def let_go(self) -> None:
        """Let the hand let go of the arm."""
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

    def pendant(self, button: Literal["activate", "idle", "estop"]) -> None:
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
        """Return the true parameters of the ground."""
        ...


class RemoteSimulation:
    """The handle of a simulation in another process; implements `SimulationControl`."""

    def __init__(self, child: Child) -> None:
        self._child = child
        self.fault_names: tuple[str, ...] = tuple(child.ask("fault_names"))

    def prepare(self, trial: int) -> None:
        """Rake the bed for `trial`."""
        self._child.ask("prepare", trial)

    def lift(self) -> None:
        """Let the hand lift the foot above the far end."""
        self._child.ask("lift")

    def rest(self) -> None:
        """Let the hand stop pushing and lie on the arm."""
        self._child.ask("rest")

    def let_go(self) -> None:
        """Let the hand let go of the arm."""
        self._child.ask("let_go")

    def put_down(self) -> None:
        """Let the hand put the foot down there."""
        self._child.ask("put_down")

    def touch(self, number: int) -> None:
        """Let the hand touch the ground: the corners 1 to 4, then points between."""
        self._child.ask("touch", number)

    def push(self) -> None:
        """Let the hand push the foot across; the truth is written from here on."""
        self._child.ask("push")

    def pendant(self, button: Literal["activate", "idle", "estop"]) -> None:
        """Press the pendant."""
        self._child.ask("pendant", button)

    def inject(self, fault: str) -> None:
        """Let a device fail."""
        self._child.ask("inject", fault)

    def clear_faults(self) -> None:
        """End every fault that can be ended without the arm."""
        self._child.ask("clear_faults")

    def take_truth(self) -> Record:
        """Return traction_msgs/Truth records since the push began."""
        parts = bytearray()
        while part := base64.b64decode(self._child.ask("truth_part")):
            parts += part
        return np.frombuffer(parts, TRUTH.dtype)

    def parameters(self) -> dict[str, str]:
        """Return the true parameters of the ground."""
        return self._child.ask("parameters")
