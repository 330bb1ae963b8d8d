"""C6 and C7: the foot's own weight and a known one, in poses held by hand, arm idle.

With s the sensor's sign and R the believed orientation of the sensor, a foot that
weighs w in the base frame shows s f = b + R^T w and s n = b_n + c x R^T w: linear in
bias, centre and weight. Differences with and without a known weight are free of all but
that weight.
"""

from collections.abc import Sequence

import numpy as np

from acquisition.errors import PreflightError
from acquisition.ipc.shared_sensor import unpack_wrenches
from experiments.proving.by_hand import CARRIED
from experiments.proving.limits import Judgement, found, judged
from experiments.proving.recording import Values, number
from experiments.proving.scene import Scene
from ft_sensor.payload import cross_matrix
from wam.model.arm_model import ArmModel
from wam.model.constants import GRAVITY, Array, load_constants

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
SETTLED, AVERAGE = 1.0, 2.0  # s
_FEWEST = 100  # readings in an average
_PRIOR = np.radians(1.5)  # of each of the twelve angles
_DIRECTION, _STOP = np.radians(1.0), np.radians(0.6)  # spreads of what is measured
_STEP = 1e-6  # rad, of derivatives
_ROUNDS = 6


def own_weight(scene: Scene) -> Values:
    """Have the arm brought to eight poses; return joints and readings.

    Raises:
        PreflightError: too few readings.
        ArmFaultError, StopRequestedError: as `ConsoleLoop.tick`.
    """
    q: list[Array] = []
    readings: list[Array] = []
    for i, pose in enumerate(POSES):
        scene.show_share(i / len(POSES), f"pose {i + 1} of {len(POSES)}")
        _bring(scene, pose, f"pose {i + 1} of {len(POSES)}")
        measured = _measure(scene)
        q.append(measured[0])
        readings.append(measured[1])
    return {"q": np.array(q), "readings": np.array(readings), **_believed(scene)}


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
        _bring(scene, POSES[at], where)
        q, before = _measure(scene)
        _hang(
            scene, HUNG, f"Hang {HUNG:g} kg from the middle of the sole, on a string."
        )
        q, loaded = _measure(scene)
        _hang(scene, 0.0, "Take the weight off.")
        _, after = _measure(scene)
        for part, value in zip(parts, (q, before, loaded, after), strict=True):
            part.append(value)
    names = ("q", "before", "loaded", "after")
    arrays = {name: np.array(part) for name, part in zip(names, parts, strict=True)}
    return {
        **arrays,
        **_believed(scene),
        "hung": np.array(HUNG),
        "stops": scene.stops,
    }


def _believed(scene: Scene) -> dict[str, Array]:
    """Return what rig.toml says of foot and sensor."""
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


def _bring(scene: Scene, pose: Sequence[float], where: str) -> None:
    angles = "  ".join(f"J{i} {angle:.1f}" for i, angle in enumerate(pose, 1))
    scene.ask(
        f"Bring the arm to {where}, about [rad]: {angles}. Hold it by the forearm, "
        "nothing touches the foot. [space] when it is still."
    )
    if scene.simulation is not None:
        scene.simulation.pose(pose, CARRIED)
        scene.await_hand()
        scene.wait(SETTLED)


def _hang(scene: Scene, mass: float, text: str) -> None:
    scene.ask(f"{text} [space] when it is still.")
    if scene.simulation is not None:
        scene.simulation.hang(mass)
        scene.wait(SETTLED)


def _measure(scene: Scene) -> tuple[Array, Array]:
    """Return mean positions [rad] and readings [N, N m] of two seconds, (7,) and (6,).

    Raises:
        PreflightError: too few readings.
    """
    reader = scene.loop_client.wrenches()
    scene.wait(AVERAGE)
    sound = [
        sample.wrench
        for sample in unpack_wrenches(reader.read())
        if sample.is_valid and not sample.saturated
    ]
    if len(sound) < _FEWEST:
        raise PreflightError(
            f"{len(sound)} readings of the F/T sensor in {AVERAGE:g} s (at least "
            f"{_FEWEST}).",
            hint="Check the sensor's cable and load, then begin the step again.",
            arm_state="idle; it sinks slowly, support it",
        )
    q = scene.loop_client.last(AVERAGE)["position"].mean(axis=0)
    return q, np.array(sound).mean(axis=0)


def _orientations(values: Values, model: ArmModel) -> Array:
    """Return the believed orientations of the sensor in the base, (n, 3, 3)."""
    turned = [model.plate_pose(q)[1] @ values["mounting"] for q in values["q"]]
    return np.array(turned)


