"""How far a wrong rig runs before the guard puts it to idle: the loop alone.

python -m studies.wrong_rigs [--friction 0.3] [--only NAME]

Driver, guard, control law and simulated arm, without console, person or sensor. The
arm is asked to hold, the pendant activates it, nobody holds it; for 1.5 s its true
motion is looked at. Exits with 1 where fewer than 18 of the 22 rigs are idled within
130 ms and 40 mm, or fewer than 21 stay below 0.7 m/s.
"""

import argparse
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from acquisition.control_loop.cycle import Cycle, CycleOutputs
from acquisition.control_loop.law import FootObserver
from acquisition.control_loop.loop import Loop
from acquisition.control_loop.states import ArmState
from acquisition.devices import ArmReading, Vector
from fakes.clock import SteppedClock
from fakes.ground.terrain import GroundChoice
from fakes.plant.model import PlantOptions, Support
from fakes.plant.wiring import Wiring
from fakes.world.rig import FakeRig, SimulatedScene
from fakes.world.true_rig import true_options
from fakes.world.wrong_rigs import scaled, wrong_rig
from tests.acquisition.control_loop.limits import guard_limits
from tests.fakes.scenes import CONSTANTS, FRAME, START_Q, TOOL
from wam.bus.link import CanLink
from wam.bus.transports import PythonCanTransport
from wam.control.controller import FootController
from wam.control.soft_walls import SoftWalls, Walls
from wam.driver.arm import WamArm
from wam.driver.settings import ArmSettings
from wam.model.arm_model import ArmModel
from wam.model.constants import Body
from wam.model.tool import Tool

TORQUE = (20.0, 45.0, 15.0, 15.0, 2.5, 2.5, 1.3)
SECONDS = 1.5
SOON, NEAR, SLOW = 0.130, 0.040, 0.7  # s, m, m/s
ENOUGH_NEAR, ENOUGH_SLOW = 18, 21
_MS = 1_000_000
_PERIOD = 0.002
Each = Callable[[Vector, Vector, Vector], object]  # q, qd, torques as sent
LIMITS = guard_limits(
    q_lower=tuple(CONSTANTS.q_lower.tolist()),
    q_upper=tuple(CONSTANTS.q_upper.tolist()),
    speed=ArmSettings().speed_limits,
    torque=TORQUE,
)


@dataclass(frozen=True, slots=True)
class GuardRig:
    """What is wrong with a rig.

    Attributes:
        name: in words.
        torque: what each motor makes of each torque that is sent, shape (7, 7).
        counts: what each encoder tells of each motor's place, shape (7, 7).
        properties: of pucks, that nobody read: (node, name, value).
        foot_mass: as it is typed [kg]; None = as it is.
        down: direction of gravity in the base frame.
        is_asked: the arm is asked to hold before it is activated.
        free_rotor: motor whose cable is torn, 1-7; its rotor alone turns. 0 = none.
    """

    name: str
    torque: np.ndarray = field(default_factory=lambda: np.eye(7))
    counts: np.ndarray = field(default_factory=lambda: np.eye(7))
    properties: tuple[tuple[int, str, int], ...] = ()
    foot_mass: float | None = None
    down: tuple[float, float, float] = (0.0, 0.0, -1.0)
    is_asked: bool = True
    free_rotor: int = 0


def known(name: str, words: str) -> GuardRig:
    """Return a rig of the catalogue, called `words`."""
    rig = wrong_rig(name).departure
    return GuardRig(
        words,
        torque=rig.torque,
        counts=rig.counts,
        properties=rig.properties,
        foot_mass=rig.foot_typed,
        down=true_options(PlantOptions(), rig).down,
        free_rotor=rig.torn,
    )


