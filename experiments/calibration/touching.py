"""Touching points with the sole of a floating arm led by hand."""

from collections.abc import Callable, Generator
from contextlib import contextmanager
from typing import TypeVar

import numpy as np

from acquisition.control_loop.states import ArmState
from acquisition.errors import PreflightError
from acquisition.ipc.loop_client import LoopClient
from acquisition.sample import Record
from experiments.operator.prompts import Prompt
from experiments.run.console_loop import ConsoleLoop
from experiments.run.ready import activate
from experiments.session.sidecar import TrialName

AVERAGE = 0.3  # s, averaging time of positions
STILL = 0.003  # m, largest motion of the sole meanwhile

_T = TypeVar("_T")


@contextmanager
def floating_arm(console_loop: ConsoleLoop) -> Generator[None]:
    """Context of an activated, floating arm, which is laid down at the end.

    Raises:
        PreflightError: the arm was not activated.
        StopRequestedError, ArmFaultError: as `ConsoleLoop.tick`.
    """
    activate(console_loop)
    console_loop.loop_client.request(ArmState.FLOAT)
    yield
    console_loop.loop_client.request(ArmState.HOLD)
    console_loop.lay_down()
    console_loop.make_safe()


def touch(
    console_loop: ConsoleLoop,
    number: int,
    take: Callable[[Record], _T],
    *,
    may_end: bool = False,
) -> _T | None:
    """Wait for [space]; returns the result of `take` for a sole at rest.

    Asks again while the sole moves or `take` refuses it.

    Args:
        console_loop: console loop of the rig.
        number: number of the touch.
        take: receives the cycles at rest; raises PreflightError to refuse them.
        may_end: whether [d] ends the touches, with None as the result.

    Raises:
        StopRequestedError, ArmFaultError: as `ConsoleLoop.tick`.
    """
    name = TrialName(number, 1)
    while True:
        key = console_loop.tick(Prompt.TOUCH, name)
        if key == "d" and may_end:
            return None
        if key != " ":
            continue
        try:
            return take(_at_rest(console_loop.loop_client))
        except PreflightError as error:
            console_loop.console.say(str(error))


def _at_rest(client: LoopClient) -> Record:
    client.advance(AVERAGE)
    records = client.last(AVERAGE)
    moved = float(np.ptp(records["foot_position"], axis=0).max())
    if moved > STILL:
        raise PreflightError(
            f"The sole moved by {1e3 * moved:.1f} mm (limit {1e3 * STILL:g}).",
            hint="Hold it still on the ground, then [space] again.",
        )
    return records
