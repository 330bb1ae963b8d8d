"""C5: every joint turned manually from stop to stop, the arm idle."""

import numpy as np

from experiments.commissioning.evidence.order import StepId
from experiments.commissioning.judging import (
    JudgedQuantity,
    Judgement,
    judge_quantity,
    judged,
)
from experiments.commissioning.recording import Values
from experiments.commissioning.scene import Scene
from experiments.commissioning.step import Step
from wam.model.constants import Array

# Initial pose [rad], in which every joint can be turned freely.
POSE = (0.0, -0.6, 0.0, 2.0, 0.0, 0.0, 0.0)
CARRY_SECONDS = 4.0  # s, travel time of a simulated hand from pose to pose
_LOW_WORDS = {  # direction to the stop of the smaller angle
    1: "clockwise, seen from above",
    2: "backwards, over the base",
    3: "clockwise about the upper arm, seen from the elbow",
    4: "until forearm and upper arm are stretched, and on",
    5: "clockwise about the forearm, seen from the foot",
    6: "backwards, as joint 2 bends the arm",
    7: "clockwise about the foot's axis, seen from the foot",
}
_HIGH_WORDS = {4: "until the forearm is folded onto the upper arm"}
_REVERSED = "the other way, onto the stop there"
_AVERAGE = 0.3  # s, averaging time of positions


def collect(scene: Scene) -> Values:
    """Have each joint turned onto both stops; returns all measured positions.

    Raises:
        ArmFaultError, StopRequestedError: as `ConsoleLoop.tick`.
    """
    scene.ask(
        "One person supports the arm throughout: it is idle. Bring it up, the elbow "
        "bent, so that every joint can be turned freely. [space]"
    )
    lows: list[Array] = []
    highs: list[Array] = []
    for joint in range(1, 8):
        scene.show_share((joint - 1) / 7, f"joint {joint}")
        if scene.simulation is not None:
            scene.simulation.pose(POSE, CARRY_SECONDS)
            scene.await_hand()
        scene.ask(
            f"Joint {joint} {_LOW_WORDS[joint]}, onto its stop, the others as they "
            "are. [space] while it is there."
        )
        if scene.simulation is not None:
            scene.simulation.turn_to_stop(joint, "low")
            scene.await_hand()
        lows.append(_mean(scene))
        words = _HIGH_WORDS.get(joint, _REVERSED)
        scene.ask(f"Joint {joint} {words}. [space] while it is there.")
        if scene.simulation is not None:
            scene.simulation.turn_to_stop(joint, "high")
            scene.await_hand()
        highs.append(_mean(scene))
    constants = scene.rig.model.constants
    return {
        "low": np.array(lows),
        "high": np.array(highs),
        # Joints 2 and 4 lie on a stop at home, beyond the limits of the drawings.
        "q_lower": np.minimum(constants.q_lower, constants.home),
        "q_upper": np.maximum(constants.q_upper, constants.home),
    }


def _mean(scene: Scene) -> Array:
    scene.wait(_AVERAGE)
    return scene.loop_client.last(_AVERAGE)["position"].mean(axis=0)


def judge(values: Values) -> Judgement:
    """Judge order, direction, scale and zero of every encoder."""
    lower, upper = values["q_lower"], values["q_upper"]
    low, high = values["low"], values["high"]
    rows: list[JudgedQuantity] = []
    for i in range(7):
        travel = high[i, i] - low[i, i]
        others = np.abs(high[i] - low[i])
        others[i] = 0.0
        largest = int(others.argmax())
        off = max(low[i, i] - lower[i], high[i, i] - upper[i], key=abs)
        share = travel / (upper[i] - lower[i]) - 1.0
        rows += [
            judge_quantity("sense", float(np.sign(travel)), joint=i + 1),
            judge_quantity(
                "beside", np.degrees(others[largest]), joint=i + 1, other=largest + 1
            ),
            judge_quantity("travel", 100.0 * share, joint=i + 1),
            judge_quantity("stop_angle", np.degrees(off), joint=i + 1),
        ]
    return judged(rows)


def stop_errors(values: Values) -> Array:
    """Zero errors of the joints from their stops [rad], shape (7,)."""
    low, high = np.diag(values["low"]), np.diag(values["high"])
    return ((low - values["q_lower"]) + (high - values["q_upper"])) / 2


BY_HAND = Step(
    StepId.BY_HAND,
    collect,
    judge,
    minutes=10,
    remedy="Zero the arm again at home; look at the encoder that is named.",
    needs_loop=True,
    needs_zero=True,
)
