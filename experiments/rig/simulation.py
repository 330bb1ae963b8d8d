"""What a simulated rig offers beyond a real one, and the hand of its operator."""

import base64
from typing import Literal, Protocol

import numpy as np

from acquisition.ipc.child import Child
from acquisition.sample import Record
from acquisition.schema import TRUTH
from experiments.operator.prompts import Prompt, PromptState


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


_ASIDE = frozenset({Prompt.PAUSED, Prompt.NOTE})  # the hand stays where it is


class SimulatedHand:
    """Moves the simulated hand and pendant as the prompts ask."""

    def __init__(self, simulation: SimulationControl) -> None:
        self._simulation = simulation
        self._seen: tuple[Prompt, int, int] | None = None

    def follow(self, state: PromptState) -> None:
        """Do what a person would do at this prompt; once per prompt."""
        key = (state.prompt, state.trial, state.attempt)
        if key == self._seen or state.prompt in _ASIDE:
            return
        self._seen = key
        if state.prompt is Prompt.SUPPORT:
            self._simulation.lift()
            self._simulation.pendant("activate")
        elif state.prompt is Prompt.LIFT:
            self._simulation.lift()
        elif state.prompt is Prompt.CLEAR:
            self._simulation.let_go()
        elif state.prompt is Prompt.TOUCH:
            self._simulation.touch(state.trial)
        elif state.prompt is Prompt.READY:
            self._simulation.prepare(state.trial + 1000 * (state.attempt - 1))
            self._simulation.put_down()
        elif state.prompt is Prompt.RECORDING:
            self._simulation.push()
        elif state.prompt is Prompt.REVIEW:
            self._simulation.rest()
