"""The 500 Hz loop beside the same exchange in C, and a witness of stalls.

    python benchmarks/realtime.py [--seconds 60] [--windows 6] [--json]

The simulated rig is a process of its own that paces its frames like a wire, the wrist
sensor is asked in every cycle, the recorder is on, the arm is held by the control law.
The C programs are compiled here with `cc`. A miss is a cycle that began 0.5 ms late or
was skipped; one within 4 ms of a witnessed stall is explained by the machine.
"""

import argparse
import dataclasses
import json
import os
import shutil
import statistics
import subprocess
import sys
import tempfile
from contextlib import closing
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from acquisition.loop import LATE_NS, PERIOD_NS
from acquisition.realtime import choose_cores
from acquisition.sample import Record
from experiments.bench import BenchReport, ProcessUse, run_bench
from experiments.preflight import start_devices
from experiments.process_crew import ProcessCrew
from experiments.rigs import FakeOptions, Rig, build_rig
from experiments.settings import Settings, load_settings

C_FILES = Path(__file__).parent / "c"
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


def compiled(folder: Path) -> tuple[Path, Path]:
    """Return the programs (witness, exchange)."""
    compiler = shutil.which("cc")
    if compiler is None:
        sys.exit("No C compiler (cc) was found; the comparison needs one.")
    built: list[Path] = []
    for name in ("witness", "exchange"):
        target = folder / name
        source = C_FILES / f"{name}.c"
        subprocess.run([compiler, "-O2", "-o", target, source], check=True)
        built.append(target)
    return built[0], built[1]


def in_c(program: Path, core: int, seconds: float, bus: str = "") -> Window:
    """Run the C loop; with `bus`, the path of a served arm, the exchange too."""
    command = [str(program), str(core), str(seconds)] + ([bus] if bus else [])
    done = subprocess.run(command, capture_output=True, check=True, text=True)
    return Window(
        np.array([line.split() for line in done.stdout.split("\n")[:-1]], int)
    )


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


def settings_with_bus_sensor() -> Settings:
    """Return the shipped settings with the wrist sensor on the arm's bus."""
    settings = load_settings(None)
    sensor = settings.rig.ft_sensor.model_copy(update={"kind": "barrett"})
    return dataclasses.replace(
        settings, rig=settings.rig.model_copy(update={"ft_sensor": sensor})
    )


@dataclasses.dataclass(slots=True)
class Found:
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


def alternate(rig: Rig, windows: int, seconds: float, program: Path) -> Found:
    """Run the loop and the C programs in turn on the same core, `windows` times."""
    crew, found = rig.crew, Found()
    core, _ = choose_cores()
    assert isinstance(crew, ProcessCrew)
    assert core is not None
    for _ in range(windows):
        processes = {**crew.processes(), "console": os.getpid()}
        kept: list[Times] = []
        timings = crew.desk.timings()
        crew.desk.on_pass.append(lambda: kept.append(columns(timings.read())))  # noqa: B023
        found.reports.append(run_bench(rig, processes, seconds))
        crew.desk.on_pass.pop()
        found.loops.append(Window(np.concatenate(kept)))
        crew.desk.idle()
        crew.end_loop()
        found.wakes.append(in_c(program, core, seconds / 2))
        found.exchanges.append(in_c(program, core, seconds, crew.bus_path))
        crew.begin()
        crew.desk.advance(0.2)
    return found


def columns(timings: Record) -> Times:
    """Return deadline, woke, replies, sent of records of the ring of timings."""
    names = ("deadline_ns", "woke_ns", "replies_ns", "sent_ns")
    return np.column_stack([timings[name].astype(np.int64) for name in names])


def quantiles(times: Times) -> str:
    """Return 50, 99 and 99.9 % and the largest [us] as text."""
    values = [*np.percentile(times, QUANTILES), times.max()]
    return " / ".join(f"{value / 1000:.0f}" for value in values) + " us"


def cycle_rows(found: Found, stalls: Times) -> list[Row]:
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


def wake_rows(found: Found) -> list[Row]:
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


def miss_rows(found: Found, stalls: Times) -> list[Row]:
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


def use_rows(found: Found) -> list[Row]:
    """Return the lines on processors, memory and the recorder."""
    loop, recorder = found.cpu("control"), found.cpu("recorder")
    faults = sum(use_of(r, "control").page_faults for r in found.reports[1:])
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


def main() -> None:
    """Measure and print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=60.0, help="of the loop")
    parser.add_argument("--windows", type=int, default=6)
    parser.add_argument("--json", action="store_true")
    args = parser.parse_args()
    core, other = choose_cores()
    if core is None or other is None:
        sys.exit("Two processors are needed.")
    with tempfile.TemporaryDirectory() as name:
        witness, exchange = compiled(Path(name))
        settings = settings_with_bus_sensor()
        row = settings.matrix.terrains[0]
        rig = build_rig(settings, row, FakeOptions(is_fast=False, seed=1))
        length = str(args.seconds * 3 + 60)
        seen = Path(name) / "stalls"
        with closing(rig.crew), seen.open("w") as lines:
            watching = [
                subprocess.Popen([witness, str(c), length], stdout=lines)
                for c in (core, other)
            ]
            start_devices(rig)
            found = alternate(rig, args.windows, args.seconds / args.windows, exchange)
            for process in watching:
                process.terminate()
                process.wait()
        text = seen.read_text().split("\n")[:-1]
        stalls = np.array([line.split() for line in text], int).reshape(-1, 2)
    rows = [
        *cycle_rows(found, stalls),
        *wake_rows(found),
        *miss_rows(found, stalls),
        *use_rows(found),
    ]
    if args.json:
        print(json.dumps([dataclasses.asdict(row) for row in rows], indent=2))
        return
    for row in rows:
        word = {None: "", True: "met", False: "NOT MET"}[row.is_met]
        print(f"{row.what:50}{row.goal:24}{row.measured:36}{word}")


if __name__ == "__main__":
    main()