RIGS = (
    GuardRig("activated while the program is idle", is_asked=False),
    known("motor-2-reversed", "motor 2 reversed"),
    known("motor-3-reversed", "motor 3 reversed"),
    known("motor-4-reversed", "motor 4 reversed"),
    known("motor-5-reversed", "motor 5 reversed"),
    known("motors-5-6-swapped", "motor cables 5/6 swapped"),
    known("encoders-5-6-swapped", "encoders 5/6 swapped"),
    known("motors-2-3-swapped", "motor cables 2/3 swapped"),
    known("motors-1-4-swapped", "motor cables 1/4 swapped"),
    known("pidx-3-is-2", "PIDX 2 on puck 3"),
    known("pidx-2-is-1", "PIDX 1 on puck 2"),
    known("mt-700", "MT 700 on pucks 2, 3"),
    known("mt-400", "MT 400 on puck 2"),
    GuardRig("IPNM of puck 2 a tenth", torque=scaled(m2=0.1)),
    GuardRig("IPNM of puck 2 tenfold", torque=scaled(m2=10.0)),
    known("motor-2-dead", "motor 2 without torque"),
    known("motors-2-3-half", "motors 2 and 3 at half torque"),
    known("foot-typed-4.5kg", "foot typed 4.5 kg"),
    GuardRig("foot typed 2.95 kg", foot_mass=2.95),
    known("base-on-wall", "base on a wall"),
    known("base-on-ceiling", "base on the ceiling"),
    known("cable-2-torn", "cable of motor 2 torn"),
)
OTHERS = (
    GuardRig("sound"),
    GuardRig("base on a wall, foot down", down=(1.0, 0.0, 0.0)),
    GuardRig("base tilted by 45 degrees", down=(0.7071, 0.0, -0.7071)),
    GuardRig("base tilted by 10 degrees", down=(0.1736, 0.0, -0.9848)),
    *(
        GuardRig(f"motor {k} without torque", torque=scaled(**{f"m{k}": 0.0}))
        for k in (1, 3, 4, 5, 6, 7)
    ),
    *(known(f"motor-{k}-reversed", f"motor {k} reversed") for k in (1, 6, 7)),
)


@dataclass(frozen=True, slots=True)
class RunAway:
    """What a rig did in 1.5 s from its activation.

    Attributes:
        rig: its name.
        reason: of the guard; empty = it saw nothing.
        idle_ms: when idle was asked for [ms]; infinite = never.
        travel: of the sole until then [m].
        speed: largest speed of the sole [m/s].
        joint: largest speed of a joint by then, as a share of its limit.
        end: travel of the sole in the whole time [m].
    """

    rig: str
    reason: str
    idle_ms: float
    travel: float
    speed: float
    joint: float
    end: float

    @property
    def is_near(self) -> bool:
        """Whether it was idled soon and near."""
        return self.idle_ms <= 1e3 * SOON and self.travel <= NEAR

    def row(self) -> str:
        """Return a row of the table in Markdown."""
        idle = f"{self.idle_ms:.0f} ms" if np.isfinite(self.idle_ms) else "never"
        return (
            f"| {self.rig} | {self.reason or '-'} | {idle} "
            f"| {1e3 * self.travel:.0f} mm | {self.speed:.2f} m/s "
            f"| {self.joint:.2f} | {1e3 * self.end:.0f} mm |"
        )


HEADER = (
    "| rig | told | idle asked for after | sole until then | its largest speed "
    "| joint, of its limit | sole in 1.5 s |\n|---|---|---|---|---|---|---|"
)


class _Sole(FootObserver):
    """Shows the guard where the sole is, as the arm's model has it."""

    def __init__(self, model: ArmModel) -> None:
        self._model = model

    def set_bias(self, bias: Sequence[float]) -> None:
        """There is no sensor."""

    def observe(self, reading, wrench, sample) -> float:
        """Write the sole's place; return its speed [m/s]."""
        pose, _, twist = self._model.sole_motion(reading.q, reading.qd)
        sample.foot_position[...] = pose[:3]
        return float(np.linalg.norm(twist[:3]))


class _NoSensor:
    def poll(self, now_ns: int) -> list:
        del now_ns
        return []


def _wiring(rig: FakeRig, wrong: GuardRig) -> Wiring:
    """Return what passes between pucks and motors of a rig that stands."""
    turns = CONSTANTS.j2mp @ CONSTANTS.home / (2.0 * np.pi)
    home = turns * np.array(CONSTANTS.cts)  # where the arm was zeroed
    torn = wrong.free_rotor
    torn_at = rig.plant.counts()[torn - 1] if torn else 0
    return Wiring(wrong.torque, wrong.counts, home, torn, torn_at)


class _WatchedArm(WamArm):
    """Tells what it read and sent in each cycle."""

    each: Each | None = None

    def read(self, now_ns: int) -> ArmReading:
        """Read as ever."""
        self.read_last = super().read(now_ns)
        return self.read_last

    def send(self, tau: Vector, tau_gravity: Vector) -> Vector:
        """Send as ever."""
        sent = super().send(tau, tau_gravity)
        if self.each is not None:
            self.each(self.read_last.q, self.read_last.qd, sent)
        return sent


