"""C14: the sensor in its place against a kitchen scale and a spring balance, arm idle.

Both are read by a person, who types what they show. In the base frame the foot's weight
is the same before and while it presses, so differences are of the scale alone.
"""

import numpy as np

from experiments.commissioning.evidence.order import StepId
from experiments.commissioning.fits import orientations
from experiments.commissioning.judging import Found, Judgement, found, judged
from experiments.commissioning.recording import Values, number
from experiments.commissioning.scene import Scene
from experiments.commissioning.step import Step
from experiments.commissioning.weights import POSES, bring, measure
from wam.model.arm_model import ArmModel
from wam.model.constants import GRAVITY, Array, load_constants

PRESSED = 4.0  # kg, about; a simulated scale shows exactly this
PULLED = 10.0  # N
_SHARE, _LEAST = 0.03, 0.4  # of what is shown, and N, that they may differ by
_LONG = 5.0  # s, that simulated hands press
_SETTLED = 1.0  # s


def collect(scene: Scene) -> Values:
    """Have the foot pressed onto a scale and pulled; return readings and what is typed.

    Raises:
        PreflightError: too few readings.
        ArmFaultError, StopRequestedError: as `ConsoleLoop.tick`.
    """
    bring(scene, POSES[0], "above the kitchen scale, the sole level")
    parts: list[tuple[Array, Array]] = [measure(scene)]
    scene.ask(
        f"Let the foot press onto the scale, about {PRESSED:g} kg, and hold it still. "
        "Read the scale. [space] while it presses."
    )
    _simulate(scene, (0.0, 0.0, PRESSED * GRAVITY))
    parts.append(measure(scene))
    pressed = scene.ask_number("What did the scale show [kg]?", PRESSED)
    parts.append(_free(scene, "Lift the foot off the scale, nothing touches it."))
    scene.ask(
        f"Pull level at the middle of the sole with the spring balance, about "
        f"{PULLED:g} N. Read it. [space] while it pulls."
    )
    _simulate(scene, (0.0, PULLED, 0.0))
    parts.append(measure(scene))
    pulled = scene.ask_number("What did the balance show [N]?", PULLED)
    parts.append(_free(scene, "Take the balance off, nothing touches the foot."))
    payload = scene.rig.payload
    return {
        "q": np.array([q for q, _ in parts]),
        "readings": np.array([reading for _, reading in parts]),
        "sign": np.array(payload.sign),
        "mounting": payload.rotation,
        "pressed": np.array(pressed * GRAVITY),
        "pulled": np.array(pulled),
    }


def _free(scene: Scene, text: str) -> tuple[Array, Array]:
    scene.ask(f"{text} [space] when it is still.")
    if scene.simulation is not None:
        scene.wait(_LONG)  # until the simulated hands have let go
    return measure(scene)


def _simulate(scene: Scene, force: tuple[float, float, float]) -> None:
    if scene.simulation is not None:
        scene.simulation.push_with(force, _LONG)
        scene.wait(_SETTLED)


def judge(values: Values) -> Judgement:
    """Judge what the sensor shows of two forces that others measured."""
    R = orientations(values, ArmModel(load_constants()))
    loads = number(values, "sign") * values["readings"][:, :3]
    forces = np.array([turn @ load for turn, load in zip(R, loads, strict=True)])
    before, pressing, between, pulling, after = forces
    up = float((pressing - (before + between) / 2)[2])
    level = float(np.linalg.norm((pulling - (between + after) / 2)[:2]))
    pressed, pulled = number(values, "pressed"), number(values, "pulled")
    return judged(
        [
            found("pressed", pressed),
            _beside("scale", up - pressed, pressed),
            found("pulled", pulled),
            _beside("balance", level - pulled, pulled),
        ]
    )


def _beside(key: str, apart: float, shown: float) -> Found:
    most = _SHARE * abs(shown) + _LEAST
    return found(key, apart, low=-most, high=most)


PLATE = Step(
    StepId.PLATE,
    collect,
    judge,
    minutes=5,
    remedy="Read the scale again; compare the sensor's calibration sheet.",
    needs_loop=True,
    needs_zero=True,
)
