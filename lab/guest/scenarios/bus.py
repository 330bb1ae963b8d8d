"""The arm at home on a real CAN socket: check, zero, bench."""

import re

from lab.guest.commands import ScenarioError, require
from lab.guest.machine_room import MachineRoom
from lab.guest.network import set_up_both

Figures = dict[str, str]
_PATIENCE = 60.0  # s of guest time for a command that tests the loop


def figure(output: str, pattern: str) -> str:
    """Return the first group of `pattern` in `output`.

    Raises:
        ScenarioError: it is not there.
    """
    match = re.search(pattern, output)
    if match is None:
        raise ScenarioError(f"the output has no {pattern!r}")
    return match[1].strip()


def home_arm(room: MachineRoom) -> Figures:
    """Zero the arm, check the rig, measure the loop: three commands on one arm."""
    set_up_both(room.shell)
    room.write_bus_config()
    room.serve_home_arm()
    room.finish(room.traction("zero", "--yes"), _PATIENCE)
    page = room.finish(room.traction("check"), _PATIENCE)
    require("LIVE RIG" in page, "check did not meet a live rig")
    missed = figure(page, r"missed (\d+/\d+)")
    bench = room.finish(room.traction("bench", "--seconds", "3"), _PATIENCE)
    return {
        "exchange": figure(page, r"7 positions after ([^,]+, \d+ incomplete)"),
        "sensor": figure(page, r"F/T samples\s+(.*)"),
        "check missed": missed,
        "bench": figure(bench, r"([\d.]+ Hz)"),
    }
