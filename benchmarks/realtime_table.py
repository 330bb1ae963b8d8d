"""The table comparing the loop with C: measurements, goals and verdicts."""

import dataclasses
import statistics

import numpy as np
from numpy.typing import NDArray

from acquisition.clock import PERIOD_NS
from acquisition.control_loop.loop import LATE_NS
from experiments.preflight.loop_benchmark import BenchReport, ProcessUse

NEAR_NS = 4_000_000
QUANTILES = (50.0, 99.0, 99.9)
Times = NDArray[np.int64]


@dataclasses.dataclass(frozen=True, slots=True)
class Row:
    """One row of the table; `is_met` None = no goal."""

    what: str
    goal: str
    measured: str
    is_met: bool | None


@dataclasses.dataclass(frozen=True, slots=True)
class Window:
    """Cycles of one window, shape (n, 4): deadline, woke, replies, sent [ns]."""

    cycles: Times

    @property
    def late(self) -> Times:
        """Lateness of each wake-up [ns]."""
        return self.cycles[:, 1] - self.cycles[:, 0]


def missed(cycles: Times) -> Times:
    """Return the times of missed cycles [ns]: begun late, or skipped."""
    late = cycles[:, 1] - cycles[:, 0] > LATE_NS
    gaps = np.diff(cycles[:, 0], prepend=cycles[0, 0] - PERIOD_NS) // PERIOD_NS - 1
    return np.repeat(cycles[:, 1], np.maximum(gaps, 0) + late)


def are_near_a_stall(moments: Times, stalls: Times) -> NDArray[np.bool_]:
    """Return which of `moments` lie within 4 ms of a stall."""
    if not len(stalls):
        return np.zeros(len(moments), bool)
    ends, lengths = stalls[:, 0], stalls[:, 1]
    near = (moments[:, None] >= (ends - lengths - NEAR_NS)[None, :]) & (
        moments[:, None] <= (ends + NEAR_NS)[None, :]
    )
    return np.any(near, axis=1)


@dataclasses.dataclass(slots=True)
class RealtimeRecord:
    """Measurements of all windows: loop reports, loop cycles, both C programs."""

    reports: list[BenchReport] = dataclasses.field(default_factory=list)
    loops: list[Window] = dataclasses.field(default_factory=list)
    wakes: list[Window] = dataclasses.field(default_factory=list)
    exchanges: list[Window] = dataclasses.field(default_factory=list)

    def cycles(self) -> Times:
        """Return all cycles of the loop, shape (n, 4)."""
        return np.concatenate([window.cycles for window in self.loops])

    def cpu(self, process: str) -> float:
        """Return the median share of a core used by `process`."""
        return statistics.median(use_of(r, process).cpu for r in self.reports)


def use_of(report: BenchReport, process: str) -> ProcessUse:
    """Return the resource use of `process`."""
    return next(use for use in report.processes if use.name == process)


def table(record: RealtimeRecord, stalls: Times) -> list[Row]:
    """Return all rows; `stalls`: end and length of each stall [ns], shape (n, 2)."""
    return [
        *cycle_rows(record, stalls),
        *wake_rows(record),
        *miss_rows(record, stalls),
        *use_rows(record),
    ]


def quantiles(times: Times) -> str:
    """Return the 50, 99 and 99.9 % quantiles and the maximum [us] as text."""
    values = [*np.percentile(times, QUANTILES), times.max()]
    return " / ".join(f"{value / 1000:.0f}" for value in values) + " us"


