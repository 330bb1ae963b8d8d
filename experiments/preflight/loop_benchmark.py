"""Benchmark of the loop: cadence, exchange, CPU load, memory, recorder."""

from __future__ import annotations

import os
import tempfile
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from acquisition.clock import NS_PER_S
from acquisition.control_loop.timing import TIMING_DTYPE, LoopReport, loop_report
from acquisition.devices import SafetyMode
from acquisition.errors import PreflightError
from acquisition.sample import Record
from acquisition.trial_file.header import TrialHeader
from acquisition.trial_file.reader import TrialReader
from experiments.messages import FaultContext, fault_text
from experiments.session.sidecar import TIME_LIMIT

if TYPE_CHECKING:
    from experiments.rig.rig import Rig

SETTLE = 1.0  # s, before the measurement
WARM = 180.0  # s, or half of the time, after which memory must not grow
_TICKS = os.sysconf("SC_CLK_TCK")


@dataclass(frozen=True, slots=True)
class ProcessUse:
    """Resources used by one process.

    Attributes:
        name: name of the process.
        cpu: share of one core.
        growth_kb: growth of peak resident memory after the warm-up [KiB].
        page_faults: page faults after the warm-up.
    """

    name: str
    cpu: float
    growth_kb: float
    page_faults: int


@dataclass(frozen=True, slots=True)
class BenchReport:
    """Result of a benchmark of the loop.

    Attributes:
        loop: quantiles of the loop's times.
        processes: resources used by each process.
        is_powered: whether the control law ran to the end; otherwise the arm was idle.
        fault: message of the guard's fault; "" = none.
        recorded: cycles in the recorded files.
        lost: cycles lost by the recorder.
        largest_backlog: largest number of cycles waiting for the recorder.
    """

    loop: LoopReport
    processes: tuple[ProcessUse, ...]
    is_powered: bool
    fault: str
    recorded: int
    lost: int
    largest_backlog: int

    def as_dict(self) -> dict[str, Any]:
        """Return the report as plain values."""
        return asdict(self)


@dataclass(frozen=True, slots=True)
class _Usage:
    cpu_s: float
    most_resident_kb: float
    faults: int


def run_bench(rig: Rig, processes: dict[str, int], seconds: float) -> BenchReport:
    """Run the loop of `rig` for `seconds` with the recorder on, and measure.

    A real arm stays idle without torque; a simulated one is held by the control law.

    Raises:
        PreflightError: no cycle ran.
        TractionError: a process or device failed.
    """
    loop_client = rig.backend.loop_client
    is_powered = _power_up(rig)
    loop_client.advance(SETTLE)
    collected = _Collector(rig, seconds)
    with tempfile.TemporaryDirectory() as folder:
        trials = _Trials(rig, Path(folder))
        before = {name: _usage(pid) for name, pid in processes.items()}
        start_ns = rig.clock.now_ns()
        warm = min(seconds / 2, WARM)
        trials.record(warm)
        middle = {name: _usage(pid) for name, pid in processes.items()}
        trials.record(seconds - warm)
        passed = (rig.clock.now_ns() - start_ns) / NS_PER_S
        after = {name: _usage(pid) for name, pid in processes.items()}
    report = loop_report(collected.take())
    if report is None:
        raise PreflightError("No cycle ran.", hint="Try again; then: traction check.")
    verdict = loop_client.status.verdict
    fault = "" if verdict is None else fault_text(verdict, FaultContext(prompt=None))
    uses = tuple(
        _use(name, (before[name], middle[name], after[name]), passed)
        for name in processes
    )
    return BenchReport(
        loop=report,
        processes=uses,
        is_powered=is_powered and loop_client.status.safety is SafetyMode.ACTIVE,
        fault=fault,
        recorded=trials.recorded,
        lost=trials.lost,
        largest_backlog=trials.largest_backlog,
    )


class _Trials:
    """Records consecutive trials, none longer than the time limit.

    Each file begins with the second before its start, so one second of every trial is
    recorded twice; each file is verified, counted and deleted.
    """

    def __init__(self, rig: Rig, folder: Path) -> None:
        self.recorded = self.lost = self.largest_backlog = 0
        self._rig = rig
        self._path = folder / "bench.mcap"

    def record(self, seconds: float) -> None:
        """Run the loop for `seconds` with the recorder on."""
        recorder = self._rig.backend.recorder
        while seconds > 0.0:
            recorder.start(self._path, _header())
            self._rig.backend.loop_client.advance(min(seconds, TIME_LIMIT))
            seconds -= TIME_LIMIT
            self.largest_backlog = max(self.largest_backlog, recorder.largest_backlog)
            recorder.finish("bench")
            result = TrialReader(self._path).metadata["result"]
            self.recorded += int(result["cycles_written"])
            self.lost += int(result["lost_in_ring"])
            self._path.unlink()


class _Collector:
    """Reads the buffer of timings as it fills, since it holds only a minute."""

    def __init__(self, rig: Rig, seconds: float) -> None:
        self._timings = rig.backend.loop_client.timings()
        self._rig = rig
        self._count = 0
        # Allocated and touched now, since the console's memory is measured too.
        self._records = np.zeros(int(seconds * 510) + 2000, TIMING_DTYPE)
        self._records["number"] = 1
        rig.backend.loop_client.on_tick.append(self._collect)

    def _collect(self) -> None:
        new = self._timings.read()
        new = new[: len(self._records) - self._count]
        self._records[self._count : self._count + len(new)] = new
        self._count += len(new)

    def take(self) -> Record:
        """Return every record since the start."""
        self._rig.backend.loop_client.on_tick.remove(self._collect)
        return self._records[: self._count]


def _power_up(rig: Rig) -> bool:
    if rig.simulation is None:
        return False
    loop_client = rig.backend.loop_client
    loop_client.start()
    loop_client.advance(0.1)
    rig.simulation.lift()
    rig.simulation.pendant("activate")
    loop_client.advance(0.5)
    return loop_client.status.safety is SafetyMode.ACTIVE


def _header() -> TrialHeader:
    return TrialHeader(
        trial={"session": "bench"},
        utc_offset_ns=0,
        offset_uncertainty_ns=0,
        provenance={},
        attachments={},
        robot_description="",
    )


def _usage(pid: int) -> _Usage:
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    cpu = (int(fields[11]) + int(fields[12])) / _TICKS
    faults = int(fields[7]) + int(fields[9])
    return _Usage(cpu, _most_resident_kb(pid), faults)


def _most_resident_kb(pid: int) -> float:
    status = Path(f"/proc/{pid}/status").read_text()
    return float(status.partition("VmHWM:")[2].split()[0])


def _use(
    name: str, usages: tuple[_Usage, _Usage, _Usage], seconds: float
) -> ProcessUse:
    before, middle, after = usages
    return ProcessUse(
        name,
        cpu=round((after.cpu_s - before.cpu_s) / seconds, 3),
        growth_kb=round(after.most_resident_kb - middle.most_resident_kb, 1),
        page_faults=after.faults - middle.faults,
    )
