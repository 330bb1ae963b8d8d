"""The pendant activates the arm: torques are ready before, a person says when."""

from acquisition.cycle import ArmState
from acquisition.devices import SafetyMode
from acquisition.errors import PreflightError
from experiments.messages import CATALOGUE
from experiments.operator import Prompt
from experiments.stage import Stage

PATIENCE = 120.0  # how long a person may take to activate the arm [s]


def activate(stage: Stage) -> None:
    """Get torques ready, then wait for the pendant and for [space].

    Raises:
        PreflightError: the arm was not activated within two minutes.
        StopAskedError, FaultedError: as `Stage.tick`.
    """
    control, clock = stage.control, stage.rig.clock
    control.request(ArmState.HOLD)
    control.advance(0.1)
    stage.company.console.say(
        "Press Shift-activate on the pendant, support the arm, then [space]."
    )
    is_ready = False
    start_ns = clock.now_ns()
    while True:
        is_ready = stage.tick(Prompt.SUPPORT) == " " or is_ready
        if is_ready and control.status.safety is SafetyMode.ACTIVE:
            return
        if (clock.now_ns() - start_ns) * 1e-9 > PATIENCE:
            message = CATALOGUE["not-active"]
            raise PreflightError(
                message.what.format(seconds=PATIENCE),
                hint=message.do,
                arm_state=message.arm,
            )
