"""How a guided calibration ends: done, stopped, or by a fault of the arm."""

from collections.abc import Callable

from acquisition.errors import TractionError
from experiments.messages import Circumstances, fault_text, rest_text
from experiments.run.console_loop import Stage
from experiments.run.participants import FaultedError, StopAskedError

INTERRUPTED = 130
_NOTHING = "Nothing was written."
_HOLD = 0.2  # s between a stop and the brakes


def guided(stage: Stage, work: Callable[[], None]) -> int:
    """Do `work` and return the exit code; what goes wrong is said on the console.

    Every way out leaves the arm idle: after a stop it holds first, or damps when the
    stop was asked for twice.
    """
    console = stage.company.console
    try:
        work()
    except StopAskedError:
        stage.obey_stop()
        stage.control.advance(_HOLD)
        console.say(f"Stopped as asked. {_NOTHING}")
        return INTERRUPTED
    except FaultedError as fault:
        place = Circumstances(
            "The calibration", is_bus_down=stage.control.loop.is_bus_down
        )
        console.problem(fault_text(fault.verdict, place, _NOTHING))
        return 4
    except TractionError as error:
        console.problem(f"{error} {_NOTHING}")
        return error.exit_code
    finally:
        confirmed = stage.make_safe()
        mode = stage.rig.crew.safety_mode()
        console.say(rest_text(mode, is_confirmed=confirmed))
    return 0
