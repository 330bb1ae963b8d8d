"""An arm that goes from halt to halt by itself and is measured where it settles."""

from collections.abc import Iterator
from dataclasses import dataclass

from experiments.run.pose_walk import HaltPlan, PoseWalk
from experiments.run.ready import activate
from wam.calibration.poses import MeasurementPose


@dataclass(frozen=True, slots=True)
class Arrival:
    """The arm stands at a halt.

    Attributes:
        halt: where it stands.
        seconds: the move and the settling took [s].
    """

    halt: MeasurementPose
    seconds: float


def arrivals(walk: PoseWalk, plan: HaltPlan, pause: float) -> Iterator[Arrival]:
    """Activate the arm, move it through all halts, have it laid down after the last.

    Args:
        walk: goes the way.
        plan: returns the halts, from where the arm is (7,) [rad] and where it may move.
        pause: how long the arm is kept in each pose [s].

    Yields:
        Each halt, when the arm has settled there.

    Raises:
        SettingsError: no safe way.
        PreflightError: not activated, or something held the arm up.
        StopRequestedError, ArmFaultError: as `ConsoleLoop.tick`.
    """
    rig = walk.console_loop.rig
    activate(walk.console_loop)
    for halt in walk.begin(plan, pause):
        began_ns = rig.clock.now_ns()
        walk.go_to(halt)
        yield Arrival(halt, (rig.clock.now_ns() - began_ns) * 1e-9)
    walk.end()
