"""C14: the mounted sensor against a kitchen scale and a spring balance, arm idle.

A person reads both and types the values. In the base frame the foot's weight is the
same before and during pressing, so differences are due to the scale alone.
"""

import numpy as np

from experiments.commissioning.evidence.order import StepId
from experiments.commissioning.fits import orientations
from experiments.commissioning.judging import (
    JudgedQuantity,
    Judgement,
    judge_quantity,
    judged,
)
from experiments.commissioning.recording import Values, number
from experiments.commissioning.scene import Scene
from experiments.commissioning.step import Step
from experiments.commissioning.weights import POSES, bring, measure
from wam.model.arm_model import ArmModel
from wam.model.constants import GRAVITY, Array, load_constants

PRESSED = 4.0  # kg, approximate; a simulated scale shows exactly this
PULLED = 10.0  # N
_SHARE, _LEAST = 0.03, 0.4  # tolerance: share of the reading, plus N
_PRESS_SECONDS = 5.0  # s, duration of a press by simulated hands
_SETTLED = 1.0  # s


def collect(scene: Scene) -> Values:
    """Have the foot pressed onto a scale and pulled; returns readings and typed values.

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
    parts.append(
        _measure_free(scene, "Lift the foot off the scale, nothing touches it.")
    )
    scene.ask(
        f"Pull level at the middle of the sole with the spring balance, about "
        f"{PULLED:g} N. Read it. [space] while it pulls."
    )
    _simulate(scene, (0.0, PULLED, 0.0))
    parts.append(measure(scene))
    pulled = scene.ask_number("What did the balance show [N]?", PULLED)
    parts.append(
        _measure_free(scene, "Take the balance off, nothing touches the foot.")
    )
    payload = scene.rig.payload
    return {
        "q": np.array([q for q, _ in parts]),
        "readings": np.array([reading for _, reading in parts]),
        "sign": np.array(payload.sign),
        "mounting": payload.rotation,
        "pressed": np.array(pressed * GRAVITY),
        "pulled": np.array(pulled),
    }


def _measure_free(scene: Scene, text: str) -> tuple[Array, Array]:
    scene.ask(f"{text} [space] when it is still.")
    if scene.simulation is not None:
        scene.wait(_PRESS_SECONDS)  # until the simulated hands let go
    return measure(scene)


def _simulate(scene: Scene, force: tuple[float, float, float]) -> None:
    if scene.simulation is not None:
        scene.simulation.push_with(force, _PRESS_SECONDS)
        scene.wait(_SETTLED)


def judge(values: Values) -> Judgement:
    """Judge two forces of the sensor against scale and balance."""
    R = orientations(values, ArmModel(load_constants()))
    loads = number(values, "sign") * values["readings"][:, :3]
    forces = np.array([turn @ load for turn, load in zip(R, loads, strict=True)])
    before, pressing, between, pulling, after = forces
    up = float((pressing - (before + between) / 2)[2])
    level = float(np.linalg.norm((pulling - (between + after) / 2)[:2]))
    pressed, pulled = number(values, "pressed"), number(values, "pulled")
    return judged(
        [
            judge_quantity("pressed", pressed),
            _difference_row("scale", up - pressed, pressed),
            judge_quantity("pulled", pulled),
            _difference_row("balance", level - pulled, pulled),
        ]
    )


def _difference_row(key: str, difference: float, shown: float) -> JudgedQuantity:
    tolerance = _SHARE * abs(shown) + _LEAST
    return judge_quantity(key, difference, low=-tolerance, high=tolerance)


PLATE = Step(
    StepId.PLATE,
    collect,
    judge,
    minutes=5,
    remedy="Read the scale again; compare the sensor's calibration sheet.",
    needs_loop=True,
    needs_zero=True,
)
