"""The arm at home on a real CAN socket: check, zero, bench."""

import re

from lab.guest.commands import ScenarioError, require
from lab.guest.machine_room import CAN, COLD, FAR_CAN, MachineRoom
from lab.guest.network import clear, disturb, set_up_both

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
    page = room.finish(
        room.traction("check", "--loop-test", "2", before=COLD), _PATIENCE
    )
    require("LIVE RIG" in page, "check did not meet a live rig")
    missed = figure(page, r"missed (\d+/\d+)")
    bench = room.finish(room.traction("bench", "--seconds", "1"), _PATIENCE)
    return {
        "exchange": figure(page, r"7 positions after ([^,]+, \d+ incomplete)"),
        "sensor": figure(page, r"F/T samples\s+(.*)"),
        "check missed": missed,
        "bench": figure(bench, r"([\d.]+ Hz)"),
    }


_REFUSED = 3  # exit code: nothing was created


def full_queue(room: MachineRoom) -> Figures:
    """Let can0's queue fill: refused, and not as an adapter that is unplugged."""
    _served(room)
    disturb(room.shell, CAN, "delay 50ms limit 10")
    try:
        output = room.finish(room.traction("check"), _PATIENCE, _REFUSED)
    finally:
        clear(room.shell, CAN)
    require("plugged in" not in output, "a full queue is taken for a missing adapter")
    return {"said": output.strip().splitlines()[-1]}


def second_host(room: MachineRoom) -> Figures:
    """Let another host ask the safety module: every command refuses to begin."""
    _served(room)
    other = room.start("cangen", FAR_CAN, "-I", "00A", "-g", "5", "-L", "1", "-D", "08")
    try:
        output = room.finish(room.traction("check"), _PATIENCE, _REFUSED)
    finally:
        other.close()
    require("node 0" in output, "another master is not named")
    return {"said": output.strip().splitlines()[-1]}


def link_down_at_start(room: MachineRoom) -> Figures:
    """Begin with can0 down: refused with the command that helps."""
    _served(room)
    room.shell.run(f"ip link set {CAN} down")
    output = room.finish(room.traction("check"), _PATIENCE, _REFUSED)
    require(f"ip link set {CAN} up" in output, "the command that helps is not named")
    return {"said": output.strip().splitlines()[-1]}


def _served(room: MachineRoom) -> None:
    set_up_both(room.shell)
    room.write_bus_config()
    room.serve_home_arm()
