"""C0: plausibility of rig.toml."""

import numpy as np

from experiments.commissioning.evidence.order import StepId
from experiments.commissioning.judging import Judgement, judge_quantity, judged
from experiments.commissioning.recording import Values, number, texts, words
from experiments.commissioning.scene import Scene
from experiments.commissioning.step import Step


def collect(scene: Scene) -> Values:
    """Collect unusual settings, load, and difference of the gravity models."""
    rig = scene.rig
    tool = rig.model.tool
    assert tool is not None
    gravity_errors = [
        np.abs(rig.law_model.gravity(q) - rig.model.gravity(q)).max()
        for q in rig.model.constants.calibration_poses
    ]
    return {
        "unusual": texts(rig.settings.unusual()),
        "load": np.array(tool.foot.mass + tool.sensor.mass),
        "gravity_apart": np.array(gravity_errors),
    }


def judge(values: Values) -> Judgement:
    """Judge a recording of `collect`."""
    unusual = words(values, "unusual")
    return judged(
        [
            judge_quantity("unusual", len(unusual), text="; ".join(unusual)),
            judge_quantity("load", number(values, "load")),
            judge_quantity("drawings", float(values["gravity_apart"].max())),
        ]
    )


CONFIGURATION = Step(
    StepId.CONFIGURATION,
    collect,
    judge,
    minutes=1,
    remedy="Correct the file, or measure again what it says.",
)
