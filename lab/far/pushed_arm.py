"""An arm with ground and operator at the far end of a CAN bus.

Commands move the operator's hand and press the pendant: prepare TRIAL, lift, put_down,
push, rest, activate, idle, mend; and the hand commands of `traction fake`, e.g. pose,
release.
"""

from collections.abc import Callable

from acquisition.clock import Clock
from experiments.operator.hand_orders import parse_hand_order
from experiments.rig.fake import SimulatedRig, TrueDeviations
from experiments.settings.load import Settings
from fakes.pucks.wire import WiredNetwork
from fakes.world.plain_world import simulated_rig
from fakes.world_clock import TICK_NS, WorldClock
from lab.calls import Frame
from lab.far.line_sensor import FarEnd, Turn
from wam.model.constants import load_constants

# Frames within this time are sent together, as by an adapter that collects frames:
# seven positions, the last of which starts 0.53 ms after the request.
_TOGETHER_NS = 550_000
_HIGHEST_ID = 0x7FF  # largest identifier of a data frame


class PushedArm:
    """Implements Served: a simulated rig on a bus and its operator."""

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
        """Place the arm above the container of a row of the matrix.

        Args:
            settings: settings of the rig.
            row: name of the row.
            seed: seed of all random numbers.
            clock: clock of the guest.
            has_line: the sensor is on the serial line.
            friction: joint friction relative to that identified on another arm.
            wrong: the arm's error by its name in the catalogue; "" = none.
        """
        world = SimulatedRig(
            settings.rig,
            settings.row(row),
            seed,
            friction,
            "steady",
            truth=TrueDeviations(wrong=wrong) if wrong else None,
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
        """Carry out an operator's command; raises KeyError if it is unknown."""
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
        """Simulate bus, arm and sensor up to now."""
        now_ns, wired = self._clock.advance_to_now(), self._wired
        for can_id, payload in frames:
            if can_id <= _HIGHEST_ID:
                wired.send(now_ns, can_id, payload)
        sent = [(can_id, payload) for _, can_id, payload in wired.advance(now_ns)]
        self._plant.advance(now_ns)
        written = b"" if self._line is None else self._line.advance(now_ns, data)
        event_ns = wired.next_event_ns()
        wait_ns = TICK_NS if event_ns is None else max(event_ns - now_ns, _TOGETHER_NS)
        return min(wait_ns, TICK_NS), sent, written
