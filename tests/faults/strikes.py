"""Every device and guard fault of the matrix, and how it is done."""

import errno
import os
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from tests.faults.rehearse import MS, SimulatedScene, Strike, inject
from wam.control.controller import FootController

_J2, _J6 = 1, 5


def _tighten(change: Callable[[SimulatedScene], dict[str, object]]) -> Strike:
    """Return a strike that moves limits to where the arm is, until it is mended."""

    def inject(scene: SimulatedScene) -> None:
        cycle = scene.cycle
        scene.usual_limits = cycle.limits
        cycle.limits = replace(cycle.limits, **change(scene))

    return inject


def _behind_a_stop(scene: SimulatedScene) -> dict[str, object]:
    upper = list(scene.cycle.limits.q_upper)
    upper[_J6] = float(scene.rig.plant.q[_J6]) - 0.01
    return {"q_upper": tuple(upper)}


def _weak(scene: SimulatedScene) -> dict[str, object]:
    tau = list(scene.cycle.limits.torque)
    tau[_J2] = 0.5  # the arm's weight is more
    return {"torque": tuple(tau)}


def _swing(scene: SimulatedScene) -> dict[str, object]:
    scene.rig.plant.qd[_J6] = 8.0
    return {"foot_speed": 0.2}


def _nonsense(scene: SimulatedScene) -> None:
    """Let the control law come to no number."""
    nan = np.full(7, np.nan)
    scene.patch.setattr(FootController, "torque", lambda *_: (nan, nan))


def _stall(duration_ms: int) -> Strike:
    """Return a strike that takes the computer away from the loop."""

    def inject(scene: SimulatedScene) -> None:
        clock = scene.clock
        clock.sleep_until(clock.now_ns() + duration_ms * MS)

    return inject


def _step_utc(scene: SimulatedScene) -> None:
    clock = scene.clock
    usual = clock.utc_ns
    scene.patch.setattr(clock, "utc_ns", lambda: usual() + 3600 * 1000 * MS)


def _no_disk(number: int) -> Strike:
    """Return a strike after which nothing reaches the disk."""

    def refuse(_: int) -> None:
        raise OSError(number, os.strerror(number))

    return lambda scene: scene.patch.setattr(os, "fsync", refuse)


_BY_HAND: dict[str, Strike] = {
    "joint-limit": _tighten(_behind_a_stop),
    "torque-limit": _tighten(_weak),
    "foot-speed": _tighten(_swing),
    "not-a-number": _nonsense,
    "stall-3-ms": _stall(3),
    "stall-20-ms": _stall(20),
    "stall-150-ms": _stall(150),
    "clock-step": _step_utc,
    "disk-full": _no_disk(errno.ENOSPC),
    "disk-read-only": _no_disk(errno.EROFS),
}


def strike_of(name: str) -> Strike:
    """Return what `name` does; most names are those of `--fault`."""
    return _BY_HAND.get(name) or inject(name)
