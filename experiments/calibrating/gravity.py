"""traction calibrate gravity: hold the arm in many poses, fit what it weighs."""

from dataclasses import dataclass

import numpy as np

from acquisition.errors import SettingsError
from experiments.activation import activate
from experiments.operator import Prompt
from experiments.stage import TICK, Stage
from experiments.store import iso_utc
from wam.constants import Array
from wam.first_moments import MomentFit, fit_moments, gravity_torque
from wam.gravity_file import GravityCalibration
from wam.gravity_poses import Halt, choose_poses, plan_halts, way_seconds
from wam.move import JointMove
from wam.tool import tool_facts

SETTLE = 1.0  # s after a move
AVERAGE = 0.5  # s of torques that are averaged
CLEARANCE = 0.15  # m the sole stays above the container's far end
STILL = 0.02  # rad/s, largest joint speed while torques are averaged
LARGEST_POSE_RESIDUAL = 1.0  # N m of any joint in any pose


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

    def run(self, count: int, *, is_forced: bool) -> GravityCalibration:
        """Measure in `count` poses and return the calibration.

        The arm moves by itself, at 0.5 rad/s at most, after a person has said that
        the space is clear.

        Args:
            count: how many poses.
            is_forced: accept a residual above 1 N m in a single joint.

        Raises:
            SettingsError: the poses show too little, or the fit is bad.
            StopAskedError, FaultedError: as `Stage.tick`.
        """
        activate(self._stage)
        start = self._rig.crew.desk.latest()["position"][0].copy()
        floor = self._rig.frame.far_end[2] + CLEARANCE
        model = self._rig.model
        halts = plan_halts(model, start, choose_poses(model, count, floor), floor)
        count = len({halt.pose for halt in halts if halt.pose is not None})
        minutes = (way_seconds(start, halts) + len(halts) * SETTLE + count) / 60
        self._console.say(
            f"The arm will move by itself through {count} poses, about "
            f"{minutes:.0f} min. Let go of it and clear the space. [space] when clear."
        )
        while self._stage.tick(Prompt.CLEAR) != " ":
            pass
        measured = self._measure(start, halts, count)
        return self._fit(measured, is_forced=is_forced)

    def _measure(self, start: Array, halts: list[Halt], count: int) -> list[Measured]:
        found: dict[int, list[tuple[Array, Array]]] = {}
        here = start
        for halt in halts:
            self._go_to(here, halt.q)
            here = halt.q
            if halt.pose is None:
                continue
            found.setdefault(halt.pose, []).append(self._average())
            if len(found[halt.pose]) == 2:
                self._console.say(f"pose {halt.pose + 1} of {count} measured")
        return [_both(approaches) for approaches in found.values()]

    def _go_to(self, here: Array, goal: Array) -> None:
        self._rig.crew.desk.move_to(goal.tolist())
        self._wait(JointMove(here, goal).duration + SETTLE)

    def _wait(self, seconds: float) -> None:
        for _ in range(round(seconds / TICK) + 1):
            self._stage.tick(Prompt.MOVING)

    def _average(self) -> tuple[Array, Array]:
        """Return mean (positions, torques) of half a second at rest.

        Raises:
            SettingsError: the arm was not at rest.
        """
        self._wait(AVERAGE)
        records = self._rig.crew.desk.last(AVERAGE)
        q = records["position"]
        speed = float(np.abs(q[-1] - q[0]).max()) / AVERAGE
        if speed > STILL:
            raise SettingsError(
                f"The arm moved at {speed:.3f} rad/s while it was weighed (limit "
                f"{STILL}).",
                hint="Nobody may touch it. Start again.",
            )
        return q.mean(axis=0), records["torque_command"].mean(axis=0)

    def _fit(self, measured: list[Measured], *, is_forced: bool) -> GravityCalibration:
        rig = self._rig
        q = np.array([pose.q for pose in measured])
        tau = np.array([pose.tau for pose in measured])
        fit = fit_moments(rig.model.constants, q, tau)
        worst = self._say_residuals(fit, measured)
        if worst > LARGEST_POSE_RESIDUAL and not is_forced:
            raise SettingsError(
                f"One torque is {worst:.2f} N m from the fit (limit "
                f"{LARGEST_POSE_RESIDUAL}).",
                hint="Was the arm touched in that pose? Start again, or add --force.",
            )
        assert rig.model.tool is not None
        return GravityCalibration(
            mus=fit.mus,
            residual=fit.residual,
            rank=fit.rank,
            foot=rig.row.foot,
            tool=tool_facts(rig.model.tool),
            measured_utc=iso_utc(rig.clock.utc_ns()),
            poses=q,
        )

    def _say_residuals(self, fit: MomentFit, measured: list[Measured]) -> float:
        """Print the table of residuals; return the largest of all [N m]."""
        constants, worst = self._rig.model.constants, 0.0
        self._console.say("pose   residual of joints 1 to 7 [N m]")
        for number, pose in enumerate(measured, 1):
            rest = pose.tau - gravity_torque(constants, fit.mus, pose.q)
            worst = max(worst, float(np.abs(rest).max()))
            self._console.say(f"{number:4}  " + "".join(f"{r:7.2f}" for r in rest))
        friction = np.abs([pose.friction for pose in measured]).mean(axis=0)
        self._console.say(
            "dry friction, mean " + "".join(f"{f:7.2f}" for f in friction)
        )
        self._console.say(f"rms {fit.residual:.3f} N m, rank {fit.rank} of 12")
        return worst


def _both(approaches: list[tuple[Array, Array]]) -> Measured:
    (q_a, tau_a), (q_b, tau_b) = approaches
    return Measured((q_a + q_b) / 2, (tau_a + tau_b) / 2, (tau_a - tau_b) / 2)
