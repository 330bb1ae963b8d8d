"""Every device and guard fault of the matrix and its simulation."""

import errno
import os
import subprocess
import sys
import tempfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from experiments.messages import CATALOGUE
from experiments.rig.arm_lock import ArmLock
from fakes.plant.model import Support
from fakes.plant.wiring import Wiring
from tests.experiments.program import write_config
from tests.faults.expected import NOTHING
from tests.faults.rehearse import MS, SimulatedScene, Strike, inject
from wam.bus.frames import MOTOR_NODES, position_reply_id
from wam.control.controller import FootController
from wam.driver.settings import ArmSettings
from wam.driver.transmission import Transmission

_J2, _J6 = 1, 5
_ALMOST = 0.95  # share of the limits of driver and guard
_PERIOD = 0.002  # s
_LONG_BEAT_NS = 1000 * MS
_ARM_SETTINGS = ArmSettings()
_FAR_AWAY = (0.1, 0.3, 0.35)  # m, terrain frame
_SPEEDS = np.array(_ARM_SETTINGS.speed_limits)


def _tighten(change: Callable[[SimulatedScene], dict[str, object]]) -> Strike:
    """Return a strike that sets limits the arm exceeds until they are restored."""

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
    tau[_J2] = 0.5  # less than gravity compensation needs
    return {"torque": tuple(tau)}


def _swing(scene: SimulatedScene) -> dict[str, object]:
    if not scene.rig.plant.is_idle:
        scene.rig.plant.qd[_J6] = 5.0
    return {"foot_speed": 0.2}


def _nonsense(scene: SimulatedScene) -> None:
    """Make the control law return NaN."""
    nan = np.full(7, np.nan)
    scene.patch.setattr(FootController, "torque", lambda *_: (nan, nan))


def _stall(duration_ms: int) -> Strike:
    """Return a strike that suspends the loop."""

    def inject(scene: SimulatedScene) -> None:
        clock = scene.clock
        clock.sleep_until(clock.now_ns() + duration_ms * MS)

    return inject


def _step_utc(scene: SimulatedScene) -> None:
    clock = scene.clock
    usual = clock.utc_ns
    scene.patch.setattr(clock, "utc_ns", lambda: usual() + 3600 * 1000 * MS)


def _no_disk(number: int) -> Strike:
    """Return a strike after which no data reach the disk."""

    def refuse(_: int) -> None:
        raise OSError(number, os.strerror(number))

    return lambda scene: scene.patch.setattr(os, "fsync", refuse)


def _transmission(scene: SimulatedScene) -> Transmission:
    options = scene.rig.network.options
    torques = _ARM_SETTINGS.torque_limits
    return Transmission(_ARM_SETTINGS.j2mp, options.cts, options.ipnm, torques)


def _step_lie(motor: int) -> Strike:
    """Return a strike after which the reported position of a motor has a wrong offset.

    The offset is the largest step that the driver accepts in one cycle, and it stays.
    It begins in a cycle that follows one with a position request: across the cycle
    without a request, one in 47, the same step seems half as fast.
    """

    def inject(scene: SimulatedScene) -> None:
        fastest = _transmission(scene).fastest_counts(_SPEEDS)[motor - 1]
        step = int(_ALMOST * _ARM_SETTINGS.jump_margin * fastest * _PERIOD)
        reported_ns, is_false = 0, False

        def lie(counts: int) -> int:
            nonlocal reported_ns, is_false
            now_ns = scene.clock.now_ns()
            is_false = is_false or now_ns - reported_ns < 1.5 * _PERIOD * 1e9
            reported_ns = now_ns
            return counts + step if is_false else counts

        scene.rig.network.faults.falsify(position_reply_id(motor), lie)

    return inject


def _creeping_lie(motor: int) -> Strike:
    """Return a strike after which a motor's reported position drifts.

    It drifts as fast as possible within the guard's limits of joint speed.
    """

    def inject(scene: SimulatedScene) -> None:
        count = [int(node == motor) for node in MOTOR_NODES]
        turned = np.abs(_transmission(scene).joints(count))  # rad per count
        rate = _ALMOST * float((_SPEEDS[turned > 0] / turned[turned > 0]).min())
        begin_ns = scene.clock.now_ns()

        def lie(counts: int) -> int:
            return counts + int(rate * 1e-9 * (scene.clock.now_ns() - begin_ns))

        scene.rig.network.faults.falsify(position_reply_id(motor), lie)

    return inject


def _stuck(motor: int) -> Strike:
    """Return a strike that freezes the reported position of a motor."""

    def inject(scene: SimulatedScene) -> None:
        here = scene.rig.plant.counts()[motor - 1]
        reply = position_reply_id(motor)
        scene.rig.network.faults.falsify(reply, lambda _: here)

    return inject


def _deaf(motor: int) -> Strike:
    """Return a strike in which the pendant idles the arm and a puck misses it."""

    def inject(scene: SimulatedScene) -> None:
        scene.rig.network.deafen(motor)
        scene.rig.network.pendant("idle")

    return inject