def judge_own_weight(values: Values) -> Judgement:
    """Judge axes and sign of the sensor, mass and centre of the foot, the base."""
    R = _orientations(values, ArmModel(load_constants()))
    loads = number(values, "sign") * values["readings"]
    count = len(R)
    rows = np.zeros((3 * count, 6))
    rows[:, :3] = np.tile(np.eye(3), (count, 1))
    rows[:, 3:] = R.transpose(0, 2, 1).reshape(-1, 3)
    solved, *_ = np.linalg.lstsq(rows, loads[:, :3].ravel())
    w: Array = solved[3:].astype(np.float64)
    left = loads[:, :3].ravel() - rows @ solved
    arms = np.zeros((3 * count, 6))
    arms[:, :3] = np.tile(np.eye(3), (count, 1))
    arms[:, 3:] = np.concatenate([cross_matrix(each.T @ w).T for each in R])
    centred, *_ = np.linalg.lstsq(arms, loads[:, 3:].ravel())
    twisted = loads[:, 3:].ravel() - arms @ centred
    mass = float(np.linalg.norm(w)) / GRAVITY
    share = 100.0 * (mass / number(values, "mass") - 1.0)
    apart = 1e3 * float(np.linalg.norm(centred[3:] - values["centre"]))
    return judged(
        [
            found("lever", 1e3 * _lever(loads)),
            found("force_left", _rms(left)),
            found("foot_mass", share),
            found("weight_way", _angle(w, np.array([0.0, 0.0, -1.0]))),
            found("foot_centre", apart),
            found("moment_left", 1e3 * _rms(twisted)),
        ]
    )


def judge_hung_weight(values: Values) -> Judgement:
    """Judge orientations and scale of the sensor, the sole, and twelve angles."""
    model = ArmModel(load_constants())
    R = _orientations(values, model)
    both = (values["before"] + values["after"]) / 2
    loads = number(values, "sign") * (values["loaded"] - both)
    forces, down = loads[:, :3], np.array([0.0, 0.0, -1.0])
    ways = [_angle(each @ force, down) for each, force in zip(R, forces, strict=True)]
    scale = np.linalg.norm(forces, axis=1) / (number(values, "hung") * GRAVITY)
    arms = np.concatenate([cross_matrix(force).T for force in forces])
    sole, *_ = np.linalg.lstsq(arms, loads[:, 3:].ravel())
    apart = 1e3 * float(np.linalg.norm(sole - values["sole"]))
    angles = np.degrees(fit_angles(values, forces, model))
    worst = int(np.abs(angles).argmax())
    return judged(
        [
            found("hung_scale", float(np.median(scale))),
            found("hung_spread", float(np.ptp(scale))),
            found("fitted", float(angles[worst]), name=_NAMES[worst]),
            found("sole", apart),
            found("hung_way", max(ways)),
        ]
    )


_NAMES = (
    *(f"the zero of joint {joint}" for joint in range(1, 8)),
    "the base about x",
    "the base about y",
    "the sensor about x",
    "the sensor about y",
    "the sensor about z",
)


def fit_angles(values: Values, forces: Array, model: ArmModel) -> Array:
    """Return what zeros, base and sensor are off by [rad], shape (12,).

    Args:
        values: of C7.
        forces: of the hung weight in the sensor's frame [N], shape (n, 3).
        model: of the arm.
    """
    seen = forces / np.linalg.norm(forces, axis=1)[:, None]
    angles = np.zeros(len(_NAMES))

    def left(x: Array) -> Array:
        told = np.array([_down(values, model, q, x) for q in values["q"]])
        parts = (
            ((told - seen) / _DIRECTION).ravel(),
            (x[:7] - values["stops"]) / _STOP,
            x / _PRIOR,
        )
        return np.concatenate(parts)

    for _ in range(_ROUNDS):
        here = left(angles)
        steps = np.eye(len(angles)) * _STEP
        J = np.array([(left(angles + step) - here) / _STEP for step in steps]).T
        angles = angles - np.linalg.lstsq(J, here)[0]
    return angles


def _down(values: Values, model: ArmModel, q: Array, x: Array) -> Array:
    """Return where down is in the sensor's frame if `x` is off, shape (3,)."""
    # An encoder that tells too much by x has its joint at q - x.
    arm = model.plate_pose(q - x[:7])[1]
    base = _turn(np.array([x[7], x[8], 0.0]))
    sensor = arm @ values["mounting"] @ _turn(x[9:12])
    return (base @ sensor).T @ np.array([0.0, 0.0, -1.0])


def _turn(v: Array) -> Array:
    """Return the rotation by a small vector of angles [rad], shape (3, 3)."""
    angle = float(np.linalg.norm(v))
    if angle == 0.0:
        return np.eye(3)
    X = cross_matrix(v / angle)
    return np.eye(3) + np.sin(angle) * X + (1.0 - np.cos(angle)) * X @ X


def _angle(a: Array, b: Array) -> float:
    """Return the angle between two vectors [degrees]."""
    share = float(a @ b) / float(np.linalg.norm(a) * np.linalg.norm(b) + 1e-12)
    return float(np.degrees(np.arccos(np.clip(share, -1.0, 1.0))))


def _lever(loads: Array) -> float:
    """Return how many times larger than forces moments are, from pose to pose [m]."""
    force, moment = loads[:, :3], loads[:, 3:]
    change = _rms(moment - moment.mean(axis=0)), _rms(force - force.mean(axis=0))
    return change[0] / max(change[1], 1e-9)


def _rms(left: Array) -> float:
    """Return the rms of what is left, axis by axis."""
    return float(np.sqrt((left**2).mean()))
