"""traction calibrate terrain: touch the container with the sole, fit its frame."""

import numpy as np

from acquisition.control_loop.states import ArmState
from acquisition.errors import PreflightError
from experiments.operator.prompts import Prompt
from experiments.run.console_loop import ConsoleLoop
from experiments.run.ready import activate
from experiments.session.sidecar import TrialName
from ft_sensor.calibration.fit import CORNERS, ContainerFit, check_terrain, fit_terrain
from wam.model.constants import Array

AVERAGE = 0.3  # s of positions that are averaged
STILL = 0.003  # m that the sole may move meanwhile
MOST = 60  # points


class TerrainGuide:
    """Asks a person to touch the corners of a container, and takes the points."""

    def __init__(self, console_loop: ConsoleLoop) -> None:
        self._console_loop = console_loop
        self._rig = console_loop.rig
        self._console = console_loop.console

    def run(self, *, is_forced: bool) -> tuple[ContainerFit, list[Array]]:
        """Return the container as touched, and the points [m], shape (3,) each.

        Args:
            is_forced: accept a container that `check_terrain` refuses.

        Raises:
            SettingsError: the corners make no container, or not this one.
            PreflightError: not activated.
            StopRequestedError, ArmFaultError: as `ConsoleLoop.tick`.
        """
        points = self.touch()
        fit = fit_terrain(np.array(points))
        self._say(fit, len(points))
        check_terrain(fit, self._rig.frame, is_forced=is_forced)
        return fit, points

    def touch(self) -> list[Array]:
        """Activate the arm, take the points, lay the arm down; return them.

        Raises:
            PreflightError: not activated.
            StopRequestedError, ArmFaultError: as `ConsoleLoop.tick`.
        """
        activate(self._console_loop)
        self._console_loop.loop_client.request(ArmState.FLOAT)
        points = self._points()
        self._console_loop.loop_client.request(ArmState.HOLD)
        self._console_loop.lay_down()
        self._console_loop.make_safe()
        return points

    def _points(self) -> list[Array]:
        points: list[Array] = []
        while len(points) < MOST:
            number = len(points) + 1
            is_corner = number <= len(CORNERS)
            place = (
                f"the {CORNERS[number - 1]} corner" if is_corner else "one more point"
            )
            done = "" if is_corner else ", [d] when done"
            self._console.say(
                f"Touch {place} with the sole, then [space]{done}.   (far left = "
                "away from the arm, its left)"
                if number == 1
                else f"Touch {place} with the sole, then [space]{done}."
            )
            point = self._point(TrialName(number, 1), is_corner=is_corner)
            if point is None:
                break
            points.append(point)
        return points

    def _point(self, name: TrialName, *, is_corner: bool) -> Array | None:
        """Return the sole's mean position [m], shape (3,); None = no more."""
        while True:
            key = self._console_loop.tick(Prompt.TOUCH, name)
            if key == "d" and not is_corner:
                return None
            if key != " ":
                continue
            try:
                return self._at_rest()
            except PreflightError as error:
                self._console.say(str(error))

    def _at_rest(self) -> Array:
        self._console_loop.loop_client.advance(AVERAGE)
        at = self._console_loop.loop_client.last(AVERAGE)["foot_position"]
        moved = float(np.ptp(at, axis=0).max())
        if moved > STILL:
            raise PreflightError(
                f"The sole moved by {1e3 * moved:.1f} mm (limit {1e3 * STILL:g}).",
                hint="Hold it still on the ground, then [space] again.",
            )
        return at.mean(axis=0)

    def _say(self, fit: ContainerFit, points: int) -> None:
        frame, row = fit.frame, self._rig.row
        x, y, z = frame.far_end
        say = self._console.say
        say(
            f"incline {np.degrees(frame.incline):.2f} degrees (matrix "
            f"{row.incline_deg:g}), heading {np.degrees(frame.heading):.2f} (matrix "
            f"{row.heading_deg:g}), across {np.degrees(fit.roll):+z.2f}"
        )
        say(f"far end {x:.3f}, {y:.3f}, {z:.3f} m, travel {frame.travel:.3f} m")
        say(f"{points} points, {1e3 * fit.residual:.1f} mm rms off the plane")
