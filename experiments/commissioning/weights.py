"""C6 and C7: the foot's own weight and a known one, in held poses, arm idle.

Their recordings are evaluated in `fits`.
"""

from collections.abc import Sequence

import numpy as np

from acquisition.errors import PreflightError
from acquisition.ipc.shared_sensor import unpack_wrenches
from experiments.commissioning.evidence.order import StepId
from experiments.commissioning.fits import FITTED, fit_foot, fit_hung
from experiments.commissioning.judging import Judgement, judge_quantity, judged
from experiments.commissioning.manual_joints import CARRY_SECONDS
from experiments.commissioning.recording import Values, number
from experiments.commissioning.scene import Scene
from experiments.commissioning.step import Step
from wam.model.constants import Array

# Poses in which the foot points down, ahead, to the sides and up [rad].
POSES: Sequence[Sequence[float]] = (
    (0.0, -0.6, 0.0, 2.2, 0.0, 1.4, 0.0),
    (0.0, -0.6, 0.0, 2.2, 0.0, 0.0, 0.0),
    (0.0, -0.6, 0.0, 2.2, 0.0, 0.0, 1.6),
    (0.0, -0.6, 0.0, 2.2, 0.0, 0.0, -1.6),
    (0.0, -0.6, 0.0, 1.2, 0.0, -0.5, 0.0),
    (0.0, -0.6, 0.0, 2.2, -1.6, 1.4, 0.0),
    (0.0, -0.6, 0.0, 2.2, 1.1, 1.4, 1.0),
    (0.0, -0.6, 0.5, 1.8, 0.0, -0.5, 2.8),
)
HUNG_AT = (0, 1, 2, 3, 5, 6)
HUNG = 2.0  # kg
SETTLED, AVERAGE = 1.0, 2.0  # s, settling and averaging time
_FEWEST = 100  # readings in an average


def own_weight(scene: Scene) -> Values:
    """Have the arm brought to eight poses; returns joints and readings.

    Raises:
        PreflightError: too few readings.
        ArmFaultError, StopRequestedError: as `ConsoleLoop.tick`.
    """
    q: list[Array] = []
    readings: list[Array] = []
    for i, pose in enumerate(POSES):
        scene.show_share(i / len(POSES), f"pose {i + 1} of {len(POSES)}")
        bring(scene, pose, f"pose {i + 1} of {len(POSES)}")
        measured = measure(scene)
        q.append(measured[0])
        readings.append(measured[1])
    return {"q": np.array(q), "readings": np.array(readings), **_nominal(scene)}


def hung_weight(scene: Scene) -> Values:
    """Have a known weight hung from the sole in six poses, without it before and after.

    Raises:
        PreflightError: too few readings, or the stops were not measured.
        ArmFaultError, StopRequestedError: as `ConsoleLoop.tick`.
    """
    if scene.stops is None:
        raise PreflightError(
            "The stops of the joints were not measured.",
            hint="traction commission --from C5",
            arm_state="idle; it sinks slowly, support it",
        )
    parts: list[list[Array]] = [[], [], [], []]
    for i, at in enumerate(HUNG_AT):
        where = f"pose {i + 1} of {len(HUNG_AT)}"
        scene.show_share(i / len(HUNG_AT), where)
        bring(scene, POSES[at], where)
        q, before = measure(scene)
        _hang(
            scene, HUNG, f"Hang {HUNG:g} kg from the middle of the sole, on a string."
        )
        q, loaded = measure(scene)
        _hang(scene, 0.0, "Take the weight off.")
        _, after = measure(scene)
        for part, value in zip(parts, (q, before, loaded, after), strict=True):
            part.append(value)
    names = ("q", "before", "loaded", "after")
    arrays = {name: np.array(part) for name, part in zip(names, parts, strict=True)}
    return {
        **arrays,
        **_nominal(scene),
        "hung": np.array(HUNG),
        "stops": scene.stops,
    }


