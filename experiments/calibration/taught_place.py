"""traction teach: put the sole down at both ends of a container, three times."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from acquisition.errors import PreflightError
from acquisition.ipc.shared_sensor import unpack_wrenches
from acquisition.sample import Record
from acquisition.simulation import ENDS
from experiments.calibration.calibration import CalibrationContext, GuidedCalibration
from experiments.calibration.touching import floating_arm, touch
from experiments.operator.prompts import Prompt
from experiments.run.console_loop import TICK
from experiments.session.sidecar import TrialName
from experiments.session.store import iso_utc
from experiments.settings.places import TaughtPlace
from ft_sensor.payload import Payload
from ft_sensor.tare import TareError, take_mean
from wam.model.arm_model import ArmModel
from wam.model.constants import Array

ROUNDS = 3  # touches of each end
PRESSED = (2.0, 20.0)  # N, normal force of a resting sole
NEAR = 0.010  # m, largest distance of touches of one end from their mean
_AIR = 1.5  # s, averaging time of a foot held in the air
_STILL_SPEED = 0.03  # m/s
_ENDS = ("near", "far")  # in order of the touches


@dataclass(frozen=True, slots=True)
class EndTouch:
    """One touch of an end.

    Attributes:
        sole: position of the sole [m], shape (3,).
        q: joint positions [rad], shape (7,).
    """

    sole: Array
    q: Array


@dataclass(frozen=True, slots=True)
class TaughtEnds:
    """Both ends of a container as touched.

    Attributes:
        near: mean of the sole's positions at the near end [m], shape (3,).
        far: mean at the far end [m], shape (3,).
        start: mean joint positions at the far end [rad], shape (7,).
        spread: largest distance of a touch from the mean of its end [m].
    """

    near: Array
    far: Array
    start: Array
    spread: float

    @property
    def travel(self) -> float:
        """Distance of the ends along the plane [m]."""
        return float(np.linalg.norm(self.far - self.near))

    @property
    def heading(self) -> float:
        """Direction from the near end to the far one about z [rad]."""
        x, y, _ = self.far - self.near
        return float(np.arctan2(y, x))

    @property
    def incline(self) -> float:
        """Angle to the horizontal, positive if the far end is high [rad]."""
        return float(np.arcsin((self.far - self.near)[2] / self.travel))


def collect(context: CalibrationContext) -> list[EndTouch]:
    """Have the ends touched alternately, the near one first; returns the touches.

    Raises:
        PreflightError: the arm was not activated.
        StopRequestedError, ArmFaultError: as `ConsoleLoop.tick`.
    """
    console_loop, model = context.console_loop, context.rig.model
    touches: list[EndTouch] = []
    with floating_arm(console_loop):
        payload = _payload_in_the_air(context)
        for number in range(ROUNDS * len(_ENDS)):
            end = _ENDS[number % len(_ENDS)]
            again = " again" if number >= len(_ENDS) else ""
            context.console.say(
                f"Put the sole down at the {end} end{again}, then [space]."
            )
            touched = touch(
                console_loop,
                ENDS + number + 1,
                lambda at_rest: _end_touch(at_rest, model, payload),
            )
            assert touched is not None
            touches.append(touched)
    return touches


def _payload_in_the_air(context: CalibrationContext) -> Payload:
    """Return the payload tared in the air, once the foot is held still."""
    console_loop, rig = context.console_loop, context.rig
    client, say = console_loop.loop_client, context.console.say
    say("Lift the foot clear of everything and keep it still.")
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
            limit = rig.settings.rig.limits.tare_spread
            mean = take_mean(unpack_wrenches(reader.read()), limit)
        except TareError as error:
            say(str(error))
            continue
        rotation = rig.model.sole_pose(client.latest()["position"][0])[1]
        return rig.payload.tared(np.array(mean.wrench), rotation)


def _end_touch(at_rest: Record, model: ArmModel, payload: Payload) -> EndTouch:
    """Return the touch of a resting sole.

    Raises:
        PreflightError: the sole is pressed too much or too little.
    """
    q = at_rest["position"].mean(axis=0)
    rotation = model.sole_pose(q)[1]
    contact = payload.contact(at_rest["wrench_raw"].mean(axis=0), rotation)
    pressed = float(payload.to_base(contact, rotation)[2])
    if not PRESSED[0] <= pressed <= PRESSED[1]:
        raise PreflightError(
            f"The sole is pressed with {pressed:.1f} N ({PRESSED[0]:g} to "
            f"{PRESSED[1]:g} N are expected).",
            hint="Let it rest on the ground with a light hand, then [space] again.",
        )
    return EndTouch(at_rest["foot_position"].mean(axis=0), q)


def fit_ends(near: Sequence[EndTouch], far: Sequence[EndTouch]) -> TaughtEnds:
    """Average the touches of both ends.

    Raises:
        PreflightError: the touches of one end scatter too much.
    """
    means: list[Array] = []
    spread = 0.0
    for end, touches in zip(_ENDS, (near, far), strict=True):
        points = np.array([touched.sole for touched in touches])
        mean = points.mean(axis=0)
        distance = float(np.linalg.norm(points - mean, axis=1).max())
        if distance > NEAR:
            raise PreflightError(
                f"The touches of the {end} end lie {1e3 * distance:.0f} mm from their "
                f"mean (limit {1e3 * NEAR:g}).",
                hint="Mark the two points, then teach the place again. Nothing was "
                "written.",
            )
        means.append(mean)
        spread = max(spread, distance)
    start = np.array([touched.q for touched in far]).mean(axis=0)
    return TaughtEnds(means[0], means[1], start, spread)


def _taught_place(
    context: CalibrationContext, place: str, ends: TaughtEnds
) -> TaughtPlace:
    rig = context.rig
    x, y, z = (round(value, 4) for value in ends.far.tolist())
    heading, incline = (
        round(float(np.degrees(angle)), 2) for angle in (ends.heading, ends.incline)
    )
    return TaughtPlace(
        place=place,
        far_end=(x, y, z),
        heading_deg=heading,
        incline_deg=incline,
        travel=round(ends.travel, 4),
        start=tuple(round(value, 4) for value in ends.start.tolist()),
        foot=rig.row.foot,
        arm=rig.serials or (),
        measured_utc=iso_utc(rig.clock.utc_ns()),
        simulated=rig.is_simulated,
        spread_mm=round(1e3 * ends.spread, 2),
    )


def show(context: CalibrationContext, taught: TaughtPlace) -> None:
    """Print the taught place."""
    x, y, z = taught.far_end
    context.console.say(
        f"far end {x:.3f}, {y:.3f}, {z:.3f} m, travel {taught.travel:.3f} m, heading "
        f"{taught.heading_deg:.1f} degrees, incline {taught.incline_deg:+z.1f} degrees "
        "(to about 1; traction calibrate terrain is exact); touches within "
        f"{taught.spread_mm:.1f} mm"
    )


def place_calibration(place: str) -> GuidedCalibration[list[EndTouch], TaughtPlace]:
    """Return the calibration that teaches the place of that name."""

    def fit(context: CalibrationContext, touches: list[EndTouch]) -> TaughtPlace:
        return _taught_place(context, place, fit_ends(touches[::2], touches[1::2]))

    return GuidedCalibration(
        place,
        collect,
        fit,
        show,
        text=lambda _, taught: taught.text(
            "Taught by hand; m, rad, base frame of the arm."
        ),
        use=lambda _, name: (
            f'[places.{place}] taught = "{name}" of rig.toml, and place = "{place}" '
            "of a cell"
        ),
        path=lambda settings, _: settings.folder / f"place_{place}.toml",
        made_anew=(),
    )
