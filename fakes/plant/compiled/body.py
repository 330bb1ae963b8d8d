# pyright: basic
"""The arm's dynamics in machine code: the same model, one call for many substeps."""

from collections.abc import Sequence
from struct import Struct

import numpy as np

from fakes.ground.compiled.grounds import CompiledGround
from fakes.ground.compiled.layout import DONE, GIVEN, GROUND
from fakes.ground.terrain import Terrain
from fakes.kernels.choice import COMPILED
from fakes.plant.body import HandLoad
from fakes.plant.compiled.drives import take_drives
from fakes.plant.compiled.motion import take_links
from fakes.plant.compiled.substeps import BODY, begin_cycle, go_on
from fakes.plant.joints import BEARING_NS
from fakes.plant.model import ArmAndHand
from fakes.plant.push import HandView
from wam.model.constants import ArmConstants, Array
from wam.model.friction import MotorFriction

_OFFSETS = {name: place[1] for name, place in (BODY.fields or {}).items()}
# Packed in half the time in which numpy looks through a list.
_UNITS, _HAND_LOAD, _FLAGS = Struct("7d"), Struct("5d"), Struct("2q")


class CompiledBody:
    """Implements `ArmBody` over a record.

    Attributes:
        dynamics: name of the implementation.
        disturbance: joint torques from outside [N m], shape (7,).
    """

    dynamics = COMPILED

    def __init__(
        self,
        parts: ArmAndHand,
        constants: ArmConstants,
        rubbing: tuple[MotorFriction, Array],
        q: Array,
        times: tuple[float, float],
    ) -> None:
        """Stand still at `q`, held; the hand keeps the turn of now.

        Args:
            parts: the arm with the hand, its frames: sole and hand.
            constants: of the arm.
            rubbing: friction of the motors, and what each moves when it turns
                [kg m^2], shape (7,).
            q: joint positions [rad], shape (7,).
            times: length of a substep, and how far into a cycle the Jacobians are
                taken [s].
        """
        self._bytes = bytearray(BODY.itemsize)
        self._bodies = np.frombuffer(self._bytes, BODY)
        self._record = record = self._bodies[0]
        self._no_ground, self._given = np.zeros(1, GROUND), np.zeros(1, GROUND)
        self._given["kind"] = GIVEN
        take_links(record, parts)
        take_drives(record, constants, *rubbing, times[0])
        record["midway"] = times[1]
        self.disturbance = record["disturbance"]
        self._motion, self._hand_rates = record["motion"], record["hand_rates"]
        self._rotation, self._sum = record["foot_rotation"], record["sum"]
        # Sum of the ground's wrenches, place of the hand, motion; place, motion, speed.
        self._ended = np.frombuffer(self._bytes, float, 18, _OFFSETS["sum"])
        self._felt = np.frombuffer(self._bytes, float, 15, _OFFSETS["hand_at"])
        self._disturbed = record["disturbed"]
        self._is_driven = self._bodies["is_driven"]
        turns = np.array(constants.cts) / (2.0 * np.pi)
        self._to_counts = turns[:, None] * constants.j2mp
        self._rows = np.stack((q, np.zeros(7), np.zeros(7)))
        self._is_taken = False  # by somebody who may keep it
        self.hold(is_held=True)
        self.linearise()
        record["wanted"] = record["R"][5] @ record["hand_turn"]
        self.linearise()
        record["is_bearing"] = record["is_fresh"] = 1
        go_on(self._bodies, self._no_ground, self._rows, 0)  # no substep is left yet

    @property
    def q(self) -> Array:
        """Joint positions [rad], shape (7,); as they are now, also later."""
        self._is_taken = True
        return self._rows[0]

    @property
    def qd(self) -> Array:
        """Joint velocities [rad/s], shape (7,); as they are now, also later."""
        self._is_taken = True
        return self._rows[1]

    @property
    def rotation(self) -> Array:
        """Frame 7 to terrain as it was when the cycle began, shape (3, 3)."""
        return self._rotation

    def move(self, q: Array) -> None:
        """Be at `q` [rad] with the velocities of now."""
        self._rows = np.stack((q, *self._rows[1:]))

    def hold(self, *, is_held: bool) -> None:
        """Let the brakes hold the joints, or let go of them."""
        self._record["is_held"] = is_held
        if is_held:
            self._rows = np.stack((self._rows[0], np.zeros(7), np.zeros(7)))
            self._motion[3:] = self._hand_rates[:] = 0.0
            self._record["speeds"] = 0.0
            self._unbend()

    def _unbend(self) -> None:
        """Let go of what bends the bristles."""
        record = self._record
        record["z"], record["keep"], record["springs"] = 0.0, 1.0, record["s0"]
        record["damping"] = record["of_bent"] + record["viscous"]

    def drive(self, units: Sequence[float]) -> None:
        """Apply torques [puck units] to motors 1 to 7 from now on."""
        _UNITS.pack_into(self._bytes, _OFFSETS["units"], *units)
        self._is_driven[0] = 1
        self._disturbed[:] = self.disturbance

    def counts(self) -> list[float]:
        """Return what the encoders of the motors count, seven."""
        return self._to_counts.dot(self._rows[0]).tolist()

    def motion(self) -> Sequence[float]:
        """Return position, velocity and turning rate of the sole, nine numbers."""
        return self._motion.tolist()

    def linearise(self) -> HandView:
        """Take positions and Jacobians anew, once per cycle; return what a hand feels.

        Positions [m] and velocities [m/s] of sole and hand point, terrain frame.
        """
        begin_cycle(self._bodies, self._rows)
        ax, ay, az, x, y, z, vx, vy, vz, _, _, _, bx, by, bz = self._felt.tolist()
        return HandView((x, y, z), (vx, vy, vz), (ax, ay, az), (bx, by, bz))

    def begin_cycle(self, load: HandLoad, t_ns: int) -> None:
        """Take anew what stays as it is for 2 ms from `t_ns` on."""
        is_bearing = t_ns % BEARING_NS == 0
        _HAND_LOAD.pack_into(self._bytes, _OFFSETS["hand_load"], *load[0], *load[1])
        _FLAGS.pack_into(self._bytes, _OFFSETS["is_bearing"], is_bearing, 1)

    def go_on(self, steps: int, terrain: Terrain | None) -> None:
        """Go on by `steps` substeps within a cycle."""
        if terrain is not None and not isinstance(terrain, CompiledGround):
            self._go_on_given(steps, terrain)
            return
        if self._is_taken:  # what was taken of the old ones stays
            self._rows, self._is_taken = self._rows.copy(), False
        bodies, rows = self._bodies, self._rows
        if terrain is None:
            go_on(bodies, self._no_ground, rows, steps)
            return
        while (event := go_on(bodies, terrain.records, rows, steps)) != DONE:
            terrain.draw(event, float(self._motion[0]))
            steps = 0

    def _go_on_given(self, steps: int, terrain: Terrain) -> None:
        """Go on over a ground that Python steps."""
        dt = float(self._record["dt"])
        for _ in range(steps):
            x, y, z, vx, vy, vz, wx, wy, wz = self._motion.tolist()
            motion = (x, y, z, vx, vy, vz, wx, wy, wz)
            self._given["contact"] = terrain.step(dt, motion)
            self._rows = self._rows.copy()
            go_on(self._bodies, self._given, self._rows, 1)

    def end_cycle(self) -> tuple[Sequence[float], Sequence[float]]:
        """Return the sum of the ground's wrenches in the cycle, six, and `motion`."""
        ended = self._ended.tolist()
        self._sum.fill(0.0)
        return ended[:6], ended[9:]
