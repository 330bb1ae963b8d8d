"""How a guided calibration ends: done, stopped, or by a fault of the arm."""

from collections.abc import Callable

from acquisition.errors import TractionError
from experiments.company import FaultedError, StopAskedError
from experiments.messages import Circumstances, fault_text
from experiments.stage import Stage

_NOTHING = "Nothing was written."


def guided(stage: Stage, work: Callable[[], None]) -> int:
    """Do `work` and return the exit code; what goes wrong is said on the console."""
    console = stage.company.console
    try:
        work()
    except StopAskedError:
        console.say(f"Stopped as asked. {_NOTHING}")
        return 5
    except FaultedError as fault:
        found = Circumstances(is_bus_down=stage.control.loop.is_bus_down)
        console.problem(fault_text(fault.verdict, found, _NOTHING))
        return 4
    except TractionError as error:
        console.problem(f"{error} {_NOTHING}")
        return error.exit_code
    return 0
