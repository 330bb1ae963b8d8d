"""The table of the loop beside C: what was measured, and whether it is enough."""

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
    """One line of the table; `is_met` None = nothing was promised."""

    what: str
    goal: str
    measured: str
    is_met: bool | None


@dataclasses.dataclass(frozen=True, slots=True)
class Window:
    """Cycles of one window: columns deadline, woke, replies, sent [ns]."""

    cycles: Times

    @property
    def late(self) -> Times:
        """Lateness of each wake-up [ns]."""
        return self.cycles[:, 1] - self.cycles[:, 0]


def missed(cycles: Times) -> Times:
    """Return when cycles were missed [ns]: begun late, or skipped."""
    late = cycles[:, 1] - cycles[:, 0] > LATE_NS
    gaps = np.diff(cycles[:, 0], prepend=cycles[0, 0] - PERIOD_NS) // PERIOD_NS - 1
    return np.repeat(cycles[:, 1], np.maximum(gaps, 0) + late)


def explained(moments: Times, stalls: Times) -> NDArray[np.bool_]:
    """Return which of `moments` lie within 4 ms of a witnessed stall."""
    if not len(stalls):
        return np.zeros(len(moments), bool)
    ends, lengths = stalls[:, 0], stalls[:, 1]
    near = (moments[:, None] >= (ends - lengths - NEAR_NS)[None, :]) & (
        moments[:, None] <= (ends + NEAR_NS)[None, :]
    )
    return near.any(axis=1)


@dataclasses.dataclass(slots=True)
class RawRecord:
    """What the windows gave: loop reports, the loop's cycles, both C programs."""

    reports: list[BenchReport] = dataclasses.field(default_factory=list)
    loops: list[Window] = dataclasses.field(default_factory=list)
    wakes: list[Window] = dataclasses.field(default_factory=list)
    exchanges: list[Window] = dataclasses.field(default_factory=list)

    def cycles(self) -> Times:
        """Return all cycles of the loop, shape (n, 4)."""
        return np.concatenate([window.cycles for window in self.loops])

    def cpu(self, process: str) -> float:
        """Return the median share of a core that `process` used."""
        return statistics.median(use_of(r, process).cpu for r in self.reports)


def use_of(report: BenchReport, process: str) -> ProcessUse:
    """Return what `process` used."""
    return next(use for use in report.processes if use.name == process)


def table(found: RawRecord, stalls: Times) -> list[Row]:
    """Return all lines; `stalls` are the witness's, end and length [ns]."""
    return [
        *cycle_rows(found, stalls),
        *wake_rows(found),
        *miss_rows(found, stalls),
        *use_rows(found),
    ]


def quantiles(times: Times) -> str:
    """Return 50, 99 and 99.9 % and the largest [us] as text."""
    values = [*np.percentile(times, QUANTILES), times.max()]
    return " / ".join(f"{value / 1000:.0f}" for value in values) + " us"


def cycle_rows(found: RawRecord, stalls: Times) -> list[Row]:
    """Return the lines on what happens within a cycle."""
    cycles = found.cycles()
    whole = (cycles[:, 2] > cycles[:, 1]) & (cycles[:, 3] >= cycles[:, 2])
    clean = cycles[whole & ~explained(cycles[:, 1], stalls)]
    compute, out = clean[:, 3] - clean[:, 2], clean[:, 3] - clean[:, 0]
    c_50, c_999 = np.percentile(compute, (50, 99.9)) / 1000
    o_50, o_999 = np.percentile(out, (50, 99.9)) / 1000
    in_c_out = np.concatenate([w.cycles[w.cycles[:, 3] > 0] for w in found.exchanges])
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


def wake_rows(found: RawRecord) -> list[Row]:
    """Return the lines on waking up, medians over the windows for the ratios."""
    ratio = {
        q: statistics.median(
            np.percentile(loop.late, q) / np.percentile(wake.late, q)
            for loop, wake in zip(found.loops, found.wakes, strict=True)
        )
        for q in QUANTILES
    }
    cycles = found.cycles()
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
            quantiles(np.concatenate([wake.late for wake in found.wakes])),
            None,
        ),
        Row(
            "wake-up against C: p50, p99 (p99.9)",
            "<= 1.5, 1.5",
            f"{ratio[50.0]:.2f}, {ratio[99.0]:.2f} ({ratio[99.9]:.2f})",
            bool(ratio[50.0] <= 1.5 and ratio[99.0] <= 1.5),
        ),
    ]


def miss_rows(found: RawRecord, stalls: Times) -> list[Row]:
    """Return the lines on missed cycles."""
    count = len(found.cycles())
    own = np.concatenate([missed(window.cycles) for window in found.loops])
    theirs = np.concatenate([missed(window.cycles) for window in found.exchanges])
    in_c_count = sum(len(window.cycles) for window in found.exchanges)
    unexplained = int((~explained(own, stalls)).sum())
    per_million = unexplained / count * 1e6
    allowed = 1.5 * len(theirs) * count / in_c_count + 5
    return [
        Row(
            "missed, not explained",
            "<= 100 per million",
            f"{unexplained} of {count} ({per_million:.0f} per million)",
            per_million <= 100,
        ),
        Row(
            "missed, all",
            f"<= {allowed:.0f} (1.5 x C + 5)",
            f"{len(own)}; C {len(theirs)} of {in_c_count}",
            len(own) <= allowed,
        ),
        Row("stalls seen by the witness", "", str(len(stalls)), None),
    ]


def use_rows(found: RawRecord) -> list[Row]:
    """Return the lines on processors, memory and the recorder."""
    loop, recorder = found.cpu("control"), found.cpu("recorder")
    faults = sum(use_of(r, "control").page_faults for r in found.reports)
    lost = sum(report.lost for report in found.reports)
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
