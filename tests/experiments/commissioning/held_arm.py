"""Recordings of C5 to C7 and C14 of an arm held still in poses, without the loop.

Zeros, mount, foot, cable and axes are those of a deviation; the readings are those of
the simulated sensor with all its errors, in the order and time of the steps.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from experiments.commissioning.manual_joints import CARRY_SECONDS
from experiments.commissioning.recording import Values
from experiments.commissioning.scales import PRESSED, PULLED
from experiments.commissioning.weights import AVERAGE, HUNG, HUNG_AT, POSES, SETTLED
from fakes.plant.gauges import WristGauges
from fakes.randomness import trial_generator
from fakes.sensor.errors import SensorErrors
from fakes.world.deviation import RigDeviation, draw_sound_rig, rotation
from fakes.world.true_rig import constants_around_home, true_constants, true_tool
from fakes.world.wrong_rigs import wrong_rig
from ft_sensor.payload import payload_of
from wam.model.arm_model import ArmModel
from wam.model.constants import GRAVITY, Array, load_constants
from wam.model.tool import Tool

_STEP = 0.02  # s, between two readings
_POSE_SPREAD = 0.03  # rad, standard deviation of a pose set by hand
_STOP_SPREAD = np.radians(0.1)  # rad, of a joint pressed onto its stop by hand


class HeldArm:
    """An arm that deviates from its drawings, in the hands of a person."""

    def __init__(
        self, tool: Tool, seed: int, wrong: str = "", another_day: int = 0
    ) -> None:
        """Draw the sound arm of `seed`.

        Args:
            tool: tool on the plate, as the settings state.
            seed: seed of the properties drawn once for an arm.
            wrong: name in the catalogue of wrong rigs; "" for a sound arm.
            another_day: seed of what differs every day: poses, the sensor's bias,
                drift and noise.
        """
        sound = draw_sound_rig(seed)
        self.deviation: RigDeviation = (
            wrong_rig(wrong).deviation.on(sound) if wrong else sound
        )
        self._believed = load_constants()
        self._constants = true_constants(self._believed, self.deviation)
        typed = self.deviation.typed_foot_mass
        foot = tool.foot if typed is None else replace(tool.foot, mass=typed)
        self._tool = replace(tool, foot=foot)
        true = true_tool(tool, self.deviation)
        self.true_tool = true
        self._model = ArmModel(self._constants, true)
        down = rotation(self.deviation.mount.tolist()).T @ np.array([0.0, 0.0, -1.0])
        self._down: Array = down.astype(np.float64)
        self._gauges = WristGauges(true, -self._down, 0.002)
        if self.deviation.cable.any():
            self._gauges.cable = self.deviation.cable
        random = trial_generator(seed, "held", another_day)
        self._errors = SensorErrors(random.spawn(1)[0])
        self._random = random
        self._t_ns = 0
        self._q = np.zeros(7)
        self._hung = 0.0
        self._pushed: Array = np.zeros(3)  # N, at the sole, base frame

    def reported(self, q: Array) -> Array:
        """Reported positions [rad], shape (7,), of joints that are truly at `q`."""
        home, ratios = self._constants.home, self._constants.j2mp
        turned = self.deviation.counts @ (ratios @ (q - home))
        there = np.linalg.solve(self._believed.j2mp, turned)
        return there + self._believed.home + self.deviation.zeros

    def stops(self) -> Values:
        """Recording of C5."""
        lows: list[Array] = []
        highs: list[Array] = []
        for joint in range(7):
            for ends, bound in (
                (lows, self._constants.q_lower),
                (highs, self._constants.q_upper),
            ):
                q = np.array(POSES[0])
                q[joint] = bound[joint] + _STOP_SPREAD * self._random.standard_normal()
                ends.append(self.reported(q))
        drawn = constants_around_home(self._believed)
        ends = {"q_lower": drawn.q_lower, "q_upper": drawn.q_upper}
        return {"low": np.array(lows), "high": np.array(highs), **ends}

    def own_weight(self, poses: Sequence[Sequence[float]] = POSES) -> Values:
        """Recording of C6, or of the daily check in fewer poses."""
        measured = [self._bring(pose) for pose in poses]
        q, readings = zip(*measured, strict=True)
        return {"q": np.array(q), "readings": np.array(readings), **self._stated_tool()}

    def hung_weight(self, stops: Array) -> Values:
        """Recording of C7 after stops with errors `stops` [rad], shape (7,)."""
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
        return {**arrays, **self._stated_tool(), **hung}

    def plate(self, pressed: float = PRESSED * GRAVITY) -> Values:
        """Recording of C14 where the scale truly supports `pressed` [N]."""
        parts = [self._bring(POSES[0])]
        for force in ((0.0, 0.0, pressed), (0.0, PULLED, 0.0)):
            self._pushed = np.array(force)
            parts.append((parts[0][0], self._measure()))
            self._pushed = np.zeros(3)
            parts.append((parts[0][0], self._measure()))
        shown = {"pressed": np.array(PRESSED * GRAVITY), "pulled": np.array(PULLED)}
        q, readings = zip(*parts, strict=True)
        arrays = {"q": np.array(q), "readings": np.array(readings)}
        return {**arrays, **self._stated_tool(), **shown}

    def _stated_tool(self) -> dict[str, Array]:
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
        after = np.array(pose) + _POSE_SPREAD * self._random.standard_normal(7)
        for share in np.linspace(0.0, 1.0, round(CARRY_SECONDS / _STEP)):
            self._q = before + share * (after - before)
            self._read()
        return self.reported(self._q), self._measure()

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
        shown = self.deviation.shown @ np.array(self._gauges.load())
        return np.array(self._errors.apply(self._t_ns, shown.tolist()))
