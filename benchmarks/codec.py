"""Cost of one cycle's frames in Python: the codec, compared with python-can.

A cycle has 13 frames: the position request, seven replies, two torque frames, the F/T
request and its two replies. Parts alternate within a round, so that other load on the
machine affects all of them alike; medians are over rounds.
"""

import argparse
import gc
import json
import math
import statistics
import time
from collections.abc import Callable, Generator
from contextlib import contextmanager
from dataclasses import asdict, dataclass

import can

from benchmarks.rows import BenchRow
from wam.bus.frames import (
    MOTOR_NODES,
    SENSOR_NODE,
    Group,
    decode_force,
    decode_position,
    decode_torque,
    encode_force,
    encode_get,
    encode_position,
    encode_torque,
    encode_torques,
    group_id,
    position_reply_id,
)
from wam.bus.properties import MODERN, Device, property_number

GOAL_US = 30.0  # for the codec, per cycle
_WARM_UP = 200  # rounds
_COUNTS = (12, -36840, 36901, -36728, 417, -95, 3)
_UNITS = (-64, -877, 556, -750, 168, 34, -59)  # puck units
_FORCE, _TORQUE = (1.0, -2.5, -9.81), (0.1, -0.25, 0.015)  # N, N m
_P = property_number(Device.MOTOR, "P", MODERN)
_T = property_number(Device.MOTOR, "T", MODERN)
_FT = property_number(Device.SENSOR, "FT")


@dataclass(frozen=True, slots=True)
class PartCost:
    """Measured cost of one part of a cycle.

    Attributes:
        name: name of the part.
        frames: number of frames handled per cycle.
        median_us: cost per cycle, median over rounds [us].
        p99_us: 99th percentile over rounds [us].
        per_codec: median as a multiple of the whole codec's.
    """

    name: str
    frames: int
    median_us: float
    p99_us: float
    per_codec: float


@dataclass(frozen=True, slots=True)
class _Work:
    name: str
    frames: int
    is_codec: bool
    run: Callable[[], object]


