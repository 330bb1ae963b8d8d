"""Would a residual of torque against motion see a wrong rig? The loop alone.

python -m studies.torque_residual

The observer of momentum p = M(q) qd of De Luca and Mattone (2003),

    r(t) = K (p - integral of (tau + dM/dt qd - C qd - g + r)),   K = 50 /s,

shows what acts on the joints beside the torques that were sent: friction, a hand, a
motor that makes another torque than it was asked for. It runs over the rigs of
`studies.wrong_rigs` and over sound arms. The limit of each joint is 1.2 times what a
sound arm shows: once untouched, once where a person pushes with 35 N at the sole, in
whichever direction turns the joint most (r = J^T F). Printed for every rig: when the
guard asks for idle, and when the residual is beyond either limit; below, what it takes
in a cycle.
"""

import sys
import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from studies.wrong_rigs import OTHERS, RIGS, GuardRig, run
from tests.fakes.scenes import CONSTANTS, START_Q, TOOL
from wam.model.arm_model import ArmModel
from wam.model.constants import Array

GAIN = 50.0  # 1/s
FRICTIONS = (0.02, 0.3, 1.0)
PUSH = 35.0  # N
ALLOWED = 1.2
_PERIOD = 0.002


@dataclass(slots=True)
class MomentumObserver:
    """The residual of one arm, cycle by cycle.

    Attributes:
        model: of the arm as it is taken to be.
        residual: r [N m], shape (7,).
    """

    model: ArmModel
    residual: Array
    _sum: Array
    _mass: Array | None = None

    @classmethod
    def of(cls, model: ArmModel) -> "MomentumObserver":
        """Return the observer of an arm at rest."""
        return cls(model, np.zeros(7), np.zeros(7))

    def step(self, q: Array, qd: Array, tau: Array) -> Array:
        """Return the residual after a cycle in which `tau` acted, shape (7,)."""
        mass = self.model.mass_matrix(q)
        momentum = mass @ qd
        if self._mass is None:
            self._sum, self._mass = momentum, mass
            return self.residual
        turning = (mass - self._mass) / _PERIOD @ qd - self.model.coriolis(q, qd)
        self._sum = self._sum + _PERIOD * (
            tau + turning - self.model.gravity(q) + self.residual
        )
        self._mass = mass
        self.residual = GAIN * (momentum - self._sum)
        return self.residual


@dataclass(frozen=True, slots=True)
class Course:
    """The residuals of a run.

    Attributes:
        residuals: from the activation on [N m], shape (n, 7).
        idle_ms: when the guard asked for idle [ms]; infinite = never.
    """

    residuals: Array
    idle_ms: float

    def first_ms(self, limits: Array) -> float:
        """Return when the residual of a joint is first beyond its limit [ms]."""
        beyond = (np.abs(self.residuals) > limits).any(axis=1)
        is_before = 2.0 * np.arange(beyond.size) <= self.idle_ms
        found = np.flatnonzero(beyond & is_before)
        return 1e3 * _PERIOD * (found[0] + 1) if found.size else np.inf


def course_of(rig: GuardRig, friction: float) -> Course:
    """Return the residuals of a rig that is activated and holds."""
    observer = MomentumObserver.of(ArmModel(CONSTANTS, TOOL))
    rows: list[Array] = []
    seen = run(
        rig,
        friction,
        each=lambda q, qd, tau: rows.append(observer.step(q, qd, tau).copy()),
    )
    return Course(np.array(rows).reshape(-1, 7), seen.idle_ms)


def pushed_torques() -> Array:
    """Return what a push at the sole turns each joint with at most [N m], (7,)."""
    jacobian = ArmModel(CONSTANTS, TOOL).sole_jacobian(START_Q)[:3]
    return PUSH * np.linalg.norm(jacobian, axis=0)


def cost_us() -> float:
    """Return the median time of a step [us]."""
    observer = MomentumObserver.of(ArmModel(CONSTANTS, TOOL))
    q, qd, tau = CONSTANTS.home.copy(), np.full(7, 0.1), np.ones(7)
    taken = []
    for _ in range(2000):
        begin = time.perf_counter()
        observer.step(q, qd, tau)
        taken.append(time.perf_counter() - begin)
    return 1e6 * float(np.median(taken))


def main(tell: Callable[[str], object] = print) -> int:
    """Measure and print."""
    sound = [course_of(OTHERS[0], share).residuals for share in FRICTIONS]
    untouched = np.abs(np.concatenate(sound)).max(axis=0)
    limits = [ALLOWED * untouched, ALLOWED * (untouched + pushed_torques())]
    for name, limit in zip(("untouched", "pushed"), limits, strict=True):
        tell(f"limits, {name}: {' '.join(f'{value:.1f}' for value in limit)} N m")
    tell("| rig | guard | residual, untouched | residual, pushed |\n|---|---|---|---|")
    sooner = [0, 0]
    for rig in (*RIGS, *OTHERS[1:]):
        course = course_of(rig, FRICTIONS[1])
        times = [course.first_ms(limit) for limit in limits]
        sooner = [n + (t < course.idle_ms) for n, t in zip(sooner, times, strict=True)]
        tell(f"| {rig.name} | {' | '.join(map(_ms, (course.idle_ms, *times)))} |")
    tell(
        f"sooner than the guard, of {len(RIGS) + len(OTHERS) - 1}: {sooner[0]} where "
        f"nobody may touch the arm, {sooner[1]} where a person may push it"
    )
    tell(f"a step: {cost_us():.0f} us")
    return 0


def _ms(value: float) -> str:
    return f"{value:.0f} ms" if np.isfinite(value) else "-"


if __name__ == "__main__":
    sys.exit(main())
