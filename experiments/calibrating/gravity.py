"""traction calibrate gravity: hold the arm in many poses, fit what it weighs."""

from dataclasses import dataclass

import numpy as np

from acquisition.errors import PreflightError
from experiments.activation import activate
from experiments.operator import Prompt
from experiments.stage import TICK, Stage
from experiments.store import iso_utc
from wam.constants import Array
from wam.first_moments import MomentFit, check_fit, fit_moments
from wam.gravity_file import GravityCalibration
from wam.gravity_poses import (
    APPROACH_SPEED,
    Halt,
    choose_poses,
    plan_halts,
    way_seconds,
)
from wam.move import JointMove

SETTLE = 0.5  # s after a move
AVERAGE = 0.5  # s of torques that are averaged
CLEARANCE = 0.10  # m that sole, plate and elbow stay above the highest container
STILL = 0.02  # rad/s, largest joint speed while torques are averaged
ATTEMPTS = 4  # at an arm that does not come to rest


@dataclass(frozen=True, slots=True)
class Measured:
    """One pose as measured.

    Attributes:
        q: mean joint positions of both approaches [rad], shape (7,).
        tau: mean torques of both: friction cancels [N m], shape (7,).
        friction: half the difference of both [N m], shape (7,).
    """

    q: Array
    tau: Array
    friction: Array


class GravityGuide:
    """Leads the arm through the poses of a gravity calibration."""

    def __init__(self, stage: Stage) -> None:
        self._stage = stage
        self._rig = stage.rig
        self._console = stage.company.console
        self._here = np.zeros(7)  # where the arm was sent last

    def run(self, count: int, *, is_forced: bool) -> GravityCalibration:
        """Measure in `count` poses and return the calibration.

        The arm moves by itself, at 0.5 rad/s and 0.3 m/s at most, after a person has
        said that the space is clear; it comes back to where it was.

        Args:
            count: how many poses.
            is_forced: accept a fit that `check_fit` refuses.

        Raises:
            SettingsError: no safe way, or the fit is bad.
            PreflightError: not activated, or touched while it was weighed.
            StopAskedError, FaultedError: as `Stage.tick`.
        """
        activate(self._stage)
        halts = self._clear_the_space(count)
        found = self._measure(halts)
        self._ask("Support the arm, it goes idle. [space]", Prompt.SUPPORT)
        self._stage.make_safe()  # nobody need hold it while numbers are looked at
        return self._fit(found, is_forced=is_forced)

    def _clear_the_space(self, count: int) -> list[Halt]:
        """Plan the way, hold the arm where it is and ask for free space."""
        start = self._rig.crew.desk.latest()["position"][0].copy()
        rows = self._rig.settings.matrix.terrains
        floor = max(row.far_end[2] for row in rows) + CLEARANCE
        model = self._rig.model
        halts = self._stage.aside(
            lambda: plan_halts(model, start, choose_poses(model, count, floor), floor)
        )
        number = len({halt.pose for halt in halts} - {None})
        stops = len(halts) * SETTLE + 2 * number * AVERAGE
        # Held by position: the weight is not known yet, and the hand lets go.
        self._here = start
        self._go_to(Halt(start, APPROACH_SPEED, None))
        self._ask(
            f"The arm will move by itself through {number} poses, about "
            f"{(way_seconds(start, halts) + stops) / 60:.1f} min. Let go of it and "
            "clear the space. [space] when clear.",
            Prompt.CLEAR,
        )
        return halts

    def _measure(self, halts: list[Halt]) -> list[Measured]:
        found: dict[int, list[tuple[Array, Array]]] = {}
        for halt in halts:
            self._go_to(halt)
            if halt.pose is None:
                continue
            found.setdefault(halt.pose, []).append(self._average())
            if len(found[halt.pose]) == 2:
                self._console.say(f"pose {halt.pose + 1} measured")
        return [_both(approaches) for approaches in found.values()]

    def _go_to(self, halt: Halt) -> None:
        self._rig.crew.desk.move_to(halt.q.tolist(), halt.speed)
        self._wait(JointMove(self._here, halt.q, halt.speed).duration + SETTLE)
        self._here = halt.q

    def _ask(self, text: str, prompt: Prompt) -> None:
        self._console.say(text)
        while self._stage.tick(prompt) != " ":
            pass

    def _wait(self, seconds: float) -> None:
        for _ in range(round(seconds / TICK) + 1):
            self._stage.tick(Prompt.MOVING)

    def _average(self) -> tuple[Array, Array]:
        """Return mean (positions, torques) of half a second at rest.

        Raises:
            PreflightError: the arm does not come to rest.
        """
        speed = np.zeros(7)
        for _ in range(ATTEMPTS):
            self._wait(AVERAGE)
            records = self._rig.crew.desk.last(AVERAGE)
            q = records["position"]
            speed = np.abs(q[-1] - q[0]) / AVERAGE
            if speed.max() <= STILL:
                return q.mean(axis=0), records["torque_command"].mean(axis=0)
        raise PreflightError(
            f"Joint {speed.argmax() + 1} moved at {speed.max():.3f} rad/s while it was "
            f"weighed (limit {STILL}).",
            hint="Nobody may touch the arm. Start again.",
        )

    def _fit(self, measured: list[Measured], *, is_forced: bool) -> GravityCalibration:
        rig = self._rig
        q = np.array([pose.q for pose in measured])
        tau = np.array([pose.tau for pose in measured])
        fit = fit_moments(rig.model.constants, q, tau)
        self._say_residuals(fit, measured)
        if not is_forced:
            check_fit(fit)
        assert rig.model.tool is not None
        return GravityCalibration(
            mus=fit.mus,
            residual=fit.residual,
            rank=fit.rank,
            foot=rig.row.foot,
            tool=rig.model.tool,
            measured_utc=iso_utc(rig.clock.utc_ns()),
            is_simulated=rig.is_simulated,
            poses=q,
            torques=tau,
        )

    def _say_residuals(self, fit: MomentFit, measured: list[Measured]) -> None:
        friction = np.abs([pose.friction for pose in measured]).mean(axis=0)
        rows = [_row(str(i), rest) for i, rest in enumerate(fit.residuals, 1)]
        rows.append(_row("dry friction", friction))
        header = ["residual [N m]", *(f"joint {joint}" for joint in range(1, 8))]
        self._console.table(header, rows)
        self._console.say(
            f"rms {fit.residual:.3f} N m, rank {fit.rank} of 12, condition "
            f"{fit.condition:.1f}"
        )


def _row(name: str, values: Array) -> list[str]:
    return [name, *(f"{value:.3f}" for value in values)]


def _both(approaches: list[tuple[Array, Array]]) -> Measured:
    (q_a, tau_a), (q_b, tau_b) = approaches
    return Measured((q_a + q_b) / 2, (tau_a + tau_b) / 2, (tau_a - tau_b) / 2)
