# pyright: reportMissingImports=false
"""Cost of one 2 ms cycle of the simulated arm, in contact on small stones.

A trial on level ground is simulated once to record the inputs of every part, again to
time whole cycles, and then each part alone is run on its recorded inputs. Medians are
over cycles in contact; integration is the whole minus the other parts.
"""

import argparse
import gc
import json
import math
import statistics
import time
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass, field

import numpy as np
import pinocchio as pin

from acquisition.clock import PERIOD_NS
from fakes.ground.contact import Contact, Motion
from fakes.ground.terrain import GroundChoice, Terrain, make_terrain
from fakes.plant.plant import ArmPlant
from fakes.plant.push import HandView, Pace, Push, Vector3
from fakes.randomness import TrialGenerators, trial_generators
from fakes.truth import Truth
from fakes.world.rig import solve_start
from ft_sensor.payload import TerrainFrame
from wam.model.arm_model import ArmModel, add_point, build_pinocchio
from wam.model.constants import Body, load_constants
from wam.model.gravity import compensation
from wam.model.tool import Tool, box_inertia, sensor_body

GOAL_US = 160.0  # per cycle of four substeps
SUBSTEPS = 4
_EFFECTIVE_MASS = 0.30  # kg
_SETTLING = 1000  # cycles to put the foot down
_TOUCHING = 0.05  # normal force of a foot on the ground [N]
_SEED, _TERRAIN, _TRIAL = 1, "S0", 1
_FRAME = TerrainFrame(0.0, 0.0, (0.70, 0.0, 0.12), 0.45)
_START = np.array([0.0, 0.7696, 0.0, 1.1857, 0.0, 1.1863, 0.0])
_LOCK_KP, _LOCK_KD = 20.0, 0.2  # lock of joint 7: N m/rad, N m s/rad
_AXES = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED


@dataclass(frozen=True, slots=True)
class PartCost:
    """Measured cost of one part of a cycle [us]; `share` of the median of the whole."""

    name: str
    median_us: float
    p99_us: float
    share: float


@dataclass(slots=True)
class Notes:
    """Recorded inputs of the parts: motions per substep, everything else per cycle."""

    motions: list[Motion] = field(default_factory=list)
    views: list[HandView] = field(default_factory=list)
    states: list[tuple[np.ndarray, np.ndarray]] = field(default_factory=list)
    is_touching: list[bool] = field(default_factory=list)


class _NotedGround:
    """A ground that records the motion of the foot."""

    def __init__(self, notes: Notes) -> None:
        self._notes = notes
        self._ground = _ground()
        self.stiffness = self._ground.stiffness
        self.surface, self.truth = self._ground.surface, self._ground.truth

    def step(self, dt: float, motion: Motion) -> Contact:
        self._notes.motions.append(motion)
        return self._ground.step(dt, motion)