def run(
    wrong: GuardRig,
    friction: float,
    state: ArmState = ArmState.HOLD,
    each: Each | None = None,
) -> RunAway:
    """Return what a wrong rig does when it is activated and nobody holds it.

    Args:
        wrong: the rig.
        friction: share of another arm's.
        state: that is asked for.
        each: takes positions, velocities and torques as sent, from the activation on.
    """
    clock = SteppedClock()
    scene = SimulatedScene("S0", GroundChoice("small", "tread"), FRAME, START_Q, 1)
    options = PlantOptions(friction, has_hand=False, down=wrong.down)
    rig = FakeRig(scene, CONSTANTS, TOOL, clock, options)
    clock.attach(rig)
    rig.plant.terrain = None
    arm = _WatchedArm(CanLink(PythonCanTransport(rig.bus, clock)), clock)
    rig.plant.wiring = _wiring(rig, wrong)
    arm.start()
    for node, name, value in wrong.properties:
        rig.network.set_property(node, name, value)
    typed = _typed(wrong.foot_mass)
    walls = Walls(
        tuple(LIMITS.q_lower), tuple(LIMITS.q_upper), TORQUE, (*CONSTANTS.kd.tolist(),)
    )
    law = FootController(ArmModel(CONSTANTS, typed), 0.0, walls=SoftWalls(walls))
    outputs = CycleOutputs(lambda _: None, lambda _: None)
    observer = _Sole(ArmModel(CONSTANTS, typed))
    cycle = Cycle(arm, _NoSensor(), law, observer, LIMITS, outputs)
    loop = Loop(cycle, clock)
    loop.run(10)
    if wrong.is_asked:
        cycle.request(state)
        loop.run(20)
    rig.plant.support = Support.NONE
    rig.network.pendant("activate")
    arm.each = each
    seen = _watch(rig, cycle, loop)
    rig.bus.shutdown()
    return replace(seen, rig=wrong.name)


def _typed(mass: float | None) -> Tool:
    if mass is None:
        return TOOL
    foot = TOOL.foot
    return replace(TOOL, foot=Body(mass, foot.com, foot.inertia))


def _watch(rig: FakeRig, cycle: Cycle, loop: Loop) -> RunAway:
    """Return what happens in 1.5 s; the rig's name is left open."""
    model = ArmModel(CONSTANTS, TOOL)
    limits = np.array(LIMITS.speed)
    begin = place = model.sole_pose(rig.plant.q)[0]
    idle_ms, travel, speed, joint = np.inf, 0.0, 0.0, 0.0
    for k in range(round(SECONDS / _PERIOD)):
        loop.step()
        place, rates = model.sole_motion(rig.plant.q, rig.plant.qd)[::2]
        speed = max(speed, float(np.linalg.norm(rates[:3])))
        joint = max(joint, float((np.abs(rig.plant.qd) / limits).max()))
        if not np.isfinite(idle_ms):
            travel = max(travel, float(np.linalg.norm(place[:3] - begin)))
            if cycle.status.state is ArmState.IDLE and cycle.status.verdict is not None:
                idle_ms = 1e3 * _PERIOD * (k + 1)
    verdict = cycle.status.verdict
    reason = "" if verdict is None else verdict.reason
    end = float(np.linalg.norm(place[:3] - begin))
    return RunAway("", reason, idle_ms, travel, speed, joint, end)


def are_bounded(found: Sequence[RunAway]) -> bool:
    """Return whether enough of the 22 rigs are idled soon and stay slow."""
    near = sum(each.is_near for each in found)
    slow = sum(each.speed <= SLOW for each in found)
    return near >= ENOUGH_NEAR and slow >= ENOUGH_SLOW


def main(tell: Callable[[str], object] = print) -> int:
    """Measure, print the table; return 1 beyond a bound."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--friction", type=float, default=0.3)
    parser.add_argument("--only", default="")
    given = parser.parse_args()
    chosen = [rig for rig in (*RIGS, *OTHERS) if given.only in rig.name]
    tell(HEADER)
    found = []
    for rig in chosen:
        found.append(run(rig, given.friction))
        tell(found[-1].row())
    names = {rig.name for rig in RIGS}
    judged = [each for each in found if each.rig in names]
    near, slow = sum(e.is_near for e in judged), sum(e.speed <= SLOW for e in judged)
    tell(f"within 130 ms and 40 mm: {near} of {len(judged)}; <= 0.7 m/s: {slow}")
    return int(not given.only and not are_bounded(judged))


if __name__ == "__main__":
    sys.exit(main())
