"""The live screen of a running trial, fed from the board."""

from collections.abc import Callable

import numpy as np

from acquisition.sample import MOTOR_FRESH_SHIFT, Flag
from experiments.operator.screens import RecordingView, recording_lines
from experiments.rig.rig import Rig
from experiments.trial.files import Outcome

HISTORY = 5.0  # s of traction in the sparklines
_ALL_MOTORS = 0x7F << MOTOR_FRESH_SHIFT


def recording_screen(
    rig: Rig, trial: str, outcome: Outcome
) -> Callable[[int], list[str]]:
    """Return what draws trial `trial`, whose `outcome` is kept up to date."""
    desk = rig.crew.desk
    missed_before = desk.loop.skipped + desk.loop.late

    def lines(width: int) -> list[str]:
        records = desk.last(HISTORY)
        last_second = records[-500:]
        span = (int(last_second["host_ns"][-1]) - int(last_second["host_ns"][0])) * 1e-9
        flags = int(records["flags"][-1])
        is_sensor_fine = bool(flags & Flag.FT_FRESH) and not flags & Flag.FT_SATURATED
        view = RecordingView(
            trial=trial,
            seconds=outcome.seconds,
            displacement=outcome.displacement,
            travel=rig.frame.travel,
            rate=(len(last_second) - 1) / span if span > 0 else 0.0,
            missed=desk.loop.skipped + desk.loop.late - missed_before,
            is_arm_fine=flags & _ALL_MOTORS == _ALL_MOTORS,
            is_sensor_fine=is_sensor_fine,
            traction=np.array(records["traction"]),
        )
        return recording_lines(view, width)

    return lines
