"""C0: are the numbers of rig.toml those of an arm that can be driven?"""

import numpy as np

from experiments.proving.limits import Judgement, found, judged
from experiments.proving.recording import Values, number, texts, words
from experiments.rig.rig import Rig


def collect(rig: Rig) -> Values:
    """Return what the settings say."""
    tool = rig.model.tool
    assert tool is not None
    apart = [
        np.abs(rig.law_model.gravity(q) - rig.model.gravity(q)).max()
        for q in rig.model.constants.calibration_poses
    ]
    return {
        "unusual": texts(rig.settings.unusual()),
        "load": np.array(tool.foot.mass + tool.sensor.mass),
        "gravity_apart": np.array(apart),
    }


def judge(values: Values) -> Judgement:
    """Judge what `collect` returned."""
    unusual = words(values, "unusual")
    return judged(
        [
            found("unusual", len(unusual), text="; ".join(unusual)),
            found("load", number(values, "load")),
            found("drawings", float(values["gravity_apart"].max())),
        ]
    )
