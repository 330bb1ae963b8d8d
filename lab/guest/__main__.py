"""Run scenarios inside the machine and print results: python -m lab.guest NAME..."""

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
    AllFinished,
    Message,
    ScenarioResult,
    ScenarioStarted,
    TimerLocation,
    Verdict,
    to_line,
)

# Modules that the programs import: loaded once, so that forked programs have them.
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
    "scipy.signal",  # not used; without it first torques are late at times
    "fakes.serving.puck_server",
)
# File owners and change times differ in the guest: git would read all files again.
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
_CLEANUP = 5.0  # s until processes of a failed scenario have left the bus
_MAX_OUTPUT = 8000  # characters kept from the end of a failed scenario's output


def main(names: list[str]) -> None:
    """Run the scenarios `names` and print start and result of each.

    With "--echo" among the names, commands and output are also printed immediately.
    """
    os.environ["TMPDIR"] = str(LAB_FOLDER / "tmp")
    os.environ["HOME"] = str(LAB_FOLDER)
    os.environ.update(_GIT)
    (LAB_FOLDER / "tmp").mkdir(parents=True, exist_ok=True)
    _send(_timer())
    # Guest time jumps while files of the host are read, so read them beforehand.
    for name in _WARM:
        importlib.import_module(name)
    start_warm()
    booted = seconds()
    for scenario in chosen([name for name in names if name != "--echo"]):
        _send(ScenarioStarted(scenario.name))
        _send(_result(scenario, is_echoed="--echo" in names))
    _send(AllFinished(round(booted, 2)))


def _timer() -> TimerLocation:
    """Return the symbols that locate the kernel's local timer."""
    lines = Path("/proc/kallsyms").read_text(encoding="ascii").splitlines()
    symbols = {line.split()[2]: line for line in lines if line.endswith(_TIMER)}
    events, offsets = (int(symbols[name.strip()].split()[0], 16) for name in _TIMER)
    return TimerLocation(events, offsets)


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
    except Exception:  # an error in the scenario itself is a failure, too
        reason = traceback.format_exc()
    if reason:
        wait(_CLEANUP)
    verdict = Verdict.FAILED if reason else Verdict.PASSED
    if scenario.expected:
        verdict = Verdict.EXPECTED if reason else Verdict.SURPRISING
        reason = scenario.expected if reason else f"passes, although: {reason}"
    output = "" if verdict.is_fine else "".join(room.log)[-_MAX_OUTPUT:]
    duration = round(seconds() - start, 2)
    return ScenarioResult(scenario.name, verdict, duration, figures, reason, output)


def _send(message: Message) -> None:
    sys.stdout.write(to_line(message) + "\n")
    sys.stdout.flush()


if __name__ == "__main__":
    main(sys.argv[1:])
