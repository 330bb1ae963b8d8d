"""Runs scenarios inside the machine: python -m lab.guest NAME...; one line each."""

import importlib
import os
import sys
import traceback
from pathlib import Path

from lab.guest.commands import ScenarioError, seconds, wait
from lab.guest.machine_room import LAB_FOLDER, MachineRoom
from lab.guest.scenarios.registry import Scenario, chosen
from lab.guest.warm_start import start_warm
from lab.results import (
    Begun,
    Finished,
    Message,
    ScenarioResult,
    TimerFound,
    Verdict,
    to_line,
)

# What programs load: read once, and there already when they start.
_WARM = (
    "can",
    "mcap.writer",
    "pinocchio",
    "serial",
    "rich.console",
    "acquisition.recording",
    "experiments.commands.run",
    "experiments.rig.processes",
    "experiments.run.session",
    "experiments.run.quality",
    "analysis.data",
    "scipy.signal",  # no session uses it, but without it first replies come late here
    "fakes.serving.puck_server",
)
# The files' owner and time of change are others in here: git would read them all.
_GIT = {
    "GIT_CONFIG_COUNT": "3",
    "GIT_CONFIG_KEY_0": "core.checkStat",
    "GIT_CONFIG_VALUE_0": "minimal",
    "GIT_CONFIG_KEY_1": "core.trustctime",
    "GIT_CONFIG_VALUE_1": "false",
    "GIT_CONFIG_KEY_2": "safe.directory",
    "GIT_CONFIG_VALUE_2": "*",
}
_TIMER = (" lapic_events", " __per_cpu_offset")  # symbols of the kernel
_OVER = 5.0  # s, in which what a failed scenario left behind lets go of the bus
_LONGEST_OUTPUT = 8000  # characters of a failed scenario, its end


def main(names: list[str]) -> None:
    """Run the scenarios `names`, telling begin and result of each.

    "--echo" among them: what is run and said goes to the console as it comes.
    """
    os.environ["TMPDIR"] = str(LAB_FOLDER / "tmp")
    os.environ["HOME"] = str(LAB_FOLDER)
    os.environ.update(_GIT)
    (LAB_FOLDER / "tmp").mkdir(parents=True, exist_ok=True)
    _tell(_timer())
    # Guest time jumps while the host's files are read: read them before it counts.
    for name in _WARM:
        importlib.import_module(name)
    start_warm()
    booted = seconds()
    for scenario in chosen([name for name in names if name != "--echo"]):
        _tell(Begun(scenario.name))
        _tell(_result(scenario, is_echoed="--echo" in names))
    _tell(Finished(round(booted, 2)))


def _timer() -> TimerFound:
    """Return where the kernel keeps its local timer."""
    lines = Path("/proc/kallsyms").read_text(encoding="ascii").splitlines()
    symbols = {line.split()[2]: line for line in lines if line.endswith(_TIMER)}
    events, offsets = (int(symbols[name.strip()].split()[0], 16) for name in _TIMER)
    return TimerFound(events, offsets)


def _result(scenario: Scenario, *, is_echoed: bool) -> ScenarioResult:
    start = seconds()
    figures: dict[str, str] = {}
    reason = ""
    room = MachineRoom(scenario.name, is_echoed=is_echoed)
    try:
        with room:
            figures = scenario.run(room)
    except ScenarioError as error:
        reason = str(error)
    except Exception:  # a defect of the scenario is a failure of its own
        reason = traceback.format_exc()
    if reason:
        wait(_OVER)
    verdict = Verdict.FAILED if reason else Verdict.PASSED
    if scenario.expected:
        verdict = Verdict.EXPECTED if reason else Verdict.SURPRISING
        reason = scenario.expected if reason else f"passes, although: {reason}"
    output = "" if verdict.is_fine else "".join(room.log)[-_LONGEST_OUTPUT:]
    taken = round(seconds() - start, 2)
    return ScenarioResult(scenario.name, verdict, taken, figures, reason, output)


def _tell(message: Message) -> None:
    sys.stdout.write(to_line(message) + "\n")
    sys.stdout.flush()


if __name__ == "__main__":
    main(sys.argv[1:])
