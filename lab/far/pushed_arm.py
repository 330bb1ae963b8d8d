"""An arm with ground and hand at the far end of a CAN bus.

Lines move the hand and press the pendant, as a person would do: prepare TRIAL, lift,
put_down, push, rest, activate, idle, mend; and orders to hands as `traction fake` takes
them, e.g. pose, release.
"""

from collections.abc import Callable

from acquisition.clock import Clock
from experiments.operator.hand_orders import parse_hand_order
from experiments.rig.fake import RigTruth, SimulatedRig
from experiments.settings.load import Settings
from fakes.pucks.wire import WiredNetwork
from fakes.world.plain_world import simulated_rig
from fakes.world_clock import TICK_NS, WorldClock
from lab.calls import Frame
from lab.far.line_sensor import FarEnd, Turn
from wam.model.constants import load_constants

# What the arm says within this time leaves together, as through an adapter that
# collects frames: seven positions, the last of which starts 0.53 ms after the question.
_TOGETHER_NS = 550_000
_HIGHEST_ID = 0x7FF  # of a data frame


class PushedArm:
    """Implements Served: a simulated rig on a bus, and what a person does with it."""

    def __init__(
        self,
        settings: Settings,
        row: str,
        seed: int,
        clock: Clock,
        *,
        has_line: bool,
        friction: float,
        wrong: str,
    ) -> None:
        """Put the arm above the container of a row of the matrix.

        Args:
            settings: of the rig.
            row: of the matrix.
            seed: of everything random.
            clock: the guest's time.
            has_line: its sensor is on the serial line.
            friction: share of what was identified on another arm.
            wrong: name of what is wrong with it in the catalogue; "" = nothing.
        """
        world = SimulatedRig(
            settings.rig,
            settings.row(row),
            seed,
            friction,
            "steady",
            truth=RigTruth(wrong=wrong) if wrong else None,
        )
        self._clock = WorldClock(clock)
        simulation = simulated_rig(world.metadata(), load_constants(), self._clock)
        self._simulation, rig = simulation, simulation.rig
        self._plant = rig.plant
        self._wired = WiredNetwork(rig.network, is_far=True)
        self._line: FarEnd | None = None
        if has_line:
            self._line = FarEnd(rig.stream, self._clock.now_ns())
        self._actions: dict[str, Callable[[], None]] = {
            "lift": simulation.lift,
            "put_down": simulation.put_down,
            "push": simulation.push,
            "rest": simulation.rest,
            "mend": simulation.clear_faults,
            "activate": lambda: simulation.pendant("activate"),
            "idle": lambda: simulation.pendant("idle"),
        }

    def do(self, line: str) -> None:
        """Do what a person does; raises KeyError where the line is not known."""
        word, _, operand = line.partition(" ")
        if word == "prepare":
            self._simulation.prepare(int(operand))
        elif line in self._actions:
            self._actions[line]()
        elif (order := parse_hand_order(line.split())) is not None:
            order.give(self._simulation)
        else:
            raise KeyError(line)

    def advance(self, frames: list[Frame], data: bytes) -> Turn:
        """Let bus, arm and sensor go on up to now."""
        now_ns, wired = self._clock.go_on(), self._wired
        for can_id, payload in frames:
            if can_id <= _HIGHEST_ID:
                wired.send(now_ns, can_id, payload)
        sent = [(can_id, payload) for _, can_id, payload in wired.advance(now_ns)]
        self._plant.advance(now_ns)
        written = b"" if self._line is None else self._line.advance(now_ns, data)
        event_ns = wired.next_event_ns()
        left = TICK_NS if event_ns is None else max(event_ns - now_ns, _TOGETHER_NS)
        return min(left, TICK_NS), sent, written
