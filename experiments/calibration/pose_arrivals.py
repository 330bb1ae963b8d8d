"""Automatic motion from halt to halt, for measurements at rest."""

from collections.abc import Iterator
from dataclasses import dataclass

from experiments.run.pose_walk import HaltPlan, PoseWalk
from experiments.run.ready import activate
from wam.calibration.poses import MeasurementPose


@dataclass(frozen=True, slots=True)
class Arrival:
    """The arm has come to rest at a halt.

    Attributes:
        halt: the halt.
        seconds: duration of move and settling [s].
    """

    halt: MeasurementPose
    seconds: float


def arrivals(walk: PoseWalk, plan: HaltPlan, pause: float) -> Iterator[Arrival]:
    """Activate the arm, move it through all halts, have it laid down after the last.

    Args:
        walk: moves the arm.
        plan: returns the halts, given the position of the arm (7,) [rad] and the free
            space.
        pause: duration of the stop in each pose [s].

    Yields:
        Each halt, once the arm has settled there.

    Raises:
        SettingsError: there is no safe path.
        PreflightError: the arm was not activated, or was obstructed.
        StopRequestedError, ArmFaultError: as `ConsoleLoop.tick`.
    """
    rig = walk.console_loop.rig
    activate(walk.console_loop)
    for halt in walk.begin(plan, pause):
        start_ns = rig.clock.now_ns()
        walk.go_to(halt)
        yield Arrival(halt, (rig.clock.now_ns() - start_ns) * 1e-9)
    walk.end()