def _wire(motor: int, share: float) -> Strike:
    """Return a strike after which a motor produces this share of its torque."""

    def inject(scene: SimulatedScene) -> None:
        torque = np.eye(7)
        torque[motor - 1, motor - 1] = share
        scene.rig.plant.wiring = Wiring(torque=torque)

    return inject


def _say(node: int, name: str, value: int) -> Strike:
    """Return a strike after which a puck has a different value of a property."""
    return lambda scene: scene.rig.network.set_property(node, name, value)


def _late(late_ns: int) -> Strike:
    """Return a strike after which every reply is late permanently."""

    def inject(scene: SimulatedScene) -> None:
        for node in MOTOR_NODES:
            reply = position_reply_id(node)
            scene.rig.network.faults.delay(reply, late_ns, None)

    return inject


def _let_go(scene: SimulatedScene) -> None:
    """Make the person release the arm, which is then unsupported."""
    scene.rig.plant.hand.let_go()
    scene.rig.plant.support = Support.NONE


def _drag(scene: SimulatedScene) -> None:
    """Make the person pull the foot away against the arm."""
    scene.rig.plant.hand.carry(_FAR_AWAY)


def _stall_under_a_long_heartbeat(scene: SimulatedScene) -> None:
    """Suspend the loop for 150 ms with a heartbeat limit of 1 s."""
    scene.rig.network.set_heartbeat(_LONG_BEAT_NS)
    _stall(150)(scene)


def _suspended(scene: SimulatedScene) -> None:
    """Suspend the loop for 1 s; meanwhile a person activates the arm again."""
    _stall(900)(scene)
    scene.rig.network.pendant("idle")
    scene.rig.network.pendant("activate")
    _stall(100)(scene)


def _long_heartbeat_and_silence(scene: SimulatedScene) -> None:
    """Silence the arm with a heartbeat limit of 1 s."""
    scene.rig.network.set_heartbeat(_LONG_BEAT_NS)
    inject("can-silence")(scene)


def _second_command(_: SimulatedScene) -> None:
    """Start another command for the arm of this process; check that it is refused."""
    with tempfile.TemporaryDirectory(prefix="second-") as scratch:
        config = write_config(Path(scratch), rig=('"socketcan" ', '"traction-fake" '))
        channel = f"{scratch}/bus"
        config.write_text(config.read_text().replace('"can0"', f'"{channel}"'))
        lock = ArmLock("traction-fake", channel)
        try:
            command = [sys.executable, "-m", "experiments", "check", "--config", config]
            done = subprocess.run(command, capture_output=True, check=False, text=True)
        finally:
            lock.close()
            lock.path.unlink()
    assert done.returncode == CATALOGUE["arm-busy"].exit_code, done.stderr
    assert f"in use: process {os.getpid()}" in done.stderr


_BY_HAND: dict[str, Strike] = {
    NOTHING: lambda _: None,
    "joint-limit": _tighten(_behind_a_stop),
    "torque-limit": _tighten(_weak),
    "foot-speed": _tighten(_swing),
    "early-activation": lambda scene: scene.rig.network.pendant("activate"),
    "not-a-number": _nonsense,
    "stall-3-ms": _stall(3),
    "stall-20-ms": _stall(20),
    "stall-150-ms": _stall(150),
    "suspended-1-s": _suspended,
    "clock-step": _step_utc,
    "second-command": _second_command,
    "disk-full": _no_disk(errno.ENOSPC),
    "disk-read-only": _no_disk(errno.EROFS),
    "stall-150-ms, heartbeat 1 s": _stall_under_a_long_heartbeat,
    "can-silence, heartbeat 1 s": _long_heartbeat_and_silence,
    "replies-late-2": _late(3_950_000),
    "replies-late-3": _late(5_900_000),
    "hand-gone": _let_go,
    "hold-dragged": _drag,
    "wrong-pidx": _say(3, "PIDX", 2),
    "wrong-mt": _say(2, "MT", 400),
    "wrong-grp": _say(3, "GRPB", 2),
    "wrong-ipnm": _say(7, "IPNM", 27000),
    "wrong-cts": _say(4, "CTS", 40960),
    **{f"deaf-puck-{motor}": _deaf(motor) for motor in MOTOR_NODES},
    **{f"dead-motor-{motor}": _wire(motor, 0.0) for motor in MOTOR_NODES},
    **{f"reversed-motor-{motor}": _wire(motor, -1.0) for motor in MOTOR_NODES},
    **{f"lie-of-motor-{motor}": _step_lie(motor) for motor in MOTOR_NODES},
    **{f"stuck-motor-{motor}": _stuck(motor) for motor in MOTOR_NODES},
    **{f"creep-of-motor-{motor}": _creeping_lie(motor) for motor in MOTOR_NODES},
}


def strike_of(name: str) -> Strike:
    """Return the strike of `name`; most names are those of `--fault`."""
    return _BY_HAND.get(name) or inject(name)
