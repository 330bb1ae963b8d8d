"""Records the parts that the program builds for a session."""

from dataclasses import dataclass, field

import pytest

from acquisition.clock import Clock
from acquisition.control_loop.cycle import Cycle
from acquisition.ipc.loop_server import LoopServer
from experiments.rig import build, fake
from experiments.rig.backend import InProcessBackend
from fakes.world import plain_world
from fakes.world.rig import FakeRig


@dataclass(slots=True)
class Built:
    """Everything that was built, oldest first; public constructors are watched.

    Attributes:
        rigs: the simulated rigs.
        clocks: clocks of the simulated rigs.
        backends: backends of this process.
        cycles: cycles of their loops; `cycles[-1].status` is the state of the arm.
        loop_servers: servers that run the cycles.
    """

    rigs: list[FakeRig] = field(default_factory=list)
    clocks: list[Clock] = field(default_factory=list)
    backends: list[InProcessBackend] = field(default_factory=list)
    cycles: list[Cycle] = field(default_factory=list)
    loop_servers: list[LoopServer] = field(default_factory=list)

    @property
    def rig(self) -> FakeRig:
        return self.rigs[-1]

    @property
    def clock(self) -> Clock:
        return self.clocks[-1]

    @property
    def backend(self) -> InProcessBackend:
        return self.backends[-1]

    @property
    def cycle(self) -> Cycle:
        return self.cycles[-1]

    def forget(self) -> None:
        """Drop all references."""
        for built in (
            self.rigs,
            self.clocks,
            self.backends,
            self.cycles,
            self.loop_servers,
        ):
            built.clear()


def watch_builds(patch: pytest.MonkeyPatch) -> Built:
    """Everything that is built while `patch` lasts."""
    built = Built()

    class SeenRig(plain_world.FakeRig):
        def __init__(self, scene, constants, tool, clock, *arguments, **named):
            super().__init__(scene, constants, tool, clock, *arguments, **named)
            built.rigs.append(self)
            built.clocks.append(clock)

    patch.setattr(plain_world, "FakeRig", SeenRig)
    patch.setattr(
        fake, "InProcessBackend", _seen(fake.InProcessBackend, built.backends)
    )
    patch.setattr(build, "Cycle", _seen(build.Cycle, built.cycles))
    patch.setattr(build, "LoopServer", _seen(build.LoopServer, built.loop_servers))
    return built


def _seen(kind, built):
    class Seen(kind):
        def __init__(self, *arguments, **named):
            super().__init__(*arguments, **named)
            built.append(self)

    return Seen
