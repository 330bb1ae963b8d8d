"""C12: stiffness of the lock of joint 7, and lag of force against motion.

First the lag, with the arm idle: the foot is rocked about joint 6 in the air, so that
its weight rotates in the sensor frame. With s(t) = R(q(t))^T w from the positions, a
sensor that lags by T reads f(t) = b + a s(t) - a T s'(t) + c s''(t); the last term is
the foot's inertia. Then the arm holds with joint 7 locked, and the foot is turned about
its axis in two steps of the same direction: the further moment over the further angle
is the lock's stiffness, because friction carries the same share of both.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from acquisition.ipc.shared_sensor import unpack_wrenches
from experiments.commissioning.evidence.order import StepId
from experiments.commissioning.fits import orientations
from experiments.commissioning.judging import Judgement, judge_quantity, judged
from experiments.commissioning.manual_joints import CARRY_SECONDS
from experiments.commissioning.recording import Values, number, texts, words
from experiments.commissioning.scene import Scene
from experiments.commissioning.step import Step
from experiments.commissioning.weights import POSES, bring
from experiments.operator.prompts import Prompt
from experiments.rig.build import start_of
from experiments.run.ready import activate
from wam.model.arm_model import ArmModel
from wam.model.constants import GRAVITY, Array, load_constants

ROCKING_SECONDS = 10.0  # s, duration of rocking
_POSE = 1  # index of `POSES`: the foot ahead
# At 1 Hz the hysteresis of a sound sensor looks like a lag of up to 4 ms.
_AMPLITUDE, _HALF = 0.3, 1.0 / 3.0  # rad, and s of half a period
TURNED = (0.3, 0.6)  # N m, 3 and 6 N at 100 mm; friction may carry 0.2
_TURN_SECONDS = 60.0  # duration of a turn by simulated hands
_SETTLED, _AVERAGE = 0.8, 0.3  # s, settling and averaging time
_SWINGS = 2.0  # s, time to let go and for the foot to come to rest
_RESTS = 100  # cycles at the end of that, at rest
_SMOOTH = 0.05  # s, smoothing of both signals before comparison
_ENDS = 0.5  # s, cut off at both ends
_FOOT = np.array([0.0, 0.0, -GRAVITY])  # weight of 1 kg, base frame [N]


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
        scene.simulation.pose(start.tolist(), CARRY_SECONDS)
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
        f"Rock the foot about joint 6, {_AMPLITUDE:g} rad to both sides, three times "
        "in two seconds, with a hand on the wrist and none on the foot. [space], then "
        f"{ROCKING_SECONDS:g} s."
    )
    cycles = scene.rig.shared.cycles.reader()
    wrenches = scene.loop_client.wrenches()
    side = 1.0
    for _ in range(round(ROCKING_SECONDS / _HALF)):
        if scene.simulation is not None:
            pose = list(POSES[_POSE])
            pose[5] += side * _AMPLITUDE
            side = -side
            scene.simulation.pose(pose, _HALF)
        scene.wait(_HALF)
    record, samples = cycles.read(), unpack_wrenches(wrenches.read())
    return {
        "t_ns": record["arm_ns"].astype(np.int64),
        "q": record["position"].copy(),
        "wrench_ns": np.array([sample.t_ns for sample in samples], dtype=np.int64),
        "wrench": np.array([sample.wrench for sample in samples]).reshape(-1, 6),
    }


def _turn(scene: Scene) -> dict[str, NDArray[Any]]:
    """Angles of joint 7 (3,) and moments (3, 3): turned, turned further, released.

    Also the angle of joint 7 after the release, while it swings back.
    """
    _ask(scene, "Hands off the foot, the arm holds itself. [space]")
    scene.wait(_SETTLED)
    asked = ("Turn the foot about its own axis with", "Turn it further, to")
    parts = [
        _measure(
            scene,
            f"{words} about {torque:g} N m ({10.0 * torque:g} N at 100 mm) and keep it "
            "there. [space] while it is turned.",
            torque,
        )
        for words, torque in zip(asked, TURNED, strict=True)
    ]
    _ask(scene, "[space], then let the foot go at once.")
    reader = scene.rig.shared.cycles.reader()
    if scene.simulation is not None:
        scene.simulation.twist(0.0, 0.0)
    scene.wait(_SWINGS)
    record = reader.read()
    parts.append(_measure(scene, "", 0.0))
    return {
        "turned": np.array([angle for angle, _ in parts]),
        "moments": np.array([moment for _, moment in parts]),
        "swing_q7": record["position"][:, 6].copy(),
    }


def _measure(scene: Scene, text: str, torque: float) -> tuple[float, Array]:
    """Mean angle of joint 7 [rad] and mean moment of the sensor [N m], shape (3,)."""
    if text:
        _ask(scene, text)
    if scene.simulation is not None and torque:
        scene.simulation.twist(torque, _TURN_SECONDS)
    scene.wait(_SETTLED)
    wrenches = scene.loop_client.wrenches()
    scene.wait(_AVERAGE)
    angle = float(scene.loop_client.last(_AVERAGE)["position"][:, 6].mean())
    samples = [sample.wrench for sample in unpack_wrenches(wrenches.read())]
    return angle, np.array(samples).reshape(-1, 6)[:, 3:].mean(axis=0)


def _ask(scene: Scene, text: str) -> None:
    """Print `text` and wait for [space]; simulated hands stay on the forearm."""
    scene.say(text)
    while scene.console_loop.tick(Prompt.PAUSED) != " ":
        pass


def judge(values: Values) -> Judgement:
    """Judge lag of the forces, stiffness and ringing of the lock."""
    lag, swing = force_lag(values)
    ended = words(values, "ended")
    rows = [
        judge_quantity("rocked", swing),
        judge_quantity("lag", 1e3 * lag),
        judge_quantity("ended", len(ended), text=" ".join(ended)),
    ]
    if not ended:
        stiffness, turned = lock_stiffness(values)
        rows += [
            judge_quantity("turned", turned),
            judge_quantity("stiffness", stiffness),
            judge_quantity("ringing", ringing(values)),
        ]
    return judged(rows)


def force_lag(values: Values) -> tuple[float, float]:
    """Lag of forces behind positions [s], and swing of the weight [N].

    The swing is the rms of the measured weight in the sensor frame.
    """
    t = values["wrench_ns"] * 1e-9
    t_arm = values["t_ns"] * 1e-9
    if len(t) < 100 or len(t_arm) < 100:
        return 0.0, 0.0
    R = orientations(values, ArmModel(load_constants()))
    expected = R.transpose(0, 2, 1) @ _FOOT
    grid = np.arange(max(t[0], t_arm[0]), min(t[-1], t_arm[-1]), 0.002)
    loads = number(values, "sign") * values["wrench"][:, :3]
    s, f = (
        _smooth(_interpolated(grid, *pair)) for pair in ((t_arm, expected), (t, loads))
    )
    rate = np.gradient(s, 0.002, axis=0)
    curve = np.gradient(rate, 0.002, axis=0)
    keep = slice(round(_ENDS / 0.002), -round(_ENDS / 0.002))
    parts = [_detrended(signal[keep]) for signal in (s, rate, curve)]
    rows = np.stack([part.ravel() for part in parts], axis=1)
    measured = _detrended(f[keep])
    (a, slope, _), *_ = np.linalg.lstsq(rows, measured.ravel())
    return -float(slope / a), float(np.sqrt((measured**2).sum(axis=1).mean()))


def _detrended(values: Array) -> Array:
    """Remove mean and linear drift from signals of shape (n, 3)."""
    t = np.linspace(-1.0, 1.0, len(values))
    line = np.stack([np.ones_like(t), t], axis=1)
    return values - line @ np.linalg.lstsq(line, values)[0]


def _interpolated(grid: Array, t: Array, values: NDArray[Any]) -> Array:
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
    """Stiffness of the lock [N m/rad] and the further moment [N m]."""
    moments = number(values, "sign") * values["moments"] @ values["mounting"].T
    moment = float(moments[1, 2] - moments[0, 2])
    angle = float(values["turned"][1] - values["turned"][0])
    return (moment / angle if angle else np.inf), abs(moment)


def ringing(values: Values) -> float:
    """Overshoot of joint 7 beyond its rest, relative to the angle it was turned."""
    turned = float(values["turned"][1])
    q = values["swing_q7"]
    rest = float(q[-_RESTS:].mean())
    beyond = np.sign(rest - turned) * (q - rest)
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
