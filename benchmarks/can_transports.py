"""Processor time of the 13 frames of a cycle through each CAN transport.

Four frames leave and nine arrive in every cycle of 2 ms. The transports take turns with
pauses in between, so that neither finds warm caches. SocketCAN needs an interface; here
datagrams on the loopback device carry the same 16 bytes, time-stamped by the kernel,
with the same socket options. The processor time of this thread is measured. Processors
are kept out of sleep states as while the arm is driven, since waking up would count.
"""

import argparse
import gc
import json
import logging
import math
import socket
import statistics
import struct
import sys
import time
from dataclasses import asdict, dataclass
from typing import Any

from can.interfaces.socketcan import socketcan

from acquisition.clock import SystemClock
from acquisition.control_loop.realtime import RealtimeRequest, request
from benchmarks.rows import BenchRow
from wam.bus.datagrams import system_call
from wam.bus.frames import (
    MOTOR_NODES,
    SENSOR_NODE,
    Group,
    encode_force,
    encode_get,
    encode_position,
    encode_torque,
    encode_torques,
    group_id,
    position_reply_id,
)
from wam.bus.link import CanLink, Transport
from wam.bus.properties import MODERN, Device, property_number
from wam.bus.socketcan import SocketcanTransport
from wam.bus.transports import PythonCanTransport

GOAL_US = 45.0  # for the kernel socket, per cycle
_PERIOD_NS = 2_000_000
_WARM_UP = 100  # cycles
_FRAME = struct.Struct("=IB3x8s")
_ARRIVING = [
    (position_reply_id(node), encode_position(1000 * node)) for node in MOTOR_NODES
] + [
    (group_id(Group.FORCE, SENSOR_NODE), encode_force((1.0, -2.5, -9.81))),
    (group_id(Group.TORQUE, SENSOR_NODE), encode_torque((0.1, -0.25, 0.015))),
]


@dataclass(frozen=True, slots=True)
class TransportCost:
    """Processor time of one cycle's frames.

    Attributes:
        name: name of the transport.
        median_us: median over cycles [us].
        p99_us: 99th percentile [us].
    """

    name: str
    median_us: float
    p99_us: float


class Ends:
    """Both ends of a loopback bus: a transport and the socket opposite it."""

    def __init__(self, near: socket.socket, transport: Transport) -> None:
        self.far = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.far.bind(("127.0.0.1", 0))
        near.bind(("127.0.0.1", 0))
        near.connect(self.far.getsockname())
        self.far.connect(near.getsockname())
        self.far.setblocking(False)
        self.near = near
        self.link = CanLink(transport)
        self.times: list[int] = []
        self._p = encode_get(property_number(Device.MOTOR, "P", MODERN))
        self._t = property_number(Device.MOTOR, "T", MODERN)
        self._ft = encode_get(property_number(Device.SENSOR, "FT"))

    def cycle(self) -> int:
        """Exchange the frames of one cycle and return the processor time [ns]."""
        link, begin = self.link, time.thread_time_ns()
        link.send(group_id(Group.ARM), self._p)
        link.send(SENSOR_NODE, self._ft)
        cpu_ns = time.thread_time_ns() - begin
        for can_id, data in _ARRIVING:
            self.far.send(_FRAME.pack(can_id, len(data), data))
        begin = time.thread_time_ns()
        arrived = len(link.receive())
        link.send(group_id(Group.LOWER_TORQUE), encode_torques([1, 2, 3, 4], self._t))
        link.send(group_id(Group.WRIST_TORQUE), encode_torques([5, 6, 7], self._t))
        cpu_ns += time.thread_time_ns() - begin
        if arrived != len(_ARRIVING):
            raise RuntimeError(f"{arrived} of {len(_ARRIVING)} frames arrived")
        for _ in range(4):
            self.far.recv(_FRAME.size)
        return cpu_ns


def kernel_ends() -> Ends:
    """Return this project's transport over a kernel socket."""
    near = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    transport = SocketcanTransport(near, "loopback", SystemClock(), system_call())
    return Ends(near, transport)


def library_ends() -> Ends:
    """Return python-can's SocketCAN bus behind this project's transport."""
    near = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    library: Any = socketcan
    library.create_socket = lambda: near
    library.bind_socket = lambda *_: None
    bus = socketcan.SocketcanBus("loopback")
    return Ends(near, PythonCanTransport(bus, SystemClock()))


def measure(cycles: int) -> list[TransportCost]:
    """Return the cost of each transport over `cycles` paced cycles."""
    request(RealtimeRequest(limit_wakeup_latency=True))
    transports = {"kernel socket": kernel_ends(), "python-can": library_ends()}
    next_ns = time.monotonic_ns()
    gc.collect()
    gc.disable()
    for number in range(_WARM_UP + cycles):
        for ends in transports.values():
            next_ns = max(next_ns + _PERIOD_NS, time.monotonic_ns())
            time.sleep(max(0.0, (next_ns - time.monotonic_ns()) * 1e-9))
            cpu_ns = ends.cycle()
            if number >= _WARM_UP:
                ends.times.append(cpu_ns)
    gc.enable()
    return [_cost(name, ends.times) for name, ends in transports.items()]


def rows() -> list[BenchRow]:
    """Return the measurements as table rows."""
    logging.disable()  # python-can warns that datagrams lack CAN options
    return [
        BenchRow(
            f"13 frames of a cycle through the {cost.name}, paced",
            cost.median_us,
            "us",
            GOAL_US if cost.name == "kernel socket" else None,
        )
        for cost in measure(1000)
    ]


def _cost(name: str, times: list[int]) -> TransportCost:
    p99 = sorted(times)[math.ceil(0.99 * len(times)) - 1]
    return TransportCost(name, statistics.median(times) / 1e3, p99 / 1e3)


def main() -> int:
    """Measure and print; the exit code does not depend on the figures."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument(
        "--cycles", type=int, default=3000, help="cycles per transport (3000)"
    )
    parser.add_argument("--json", action="store_true", help="print JSON instead")
    args = parser.parse_args()
    logging.disable()  # python-can warns that datagrams lack CAN options
    costs = measure(max(1, args.cycles))
    if args.json:
        print(json.dumps([asdict(cost) for cost in costs], indent=2))
        return 0
    for cost in costs:
        print(
            f"{cost.name:16} p50 {cost.median_us:6.1f} us   p99 {cost.p99_us:6.1f} us"
        )
    ratio = costs[1].median_us / costs[0].median_us
    verdict = "met" if costs[0].median_us <= GOAL_US else "missed"
    print(f"{ratio:.1f} times less; goal {GOAL_US:.0f} us per cycle: {verdict}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
