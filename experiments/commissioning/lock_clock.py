"""C12: does the lock hold joint 7, and do force and motion belong to one time?

The clock first, the arm idle: the foot is rocked about joint 6 in the air, so that its
weight turns in the sensor's frame. With s(t) = R(q(t))^T w, as positions tell it, a
sensor that lags by T shows f(t) = b + a s(t) - a T s'(t) + c s''(t); the last term is
the foot's inertia. Then the arm holds itself, joint 7 locked, and the foot is turned
about its axis: moment over angle is the lock's stiffness.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from acquisition.ipc.shared_sensor import unpack_wrenches
from experiments.commissioning.by_hand import CARRIED
from experiments.commissioning.evidence.order import StepId
from experiments.commissioning.fits import orientations
from experiments.commissioning.judging import Judgement, found, judged
from experiments.commissioning.recording import Values, number, texts, words
from experiments.commissioning.scene import Scene
from experiments.commissioning.step import Step
from experiments.commissioning.weights import POSES, bring
from experiments.operator.prompts import Prompt
from experiments.rig.build import start_of
from experiments.run.ready import activate
from wam.model.arm_model import ArmModel
from wam.model.constants import GRAVITY, Array, load_constants

ROCKED = 10.0  # s
_POSE = 1  # of `POSES`: the foot ahead
# At 1 Hz the hysteresis of a sound sensor looks like a lag of up to 4 ms.
_WAY, _HALF = 0.3, 1.0 / 3.0  # rad to both sides, s from side to side
TURNED = 0.6  # N m, 6 N at 100 mm: friction bears a third of it
_TURN_SECONDS = 60.0  # that simulated hands turn
_SETTLED, _MEANT = 0.8, 0.3  # s
_SWINGS = 2.0  # s, in which a person lets go and the foot comes to rest
_RESTS = 100  # cycles at the end of that
_SMOOTH = 0.05  # s, over which both signals are averaged before they are compared
_ENDS = 0.5  # s, that are left out at both
_FOOT = np.array([0.0, 0.0, -GRAVITY])  # of a kilogram, base frame [N]


def collect(scene: Scene) -> Values:
    """Have the foot rocked in the air, then turned about its axis, joint 7 locked.

    Raises:
        PreflightError: not activated.
        ArmFaultError, StopRequestedError: as `ConsoleLoop.tick`.
    """
    rocked = _rock(scene)
    scene.say("Bring the foot above the container, a hand's breadth clear of it.")
    if scene.simulation is not None:
        start = start_of(scene.rig.row, scene.rig.model)
        scene.simulation.pose(start.tolist(), CARRIED)
        scene.await_hand()
    turned: dict[str, NDArray[Any]] = {}
    with scene.followed():
        activate(scene.console_loop)
        ended = scene.until_fault(lambda: turned.update(_turn(scene)), 0.0)
        if not ended:
            scene.console_loop.lay_down()
        scene.console_loop.make_safe()
    payload = scene.rig.payload
    believed = {"sign": np.array(payload.sign), "mounting": payload.rotation}
    return {**rocked, **turned, **believed, "ended": texts(ended)}


def _rock(scene: Scene) -> Values:
    bring(scene, POSES[_POSE], "the pose where the foot points ahead")
    scene.ask(
        f"Rock the foot about joint 6, {_WAY:g} rad to both sides, three times in "
        "two seconds, with a hand on the wrist and none on the foot. [space], then "
        f"{ROCKED:g} s."
    )
    cycles = scene.rig.shared.cycles.reader()
    wrenches = scene.loop_client.wrenches()
    side = 1.0
    for _ in range(round(ROCKED / _HALF)):
        if scene.simulation is not None:
            pose = list(POSES[_POSE])
            pose[5] += side * _WAY
            side = -side
            scene.simulation.pose(pose, _HALF)
        scene.wait(_HALF)
    record, samples = cycles.read(), unpack_wrenches(wrenches.read())
    return {
        "t_ns": record["arm_ns"].astype(np.int64),
        "q": record["position"].copy(),
        "wrench_ns": np.array([each.t_ns for each in samples], dtype=np.int64),
        "wrench": np.array([each.wrench for each in samples]).reshape(-1, 6),
    }


def _turn(scene: Scene) -> dict[str, NDArray[Any]]:
    """Return joint 7 and the moment about it, let go, turned and let go, (3,) each.

    Also joint 7 from the moment on at which the foot is let go: it swings back.
    """
    parts = [_held(scene, "Hands off the foot, the arm holds itself. [space]", 0.0)]
    text = (
        f"Turn the foot about its own axis with about {TURNED:g} N m (6 N at 100 mm) "
        "and keep it there. [space] while it is turned."
    )
    parts.append(_held(scene, text, TURNED))
    _ask(scene, "[space], then let the foot go at once.")
    reader = scene.rig.shared.cycles.reader()
    if scene.simulation is not None:
        scene.simulation.twist(0.0, 0.0)
    scene.wait(_SWINGS)
    record = reader.read()
    parts.append(_held(scene, "", 0.0))
    return {
        "turned": np.array([angle for angle, _ in parts]),
        "moments": np.array([moment for _, moment in parts]),
        "swing_q7": record["position"][:, 6].copy(),
    }


def _held(scene: Scene, text: str, torque: float) -> tuple[float, Array]:
    """Return joint 7 [rad] and the mean moment of the sensor [N m], shape (3,)."""
    if text:
        _ask(scene, text)
    if scene.simulation is not None and torque:
        scene.simulation.twist(torque, _TURN_SECONDS)
    scene.wait(_SETTLED)
    wrenches = scene.loop_client.wrenches()
    scene.wait(_MEANT)
    angle = float(scene.loop_client.last(_MEANT)["position"][:, 6].mean())
    shown = [each.wrench for each in unpack_wrenches(wrenches.read())]
    return angle, np.array(shown).reshape(-1, 6)[:, 3:].mean(axis=0)


def _ask(scene: Scene, text: str) -> None:
    """Say `text` and wait for [space]; simulated hands stay on the forearm."""
    scene.say(text)
    while scene.console_loop.tick(Prompt.PAUSED) != " ":
        pass


def judge(values: Values) -> Judgement:
    """Judge how late forces are, how stiff the lock is, and how it rings."""
    lag, swing = force_lag(values)
    ended = words(values, "ended")
    rows = [
        found("rocked", swing),
        found("lag", 1e3 * lag),
        found("ended", len(ended), text=" ".join(ended)),
    ]
    if not ended:
        stiffness, turned = lock_stiffness(values)
        rows += [
            found("turned", turned),
            found("stiffness", stiffness),
            found("ringing", ringing(values)),
        ]
    return judged(rows)


def force_lag(values: Values) -> tuple[float, float]:
    """Return by how much forces are behind positions [s], and the weight's swing [N].

    The swing is that of the foot's weight in the sensor's frame, rms, as seen.
    """
    t = values["wrench_ns"] * 1e-9
    at = values["t_ns"] * 1e-9
    if len(t) < 100 or len(at) < 100:
        return 0.0, 0.0
    R = orientations(values, ArmModel(load_constants()))
    believed = R.transpose(0, 2, 1) @ _FOOT
    grid = np.arange(max(t[0], at[0]), min(t[-1], at[-1]), 0.002)
    loads = number(values, "sign") * values["wrench"][:, :3]
    s, f = (_smooth(_on(grid, *pair)) for pair in ((at, believed), (t, loads)))
    rate = np.gradient(s, 0.002, axis=0)
    curve = np.gradient(rate, 0.002, axis=0)
    keep = slice(round(_ENDS / 0.002), -round(_ENDS / 0.002))
    parts = [_steadied(each[keep]) for each in (s, rate, curve)]
    rows = np.stack([part.ravel() for part in parts], axis=1)
    seen = _steadied(f[keep])
    (a, slope, _), *_ = np.linalg.lstsq(rows, seen.ravel())
    return -float(slope / a), float(np.sqrt((seen**2).sum(axis=1).mean()))


def _steadied(values: Array) -> Array:
    """Return signals without mean and drift, shape (n, 3)."""
    t = np.linspace(-1.0, 1.0, len(values))
    line = np.stack([np.ones_like(t), t], axis=1)
    return values - line @ np.linalg.lstsq(line, values)[0]


def _on(grid: Array, t: Array, values: NDArray[Any]) -> Array:
    rows = np.zeros((len(grid), values.shape[1]))
    for i in range(values.shape[1]):
        rows[:, i] = np.interp(grid, t, values[:, i])
    return rows


def _smooth(values: Array) -> Array:
    width = round(_SMOOTH / 0.002) | 1
    window = np.hanning(width + 2)[1:-1]
    window /= window.sum()
    smooth = np.zeros_like(values)
    for i in range(values.shape[1]):
        smooth[:, i] = np.convolve(values[:, i], window, "same")
    return smooth


def lock_stiffness(values: Values) -> tuple[float, float]:
    """Return the lock's stiffness [N m/rad] and the moment that turned it [N m]."""
    moments = number(values, "sign") * values["moments"] @ values["mounting"].T
    about = moments[:, 2]
    angles = values["turned"]
    moment = float(about[1] - (about[0] + about[2]) / 2.0)
    angle = float(angles[1] - (angles[0] + angles[2]) / 2.0)
    return (moment / angle if angle else np.inf), abs(moment)


def ringing(values: Values) -> float:
    """Return how far joint 7 swings beyond its rest, over the way it was turned."""
    low, turned, _ = values["turned"].tolist()
    q = values["swing_q7"]
    rest = float(q[-_RESTS:].mean())
    beyond = np.sign(low - turned) * (q - rest)
    return float(max(beyond.max(), 0.0) / max(abs(turned - rest), 1e-9))


LOCK_AND_CLOCK = Step(
    StepId.LOCK_AND_CLOCK,
    collect,
    judge,
    minutes=4,
    remedy="Look at the sensor's buffer and filter, at motor 7, and at lock_kp, "
    "lock_kd.",
    needs_loop=True,
    needs_zero=True,
    needs_torque=True,
)
