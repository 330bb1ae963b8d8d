"""The arm in its home pose on a real CAN socket: zero, check, bench at 500 Hz."""

import re

from lab.guest.commands import ScenarioError, require
from lab.guest.machine_room import CAN, COLD, MachineRoom
from lab.guest.network import counters, set_up_both

Figures = dict[str, str]
_PATIENCE = 60.0  # s of guest time for a command that tests the loop
_BENCH_TIME = 1.0  # s
_CYCLES_PER_S = 500
_REPLIES = 7  # received frames per cycle


def figure(output: str, pattern: str) -> str:
    """Return the first group of `pattern` in `output`.

    Raises:
        ScenarioError: the pattern does not occur.
    """
    match = re.search(pattern, output)
    if match is None:
        raise ScenarioError(f"the output has no {pattern!r}")
    return match[1].strip()


def at_rate(room: MachineRoom) -> Figures:
    """Zero the arm, check the rig, run the loop at 500 Hz: no frame is lost."""
    set_up_both(room.shell)
    room.write_bus_config()
    room.serve_home_arm()
    room.finish(room.traction("zero", "--yes"), _PATIENCE)
    page = room.finish(
        room.traction("check", "--loop-test", "1", before=COLD), _PATIENCE
    )
    require("LIVE RIG" in page, "check did not meet a live rig")
    before = counters(CAN)
    arguments = ("bench", "--seconds", f"{_BENCH_TIME:g}")
    bench = room.finish(room.traction(*arguments), _PATIENCE)
    counted = {name: n - before[name] for name, n in counters(CAN).items()}
    least = round(_BENCH_TIME * _CYCLES_PER_S) * _REPLIES
    require(counted["rx_packets"] >= least, f"{counted} instead of {least} frames")
    lost = {name: n for name, n in counted.items() if n and "packets" not in name}
    require(not lost, f"the interface counted {lost}")
    return {
        "exchange": figure(page, r"7 positions after ([^,]+, \d+ incomplete)"),
        "sensor": figure(page, r"F/T samples\s+(.*)"),
        "check missed": figure(page, r"missed (\d+/\d+)"),
        "bench": figure(bench, r"([\d.]+ Hz)"),
        "received": f"{counted['rx_packets']} frames, none dropped, no error",
    }