def cycle_rows(record: RealtimeRecord, stalls: Times) -> list[Row]:
    """Return the rows on the timing within a cycle."""
    cycles = record.cycles()
    whole = (cycles[:, 2] > cycles[:, 1]) & (cycles[:, 3] >= cycles[:, 2])
    clean = cycles[whole & ~are_near_a_stall(cycles[:, 1], stalls)]
    compute, out = clean[:, 3] - clean[:, 2], clean[:, 3] - clean[:, 0]
    c_50, c_999 = np.percentile(compute, (50, 99.9)) / 1000
    o_50, o_999 = np.percentile(out, (50, 99.9)) / 1000
    in_c_out = np.concatenate([w.cycles[w.cycles[:, 3] > 0] for w in record.exchanges])
    return [
        Row(
            "compute, last reply to torque, clean: p50, p99.9",
            "<= 150, 400 us",
            f"{c_50:.0f}, {c_999:.0f} us",
            bool(c_50 <= 150 and c_999 <= 400),
        ),
        Row(
            "torque out after release, clean: p50, p99.9",
            "<= 1400, 1800 us",
            f"{o_50:.0f}, {o_999:.0f} us",
            bool(o_50 <= 1400 and o_999 <= 1800),
        ),
        Row(
            "  in C, p50 / p99 / p99.9 / max",
            "",
            quantiles(in_c_out[:, 3] - in_c_out[:, 0]),
            None,
        ),
    ]


def wake_rows(record: RealtimeRecord) -> list[Row]:
    """Return the rows on wake-up latency; ratios are medians over the windows."""
    ratio = {
        q: statistics.median(
            np.percentile(loop.late, q) / np.percentile(wake.late, q)
            for loop, wake in zip(record.loops, record.wakes, strict=True)
        )
        for q in QUANTILES
    }
    cycles = record.cycles()
    return [
        Row(
            "wake-up, p50 / p99 / p99.9 / max",
            "",
            quantiles(cycles[:, 1] - cycles[:, 0]),
            None,
        ),
        Row(
            "  in C",
            "",
            quantiles(np.concatenate([wake.late for wake in record.wakes])),
            None,
        ),
        Row(
            "wake-up against C: p50, p99 (p99.9)",
            "<= 1.5, 1.5",
            f"{ratio[50.0]:.2f}, {ratio[99.0]:.2f} ({ratio[99.9]:.2f})",
            bool(ratio[50.0] <= 1.5 and ratio[99.0] <= 1.5),
        ),
    ]


def miss_rows(record: RealtimeRecord, stalls: Times) -> list[Row]:
    """Return the rows on missed cycles."""
    count = len(record.cycles())
    in_loop = np.concatenate([missed(window.cycles) for window in record.loops])
    in_c = np.concatenate([missed(window.cycles) for window in record.exchanges])
    in_c_count = sum(len(window.cycles) for window in record.exchanges)
    unexplained = int((~are_near_a_stall(in_loop, stalls)).sum())
    per_million = unexplained / count * 1e6
    allowed = 1.5 * len(in_c) * count / in_c_count + 5
    return [
        Row(
            "missed, not near a stall",
            "<= 100 per million",
            f"{unexplained} of {count} ({per_million:.0f} per million)",
            per_million <= 100,
        ),
        Row(
            "missed, all",
            f"<= {allowed:.0f} (1.5 x C + 5)",
            f"{len(in_loop)}; C {len(in_c)} of {in_c_count}",
            len(in_loop) <= allowed,
        ),
        Row("stalls seen by the witness", "", str(len(stalls)), None),
    ]


def use_rows(record: RealtimeRecord) -> list[Row]:
    """Return the rows on processor use, memory and the recorder."""
    loop, recorder = record.cpu("control"), record.cpu("recorder")
    faults = sum(use_of(r, "control").page_faults for r in record.reports)
    lost = sum(report.lost for report in record.reports)
    return [
        Row(
            "CPU of a core: loop, recorder",
            "<= 30, 5 %",
            f"{loop:.0%}, {recorder:.0%}",
            loop <= 0.30 and recorder <= 0.05,
        ),
        Row("samples lost by the recorder", "0", str(lost), lost == 0),
        Row("page faults in the loop, warm", "0", str(faults), faults == 0),
    ]