def main() -> int:
    """Measure and print; the exit code does not depend on the figures."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument(
        "--cycles", type=_positive, default=4000, metavar="N", help="per trial (4000)"
    )
    parser.add_argument("--json", action="store_true", help="print JSON instead")
    args = parser.parse_args()
    parts = measure(args.cycles)
    if args.json:
        is_met = parts[0].median_us <= GOAL_US
        rows = [asdict(part) for part in parts]
        fields = {"cycles": args.cycles, "goal_us": GOAL_US, "is_met": is_met}
        print(json.dumps({**fields, "parts": rows}, indent=2))
    else:
        _print_table(parts, args.cycles)
    return 0


def measure(cycles: int) -> list[PartCost]:
    """Simulate `cycles` of a push and return the cost of the whole and of each part."""
    notes = Notes()
    for _ in _run(cycles, notes):
        pass
    gc.collect()
    gc.disable()
    try:
        timed = {
            "whole": list(_run(cycles, None)),
            "Pinocchio": _time(_pinocchio(notes), cycles),
            "contact": _time(_contact(notes), cycles),
            "hand": _time(_hand(notes), cycles),
            "truth": _time(_truth(notes), cycles),
        }
    finally:
        gc.enable()
    timed["integration"] = [
        whole - sum(parts) for whole, *parts in zip(*timed.values(), strict=True)
    ]
    in_contact = {
        name: [
            us for us, touches in zip(row, notes.is_touching, strict=True) if touches
        ]
        for name, row in timed.items()
    }
    whole = statistics.median(in_contact["whole"])
    return [_part(name, row, whole) for name, row in in_contact.items()]


def _run(cycles: int, notes: Notes | None) -> Iterator[float]:
    """Simulate a push; yield the time of each cycle [us]."""
    model = ArmModel(load_constants(), _tool())
    plant = _plant(model)
    plant.terrain = _ground() if notes is None else _NotedGround(notes)
    plant.short_windings([False] * 7)
    plant.hand.put_down(plant.terrain.surface(0.0))
    for _ in range(_SETTLING):
        _cycle(plant, model)
    if notes is not None:
        notes.motions.clear()
        _note_views(plant, notes)
    plant.hand.push(Pace(), _random().hand)
    plant.start_truth()
    for _ in range(cycles):
        if notes is not None:
            notes.states.append((plant.q, plant.qd))
        yield _cycle(plant, model)
        if notes is not None:
            notes.is_touching.append(plant.contact_force[2] > _TOUCHING)


def _note_views(plant: ArmPlant, notes: Notes) -> None:
    step = plant.hand.step

    def noted(view: HandView) -> Vector3:
        notes.views.append(view)
        return step(view)

    plant.hand.step = noted


def _cycle(plant: ArmPlant, model: ArmModel) -> float:
    """Advance one cycle, gravity-compensated, joint 7 locked; return its time [us]."""
    constants = model.constants
    tau = compensation(model, plant.q, _EFFECTIVE_MASS).copy()
    tau[6] -= _LOCK_KP * plant.q[6] + _LOCK_KD * plant.qd[6]
    motor = np.linalg.solve(constants.j2mp.T, tau)
    plant.set_torques(np.rint(motor * np.array(constants.ipnm)).astype(int).tolist())
    begin = time.perf_counter_ns()
    plant.advance(plant.t_ns + PERIOD_NS)
    return (time.perf_counter_ns() - begin) * 1e-3


def _time(run: Callable[[int], None], cycles: int) -> list[float]:
    times: list[float] = []
    for cycle in range(cycles):
        begin = time.perf_counter_ns()
        run(cycle)
        times.append((time.perf_counter_ns() - begin) * 1e-3)
    return times


def _pinocchio(notes: Notes) -> Callable[[int], None]:
    """Return a function that makes the Pinocchio calls of a cycle."""
    constants, tool = load_constants(), _tool()
    model = build_pinocchio(constants, (tool.sensor, tool.foot))
    frames = [add_point(model, constants, name, tool.sole) for name in ("a", "b")]
    data = model.createData()
    tau = np.zeros(7)

    def run(cycle: int) -> None:
        q, qd = notes.states[cycle]
        for _ in range(2):
            pin.computeJointJacobians(model, data, q)
            for frame in frames:
                pin.updateFramePlacement(model, data, frame)
        for frame in frames:
            pin.getFrameJacobian(model, data, frame, _AXES)
        for _ in range(SUBSTEPS):
            pin.aba(model, data, q, qd, tau)

    return run


def _contact(notes: Notes) -> Callable[[int], None]:
    ground, dt = _ground(), PERIOD_NS * 1e-9 / SUBSTEPS

    def run(cycle: int) -> None:
        for motion in notes.motions[SUBSTEPS * cycle : SUBSTEPS * (cycle + 1)]:
            ground.step(dt, motion)

    return run


def _hand(notes: Notes) -> Callable[[int], None]:
    push = Push(Pace(), _random().hand, notes.views[0], PERIOD_NS * 1e-9)

    def run(cycle: int) -> None:
        push.step(notes.views[cycle])

    return run


def _truth(notes: Notes) -> Callable[[int], None]:
    truth = Truth()

    def run(cycle: int) -> None:
        q = notes.states[cycle][0]
        view = notes.views[cycle]
        row = (*q.tolist(), *view.sole, *view.sole_v, *view.hand, *view.hand_v)
        truth.add(cycle, row)

    return run


def _tool() -> Tool:
    foot = Body(0.45, np.array([0.01, 0.0, 0.062]), box_inertia(0.45, (0.1, 0.06, 0.1)))
    return Tool(sensor_body(), foot, np.array([0.01, 0.0, 0.112]))


def _plant(model: ArmModel) -> ArmPlant:
    q = solve_start(model, _FRAME, _START, 0.02)
    return ArmPlant(model.constants, _tool(), _FRAME, q)


def _random() -> TrialGenerators:
    return trial_generators(_SEED, _TERRAIN, _TRIAL)


def _ground() -> Terrain:
    return make_terrain(
        GroundChoice("small", "tread"), _FRAME.incline, _random().ground
    )


def _part(name: str, times: list[float], whole: float) -> PartCost:
    median = statistics.median(times)
    p99 = sorted(times)[math.ceil(0.99 * len(times)) - 1]
    return PartCost(name, median, p99, median / whole)


def _print_table(parts: list[PartCost], cycles: int) -> None:
    print(f"{'part':17}{'p50 us':>10}{'p99 us':>10}{'share':>8}")
    for part in parts:
        print(
            f"{part.name:17}{part.median_us:10.1f}{part.p99_us:10.1f}{part.share:8.2f}"
        )
    verdict = "met" if parts[0].median_us <= GOAL_US else "missed"
    print(f"{cycles} cycles; goal {GOAL_US:.0f} us per cycle: {verdict}")


def _positive(text: str) -> int:
    number = int(text)
    if number < 1:
        raise argparse.ArgumentTypeError("expected a whole number above 0")
    return number


if __name__ == "__main__":
    raise SystemExit(main())
