"""Time stamps of each cycle and latency statistics of the loop."""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from acquisition.control_loop.loop import Tick
from acquisition.record_layout import struct_of
from acquisition.sample import Record

TIMING_DTYPE = np.dtype(
    [
        ("number", "<u8"),
        ("deadline_ns", "<u8"),
        ("woke_ns", "<u8"),
        ("replies_ns", "<u8"),
        ("sent_ns", "<u8"),
        ("ended_ns", "<u8"),
        ("is_late", "<u8"),
    ]
)
_TIMING: Final = struct_of(TIMING_DTYPE)
QUANTILES = (50.0, 99.0, 99.9, 100.0)
SLOW_EXCHANGE_NS = 1_300_000  # p99 of the exchange above which cycles may overrun


def pack_timing(tick: Tick, replies_ns: int, sent_ns: int, ended_ns: int) -> bytes:
    """Return the bytes of one timing record."""
    return _TIMING.pack(
        tick.number,
        tick.deadline_ns,
        tick.now_ns,
        replies_ns,
        sent_ns,
        ended_ns,
        tick.is_late,
    )


@dataclass(frozen=True, slots=True)
class LatencyQuantiles:
    """Quantiles of a time [us]: 50 %, 99 %, 99.9 % and maximum."""

    p50: float
    p99: float
    p999: float
    worst: float


@dataclass(frozen=True, slots=True)
class LoopReport:
    """Latencies of a series of cycles.

    Attributes:
        cycles: number of cycles run.
        missed: number of cycles that began late or were skipped.
        rate: cycle rate [Hz].
        late: deadline to wake-up.
        exchange: wake-up to the last of seven positions; None if never complete.
        compute: last reply to torques sent; None as above.
        torque_out: deadline to torques sent; None as above.
        total: deadline to the end of the cycle.
    """

    cycles: int
    missed: int
    rate: float
    late: LatencyQuantiles
    exchange: LatencyQuantiles | None
    compute: LatencyQuantiles | None
    torque_out: LatencyQuantiles | None
    total: LatencyQuantiles


def spread(times_ns: NDArray[np.int64]) -> LatencyQuantiles:
    """Return the quantiles of times [ns], shape (n,), n >= 1."""
    values = np.percentile(times_ns, QUANTILES) / 1000.0
    return LatencyQuantiles(*(round(float(value), 1) for value in values))


def loop_report(timings: Record) -> LoopReport | None:
    """Return the latency report of timing records; None for fewer than two."""
    if len(timings) < 2:
        return None
    columns = {
        name: timings[name].astype(np.int64) for name in timings.dtype.names or ()
    }
    deadline, replies = columns["deadline_ns"], columns["replies_ns"]
    sent = columns["sent_ns"]
    whole = (replies > columns["woke_ns"]) & (sent >= replies)
    skipped = int(columns["number"][-1] - columns["number"][0]) + 1 - len(timings)
    span = (deadline[-1] - deadline[0]) / 1e9
    return LoopReport(
        cycles=len(timings),
        missed=int(columns["is_late"].sum()) + max(0, skipped),
        rate=round((len(timings) - 1) / span, 2),
        late=spread(columns["woke_ns"] - deadline),
        exchange=_spread_of((replies - columns["woke_ns"])[whole]),
        compute=_spread_of((sent - replies)[whole]),
        torque_out=_spread_of((sent - deadline)[whole]),
        total=spread(columns["ended_ns"] - deadline),
    )


def _spread_of(times_ns: NDArray[np.int64]) -> LatencyQuantiles | None:
    return spread(times_ns) if len(times_ns) else None