def _nominal(scene: Scene) -> dict[str, Array]:
    """Foot and sensor as in rig.toml."""
    payload, tool = scene.rig.payload, scene.rig.model.tool
    assert tool is not None
    sole = tool.sole - np.array([0.0, 0.0, tool.sensor_height])
    return {
        "sign": np.array(payload.sign),
        "mounting": payload.rotation,
        "mass": np.array(payload.mass),
        "centre": payload.com,
        "sole": payload.rotation.T @ sole,
    }


def bring(scene: Scene, pose: Sequence[float], where: str) -> None:
    """Have the arm brought to `pose` [rad] and held there; raises as `own_weight`."""
    angles = "  ".join(f"J{i} {angle:.1f}" for i, angle in enumerate(pose, 1))
    scene.ask(
        f"Bring the arm to {where}, about [rad]: {angles}. Hold it by the forearm, "
        "nothing touches the foot. [space] when it is still."
    )
    if scene.simulation is not None:
        scene.simulation.pose(pose, CARRY_SECONDS)
        scene.await_hand()
        scene.wait(SETTLED)


def _hang(scene: Scene, mass: float, text: str) -> None:
    scene.ask(f"{text} [space] when it is still.")
    if scene.simulation is not None:
        scene.simulation.hang(mass)
        scene.wait(SETTLED)


def measure(scene: Scene) -> tuple[Array, Array]:
    """Mean positions [rad] and readings [N, N m] over two seconds, (7,) and (6,).

    Raises:
        PreflightError: too few readings.
    """
    reader = scene.loop_client.wrenches()
    scene.wait(AVERAGE)
    valid = [
        sample.wrench
        for sample in unpack_wrenches(reader.read())
        if sample.is_valid and not sample.saturated
    ]
    if len(valid) < _FEWEST:
        raise PreflightError(
            f"{len(valid)} readings of the F/T sensor in {AVERAGE:g} s (at least "
            f"{_FEWEST}).",
            hint="Check the sensor's cable and load, then begin the step again.",
            arm_state="idle; it sinks slowly, support it",
        )
    q = scene.loop_client.last(AVERAGE)["position"].mean(axis=0)
    return q, np.array(valid).mean(axis=0)


def judge_own_weight(values: Values) -> Judgement:
    """Judge axes and sign of the sensor, mass and centre of the foot, the base."""
    fit = fit_foot(values)
    centre_error = 1e3 * float(np.linalg.norm(fit.centre - values["centre"]))
    return judged(
        [
            judge_quantity("lever", 1e3 * fit.lever),
            judge_quantity("force_left", fit.force_left),
            judge_quantity(
                "foot_mass", 100.0 * (fit.mass / number(values, "mass") - 1.0)
            ),
            judge_quantity("weight_way", fit.tilt_deg),
            judge_quantity("foot_centre", centre_error),
            judge_quantity("moment_left", 1e3 * fit.moment_left),
        ]
    )


def judge_hung_weight(values: Values) -> Judgement:
    """Judge orientations and scale of the sensor, the sole, and twelve angles."""
    fit = fit_hung(values)
    angles = np.degrees(fit.angles)
    return judged(
        [
            judge_quantity("hung_scale", float(np.median(fit.scale))),
            judge_quantity("hung_spread", float(np.ptp(fit.scale))),
            judge_quantity("fitted", float(angles[fit.worst]), name=FITTED[fit.worst]),
            judge_quantity(
                "sole", 1e3 * float(np.linalg.norm(fit.sole - values["sole"]))
            ),
            judge_quantity("hung_way", fit.tilt_deg),
        ]
    )


OWN_WEIGHT = Step(
    StepId.OWN_WEIGHT,
    own_weight,
    judge_own_weight,
    minutes=8,
    remedy="Weigh the foot; look at the sensor's mounting, sign, sheet and cable.",
    needs_loop=True,
    needs_zero=True,
)
HUNG_WEIGHT = Step(
    StepId.HUNG_WEIGHT,
    hung_weight,
    judge_hung_weight,
    minutes=12,
    remedy="Zero the arm again where a zero is named; look at base and sensor.",
    needs_loop=True,
    needs_zero=True,
)