def main() -> int:
    """Measure and print; the exit code does not depend on the figures."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument(
        "--rounds", type=_positive, default=5000, metavar="N", help="cycles (5000)"
    )
    parser.add_argument("--json", action="store_true", help="print JSON instead")
    args = parser.parse_args()
    with _two_ends() as (bus, other):
        parts = measure([*codec_work(), *library_work(bus, other)], args.rounds)
    if args.json:
        print(json.dumps(_summary(parts, args.rounds), indent=2))
    else:
        _print_table(parts, args.rounds)
    return 0


def rows() -> list[BenchRow]:
    """Return the measurements as table rows."""
    parts = measure(codec_work(), 2000)
    total = sum(part.median_us for part in parts)
    return [BenchRow("13 frames of a cycle, coded and decoded", total, "us", GOAL_US)]


def codec_work() -> list[_Work]:
    """Return the parts of the codec, each for one cycle."""
    replies = [encode_position(counts) for counts in _COUNTS]
    force, torque = encode_force(_FORCE), encode_torque(_TORQUE)
    lower, wrist = _UNITS[:4], _UNITS[4:]

    def encode_both() -> None:
        encode_torques(lower, _T)
        encode_torques(wrist, _T)

    def decode_sensor() -> None:
        decode_force(force)
        decode_torque(torque)

    return [
        _Work("encode position request", 1, True, lambda: encode_get(_P)),
        _Work(
            "decode positions", 7, True, lambda: [decode_position(d) for d in replies]
        ),
        _Work("encode torques", 2, True, encode_both),
        _Work("encode F/T request", 1, True, lambda: encode_get(_FT)),
        _Work("decode F/T", 2, True, decode_sensor),
    ]


def library_work(bus: can.BusABC, other: can.BusABC) -> list[_Work]:
    """Return python-can's handling of the same frames: message objects, virtual bus.

    The virtual bus copies its messages; a real adapter's driver may cost more or less.
    """
    sent = [
        (group_id(Group.ARM), encode_get(_P)),
        (SENSOR_NODE, encode_get(_FT)),
        (group_id(Group.LOWER_TORQUE), encode_torques(_UNITS[:4], _T)),
        (group_id(Group.WRIST_TORQUE), encode_torques(_UNITS[4:], _T)),
    ]
    received = [
        (position_reply_id(node), encode_position(counts))
        for node, counts in zip(MOTOR_NODES, _COUNTS, strict=True)
    ]
    received += [
        (group_id(Group.FORCE, SENSOR_NODE), encode_force(_FORCE)),
        (group_id(Group.TORQUE, SENSOR_NODE), encode_torque(_TORQUE)),
    ]
    messages, answers = _messages(sent), _messages(received)

    def exchange() -> None:
        for message in messages:
            bus.send(message)
        for message in answers:
            other.send(message)
        while other.recv(0) is not None:
            pass
        while bus.recv(0) is not None:
            pass

    return [
        _Work("python-can messages", 13, False, lambda: _messages([*sent, *received])),
        _Work("python-can virtual bus", 13, False, exchange),
    ]


def measure(work: list[_Work], rounds: int) -> list[PartCost]:
    """Run all parts `rounds` times in turn and return the cost of each per cycle."""
    durations: list[list[int]] = [[] for _ in work]
    gc.collect()
    gc.disable()
    try:
        for number in range(_WARM_UP + rounds):
            for part, times in zip(work, durations, strict=True):
                begin = time.perf_counter_ns()
                part.run()
                end = time.perf_counter_ns()
                if number >= _WARM_UP:
                    times.append(end - begin)
    finally:
        gc.enable()
    timed_work = list(zip(work, durations, strict=True))
    codec = [times for part, times in timed_work if part.is_codec]
    whole = [sum(parts) for parts in zip(*codec, strict=True)]
    unit = statistics.median(whole)
    parts = [_part(part.name, part.frames, times, unit) for part, times in timed_work]
    return [_part("codec, whole cycle", 13, whole, unit), *parts]


def _part(name: str, frames: int, times: list[int], unit: float) -> PartCost:
    median = statistics.median(times)
    p99 = sorted(times)[math.ceil(0.99 * len(times)) - 1]
    return PartCost(name, frames, median / 1e3, p99 / 1e3, median / unit)


def _messages(frames: list[tuple[int, bytes]]) -> list[can.Message]:
    return [
        can.Message(arbitration_id=can_id, is_extended_id=False, data=data)
        for can_id, data in frames
    ]


@contextmanager
def _two_ends() -> Generator[tuple[can.BusABC, can.BusABC]]:
    """Open two ends of a virtual bus."""
    with (
        can.Bus("codec", interface="virtual") as one,
        can.Bus("codec", interface="virtual") as other,
    ):
        yield one, other


def _summary(parts: list[PartCost], rounds: int) -> dict[str, object]:
    return {
        "rounds": rounds,
        "goal_us": GOAL_US,
        "is_met": parts[0].median_us < GOAL_US,
        "parts": [asdict(part) for part in parts],
    }


def _print_table(parts: list[PartCost], rounds: int) -> None:
    print(f"{'part':26}{'frames':>7}{'p50 us':>10}{'p99 us':>10}{'x codec':>10}")
    for part in parts:
        print(
            f"{part.name:26}{part.frames:7}{part.median_us:10.2f}{part.p99_us:10.2f}"
            f"{part.per_codec:10.2f}"
        )
    verdict = "met" if parts[0].median_us < GOAL_US else "missed"
    print(
        f"{rounds} rounds; goal below {GOAL_US:.0f} us per cycle for the codec: ",
        end="",
    )
    print(verdict)


def _positive(text: str) -> int:
    number = int(text)
    if number < 1:
        raise argparse.ArgumentTypeError("expected a whole number above 0")
    return number


if __name__ == "__main__":
    raise SystemExit(main())
