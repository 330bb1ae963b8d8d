"""What the screen shows of foresight, from the newest records of it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from acquisition.sample import Record
from analysis.foresight.engine import ForesightFlag
from experiments.operator.screens import OTHER_RIG_TEXT, ForesightView

_LATE_CYCLES = 100  # 0.2 s


def foresight_view(
    records: Record, terrains: Sequence[str], newest_cycle: int
) -> ForesightView:
    """Return what is foreseen, for the screen.

    Args:
        records: of traction_msgs/Foresight, of the last seconds, oldest first.
        terrains: names of the known terrains.
        newest_cycle: of the loop; a state that is 0.2 s older is late.
    """
    if not len(records):
        return ForesightView(np.zeros(0), np.nan, np.nan, {}, np.nan, is_late=True)
    newest = records[-1]
    flags = int(newest["flags"])
    shares = newest["terrains"][: len(terrains)].tolist()
    states = (
        (ForesightFlag.OTHER_RIG, True, OTHER_RIG_TEXT),
        (ForesightFlag.SLIPPING, True, "slipping"),
        (ForesightFlag.CONTACT, False, "no contact"),
    )
    words = (text for flag, is_set, text in states if bool(flags & flag) is is_set)
    is_ground = bool(flags & ForesightFlag.GROUND)
    return ForesightView(
        slip_probability=np.array(records["slip_probability"]),
        break_away_risk=float(newest["break_away_risk"]),
        traction=float(newest["traction"]),
        terrains=dict(zip(terrains, shares, strict=True)) if is_ground else {},
        none=float(newest["none"]),
        state=next(words, ""),
        is_late=newest_cycle - int(newest["cycle"]) > _LATE_CYCLES,
    )
