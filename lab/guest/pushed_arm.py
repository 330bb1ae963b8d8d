"""Serves an arm with ground and hand on a CAN bus: python -m lab.guest.pushed_arm.

Lines on stdin move the hand and press the pendant, as a person would do:
prepare TRIAL, lift, put_down, push, rest, let_go, activate, idle, estop,
break FAULT, mend, sensor_off, sensor_on, quit.
"""

import argparse
import sys
from collections.abc import Callable
from pathlib import Path

from acquisition import SystemClock
from experiments.rig.fake import SimulatedRig
from experiments.settings import load_settings
from experiments.tools import Lines
from fakes.pucks import WiredNetwork
from fakes.serving import open_can_port
from fakes.world import simulated_rig
from fakes.world_clock import TICK_NS, WorldClock
from lab.guest.far_sensor import FarEnd
from wam.model import load_constants

# A step of 2 ms in place of four: the arm of the laboratory moves within 0.1 mm as with
# four, and every instruction of it is emulated.
_SUBSTEPS = 1
# What the arm says within this time leaves together, as through an adapter that
# collects frames: seven positions, the last of which starts 0.53 ms after the question.
_TOGETHER_NS = 550_000


class PushedArm:
    """A simulated rig on a bus, and what a person does with it."""

    def __init__(self, options: argparse.Namespace) -> None:
        settings = load_settings(options.config)
        row = settings.row(options.row)
        world = SimulatedRig(settings.rig, row, options.seed, 0.02, "steady")
        self._clock = WorldClock(SystemClock())
        plain = {**world.metadata(), "substeps": _SUBSTEPS}
        simulation = simulated_rig(plain, load_constants(), self._clock)
        self._simulation, rig = simulation, simulation.rig
        self._rig = rig
        self._wired = WiredNetwork(rig.network, is_far=True)
        interface, _, channel = options.bus.partition(":")
        self._port = open_can_port(interface, channel, settings.rig.can.bitrate)
        self._line: FarEnd | None = None
        if options.line is not None:
            self._line = FarEnd(rig.stream, options.line, self._clock.now_ns())
        self._actions: dict[str, Callable[[], None]] = {
            "lift": simulation.lift,
            "put_down": simulation.put_down,
            "push": simulation.push,
            "rest": simulation.rest,
            "let_go": simulation.let_go,
            "mend": simulation.clear_faults,
            "activate": lambda: simulation.pendant("activate"),
            "idle": lambda: simulation.pendant("idle"),
            "estop": lambda: simulation.pendant("estop"),
            "sensor_off": lambda: self._switch(is_on=False),
            "sensor_on": lambda: self._switch(is_on=True),
        }

    def do(self, line: str) -> bool:
        """Do what a line says; return False where it ends the server."""
        word, _, operand = line.strip().partition(" ")
        if word == "quit":
            return False
        if word == "prepare":
            self._simulation.prepare(int(operand))
        elif word == "break":
            self._simulation.inject(operand)
        else:
            self._actions[word]()
        return True

    def step(self) -> int:
        """Wait for a frame or for the network, 2 ms at most; let both go on.

        Returns:
            the time [ns] up to which the world has gone on.
        """
        now_ns, event_ns = self._clock.now_ns(), self._wired.next_event_ns()
        left = TICK_NS if event_ns is None else max(event_ns - now_ns, _TOGETHER_NS)
        self._clock.wait(self._port, now_ns + min(left, TICK_NS))
        now_ns = self._clock.go_on()
        for can_id, data in self._port.receive():
            self._wired.send(now_ns, can_id, data)
        for _, can_id, data in self._wired.advance(now_ns):
            self._port.send(can_id, data)
        self._rig.plant.advance(now_ns)
        if self._line is not None:
            self._line.advance(now_ns)
        return now_ns

    def _switch(self, *, is_on: bool) -> None:
        if self._line is not None:
            self._line.switch(self._clock.now_ns(), is_on=is_on)


def main() -> None:
    """Serve until a line says quit."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--config", type=Path, required=True)
    options.add_argument("--bus", required=True, metavar="INTERFACE:CHANNEL")
    options.add_argument("--row", default="TF")
    options.add_argument("--seed", type=int, default=1)
    options.add_argument("--line", type=Path)
    arm = PushedArm(options.parse_args())
    lines = Lines(sys.stdin.fileno())
    sys.stdout.write("ready\n")
    sys.stdout.flush()
    heard_ns = 0
    while True:
        now_ns = arm.step()
        if now_ns - heard_ns < TICK_NS:
            continue
        heard_ns = now_ns
        if not all(arm.do(line) for line in lines.take()):
            return


if __name__ == "__main__":
    main()
