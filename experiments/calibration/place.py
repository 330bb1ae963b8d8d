"""traction teach: put the sole down at both ends of a container, three times."""

from dataclasses import dataclass

import numpy as np

from acquisition.control_loop.states import ArmState
from acquisition.errors import PreflightError
from acquisition.ipc.shared_sensor import unpack_wrenches
from acquisition.simulation import ENDS
from experiments.calibration.terrain import AVERAGE, STILL
from experiments.operator.prompts import Prompt
from experiments.run.console_loop import TICK, ConsoleLoop
from experiments.run.ready import activate
from experiments.session.sidecar import TrialName
from ft_sensor.payload import Payload
from ft_sensor.tare import TareError, take_mean
from wam.model.constants import Array

ROUNDS = 3  # touches of each end
PRESSED = (2.0, 20.0)  # N, of a sole that lies on the ground
NEAR = 0.010  # m between touches of one end
_AIR = 1.5  # s, of a foot held in the air
_STILL_SPEED = 0.03  # m/s
_ENDS = ("near", "far")  # in the order in which they are touched


@dataclass(frozen=True, slots=True)
class TaughtEnds:
    """Both ends of a container as touched.

    Attributes:
        near: mean of the sole's positions at the near end [m], shape (3,).
        far: the same at the far end.
        start: mean joint positions at the far end [rad], shape (7,).
        spread: largest distance of a touch from the mean of its end [m].
    """

    near: Array
    far: Array
    start: Array
    spread: float

    @property
    def travel(self) -> float:
        """Length of the way along the plane [m]."""
        return float(np.linalg.norm(self.far - self.near))

    @property
    def heading(self) -> float:
        """Direction from the near end to the far one about z [rad]."""
        x, y, _ = self.far - self.near
        return float(np.arctan2(y, x))

    @property
    def incline(self) -> float:
        """Angle of the way, positive where the far end is the high one [rad]."""
        return float(np.arcsin((self.far - self.near)[2] / self.travel))


class PlaceGuide:
    """Asks a person to put the sole down at both ends, and takes the poses."""

    def __init__(self, console_loop: ConsoleLoop) -> None:
        self._console_loop = console_loop
        self._rig = console_loop.rig
        self._say = console_loop.console.say

    def run(self) -> TaughtEnds:
        """Activate the arm, have both ends touched, lay the arm down.

        Raises:
            PreflightError: not activated, or touches of one end lie apart.
            StopRequestedError, ArmFaultError: as `ConsoleLoop.tick`.
        """
        console_loop = self._console_loop
        activate(console_loop)
        console_loop.loop_client.request(ArmState.FLOAT)
        payload = self._in_the_air()
        touched: dict[str, list[tuple[Array, Array]]] = {end: [] for end in _ENDS}
        for number in range(ROUNDS * len(_ENDS)):
            end = _ENDS[number % len(_ENDS)]
            again = " again" if number >= len(_ENDS) else ""
            self._say(f"Put the sole down at the {end} end{again}, then [space].")
            touched[end].append(self._touch(number + 1, payload))
        console_loop.loop_client.request(ArmState.HOLD)
        console_loop.lay_down()
        console_loop.make_safe()
        return _taught(touched["near"], touched["far"])

    def _in_the_air(self) -> Payload:
        """Return the payload as it weighs in the air; waits for a foot held still."""
        console_loop, client = self._console_loop, self._console_loop.loop_client
        self._say("Lift the foot clear of everything and keep it still.")
        limit = self._rig.settings.rig.limits.tare_spread
        while True:
            still = 0.0
            while still < _AIR:
                console_loop.tick(Prompt.LIFT, TrialName(1, 1))
                velocity = client.latest()[0]["foot_velocity"][:3]
                is_still = float(np.abs(velocity).max()) < _STILL_SPEED
                still = still + TICK if is_still else 0.0
            reader = client.wrenches()
            client.advance(_AIR)
            try:
                mean = take_mean(unpack_wrenches(reader.read()), limit)
            except TareError as error:
                self._say(str(error))
                continue
            rotation = self._rig.model.sole_pose(client.latest()["position"][0])[1]
            return self._rig.payload.tared(np.array(mean.wrench), rotation)

    def _touch(self, number: int, payload: Payload) -> tuple[Array, Array]:
        """Return where the sole lies [m], (3,), and the joints [rad], (7,)."""
        name = TrialName(ENDS + number, 1)
        while True:
            key = self._console_loop.tick(Prompt.TOUCH, name)
            if key != " ":
                continue
            try:
                return self._at_rest(payload)
            except PreflightError as error:
                self._say(str(error))

    def _at_rest(self, payload: Payload) -> tuple[Array, Array]:
        client = self._console_loop.loop_client
        client.advance(AVERAGE)
        records = client.last(AVERAGE)
        at, joints = records["foot_position"], records["position"].mean(axis=0)
        moved = float(np.ptp(at, axis=0).max())
        if moved > STILL:
            raise PreflightError(
                f"The sole moved by {1e3 * moved:.1f} mm (limit {1e3 * STILL:g}).",
                hint="Hold it still on the ground, then [space] again.",
            )
        rotation = self._rig.model.sole_pose(joints)[1]
        contact = payload.contact(records["wrench_raw"].mean(axis=0), rotation)
        pressed = float(payload.to_base(contact, rotation)[2])
        if not PRESSED[0] <= pressed <= PRESSED[1]:
            raise PreflightError(
                f"The sole is pressed with {pressed:.1f} N ({PRESSED[0]:g} to "
                f"{PRESSED[1]:g} N are expected).",
                hint="Let it rest on the ground with a light hand, then [space] again.",
            )
        return at.mean(axis=0), joints


def _taught(
    near: list[tuple[Array, Array]], far: list[tuple[Array, Array]]
) -> TaughtEnds:
    """Return what the touches of both ends come to.

    Raises:
        PreflightError: those of one end lie apart.
    """
    means: list[Array] = []
    spread = 0.0
    for end, touches in zip(_ENDS, (near, far), strict=True):
        points = np.array([point for point, _ in touches])
        mean = points.mean(axis=0)
        apart = float(np.linalg.norm(points - mean, axis=1).max())
        if apart > NEAR:
            raise PreflightError(
                f"The touches of the {end} end lie {1e3 * apart:.0f} mm from their "
                f"mean (limit {1e3 * NEAR:g}).",
                hint="Mark the two points, then teach the place again. Nothing was "
                "written.",
            )
        means.append(mean)
        spread = max(spread, apart)
    start = np.array([joints for _, joints in far]).mean(axis=0)
    return TaughtEnds(means[0], means[1], start, spread)
