"""An arm that is held still in poses: what C5 to C7 record of it, without the loop.

Zeros, mount, foot, cable and axes are those of a departure; the readings are those of
the simulated sensor with all its errors, in the order and time of the steps.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from experiments.commissioning.by_hand import CARRY_SECONDS
from experiments.commissioning.recording import Values
from experiments.commissioning.scales import PRESSED, PULLED
from experiments.commissioning.weights import AVERAGE, HUNG, HUNG_AT, POSES, SETTLED
from fakes.plant.gauges import WristGauges
from fakes.randomness import trial_generator
from fakes.sensor.errors import SensorErrors
from fakes.world.departure import RigDeviation, draw_sound_rig, rotation
from fakes.world.true_rig import constants_around_home, true_constants, true_tool
from fakes.world.wrong_rigs import wrong_rig
from ft_sensor.payload import payload_of
from wam.model.arm_model import ArmModel
from wam.model.constants import GRAVITY, Array, load_constants
from wam.model.tool import Tool

_STEP = 0.02  # s, between two readings
_MISSED = 0.03  # rad, standard deviation of a pose that a person brings an arm to
_SLOP = np.radians(0.1)  # of a joint pressed onto its stop by hand


class HeldArm:
    """An arm that differs from its drawings, in the hands of a person."""

    def __init__(
        self, tool: Tool, seed: int, wrong: str = "", another_day: int = 0
    ) -> None:
        """Draw the sound arm of `seed`.

        Args:
            tool: what hangs on its plate, as believed.
            seed: of what is drawn once for an arm.
            wrong: a name of the catalogue; "" = nothing is.
            another_day: draws anew what is another one every day: poses, the sensor's
                bias, drift and noise.
        """
        sound = draw_sound_rig(seed)
        self.departure: RigDeviation = (
            wrong_rig(wrong).departure.on(sound) if wrong else sound
        )
        self._believed = load_constants()
        self._constants = true_constants(self._believed, self.departure)
        typed = self.departure.typed_foot_mass
        foot = tool.foot if typed is None else replace(tool.foot, mass=typed)
        self._tool = replace(tool, foot=foot)
        true = true_tool(tool, self.departure)
        self.true_tool = true
        self._model = ArmModel(self._constants, true)
        down = rotation(self.departure.mount.tolist()).T @ np.array([0.0, 0.0, -1.0])
        self._down: Array = down.astype(np.float64)
        self._gauges = WristGauges(true, -self._down, 0.002)
        if self.departure.cable.any():
            self._gauges.cable = self.departure.cable
        random = trial_generator(seed, "held", another_day)
        self._errors = SensorErrors(random.spawn(1)[0])
        self._random = random
        self._t_ns = 0
        self._q = np.zeros(7)
        self._hung = 0.0
        self._pushed: Array = np.zeros(3)  # N, at the sole, base frame

    def told(self, q: Array) -> Array:
        """Return where the joints are told to be that are truly at `q` [rad], (7,)."""
        home, ratios = self._constants.home, self._constants.j2mp
        turned = self.departure.counts @ (ratios @ (q - home))
        there = np.linalg.solve(self._believed.j2mp, turned)
        return there + self._believed.home + self.departure.zeros

    def stops(self) -> Values:
        """Return what C5 records."""
        lows: list[Array] = []
        highs: list[Array] = []
        for joint in range(7):
            for ends, bound in (
                (lows, self._constants.q_lower),
                (highs, self._constants.q_upper),
            ):
                q = np.array(POSES[0])
                q[joint] = bound[joint] + _SLOP * self._random.standard_normal()
                ends.append(self.told(q))
        drawn = constants_around_home(self._believed)
        ends = {"q_lower": drawn.q_lower, "q_upper": drawn.q_upper}
        return {"low": np.array(lows), "high": np.array(highs), **ends}

    def own_weight(self, poses: Sequence[Sequence[float]] = POSES) -> Values:
        """Return what C6 records, or the daily check in fewer poses."""
        measured = [self._bring(pose) for pose in poses]
        q, readings = zip(*measured, strict=True)
        return {"q": np.array(q), "readings": np.array(readings), **self._believes()}

    def hung_weight(self, stops: Array) -> Values:
        """Return what C7 records after stops that were off by `stops` [rad], (7,)."""
        parts: list[tuple[Array, ...]] = []
        for at in HUNG_AT:
            q, before = self._bring(POSES[at])
            self._hung = HUNG
            loaded = self._measure()
            self._hung = 0.0
            parts.append((q, before, loaded, self._measure()))
        names = ("q", "before", "loaded", "after")
        columns = zip(*parts, strict=True)
        arrays = {
            name: np.array(part) for name, part in zip(names, columns, strict=True)
        }
        hung = {"hung": np.array(HUNG), "stops": stops}
        return {**arrays, **self._believes(), **hung}

    def plate(self, pressed: float = PRESSED * GRAVITY) -> Values:
        """Return what C14 records where the scale truly bears `pressed` [N]."""
        parts = [self._bring(POSES[0])]
        for force in ((0.0, 0.0, pressed), (0.0, PULLED, 0.0)):
            self._pushed = np.array(force)
            parts.append((parts[0][0], self._measure()))
            self._pushed = np.zeros(3)
            parts.append((parts[0][0], self._measure()))
        shown = {"pressed": np.array(PRESSED * GRAVITY), "pulled": np.array(PULLED)}
        q, readings = zip(*parts, strict=True)
        arrays = {"q": np.array(q), "readings": np.array(readings)}
        return {**arrays, **self._believes(), **shown}

    def _believes(self) -> dict[str, Array]:
        payload = payload_of(self._tool)
        sole = self._tool.sole - np.array([0.0, 0.0, self._tool.sensor_height])
        return {
            "sign": np.array(payload.sign),
            "mounting": payload.rotation,
            "mass": np.array(payload.mass),
            "centre": payload.com,
            "sole": payload.rotation.T @ sole,
        }

    def _bring(self, pose: Sequence[float]) -> tuple[Array, Array]:
        before = self._q
        after = np.array(pose) + _MISSED * self._random.standard_normal(7)
        for share in np.linspace(0.0, 1.0, round(CARRY_SECONDS / _STEP)):
            self._q = before + share * (after - before)
            self._read()
        return self.told(self._q), self._measure()

    def _measure(self) -> Array:
        for _ in range(round(SETTLED / _STEP)):
            self._read()
        read = [self._read() for _ in range(round(AVERAGE / _STEP))]
        return np.mean(read, axis=0)

    def _read(self) -> Array:
        self._t_ns += round(1e9 * _STEP)
        force = self._hung * GRAVITY * self._down + self._pushed
        turn = self._model.plate_pose(self._q)[1]
        self._gauges.end_cycle(turn, [*force.tolist(), 0.0, 0.0, 0.0], [0.0] * 6)
        shown = self.departure.shown @ np.array(self._gauges.load())
        return np.array(self._errors.apply(self._t_ns, shown.tolist()))
