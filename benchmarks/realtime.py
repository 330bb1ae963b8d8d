"""The 500 Hz loop compared with the same exchange in C, with a stall detector.

    python -m benchmarks.realtime [--seconds 60] [--windows 6] [--json]

The simulated rig runs in its own process and paces its frames like a real bus. The
wrist sensor is queried in every cycle, the recorder is on, and the control law holds
the arm. The C programs are compiled here with `cc`. A missed cycle began 0.5 ms late or
was skipped; within 4 ms of a stall seen by the witness it is explained by the machine.
"""

import argparse
import dataclasses
import json
import os
import shutil
import subprocess
import sys
import tempfile
from contextlib import closing
from pathlib import Path

import numpy as np

from acquisition.control_loop.realtime import choose_cores
from acquisition.sample import Record
from benchmarks.realtime_table import RealtimeRecord, Times, Window, table
from experiments.preflight.loop_benchmark import run_bench
from experiments.preflight.preflight import start_devices
from experiments.rig.processes import MultiProcessBackend
from experiments.rig.rig import FakeOptions, Rig, build_rig
from experiments.settings.load import Settings, load_settings

C_FILES = Path(__file__).parent / "c"


def compiled(folder: Path) -> tuple[Path, Path]:
    """Compile the C programs; return the paths of (witness, exchange)."""
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


def run_in_c(program: Path, core: int, seconds: float, bus: str = "") -> Window:
    """Run the C loop; with `bus`, the socket of a simulated arm, with the exchange."""
    command = [str(program), str(core), str(seconds)] + ([bus] if bus else [])
    done = subprocess.run(command, capture_output=True, check=True, text=True)
    return Window(
        np.array([line.split() for line in done.stdout.split("\n")[:-1]], int)
    )


def settings_with_bus_sensor() -> Settings:
    """Return the shipped settings with the wrist sensor on the arm's bus."""
    settings = load_settings(None)
    values = settings.rig.model_dump()
    shared = ("mass", "height", "angle_deg", "sign")  # settings of every sensor kind
    sensor = {name: values["ft_sensor"][name] for name in shared}
    values["ft_sensor"] = {**sensor, "kind": "barrett"}
    rig = type(settings.rig).model_validate(values)
    return dataclasses.replace(settings, rig=rig)


def alternate(windows: int, seconds: float, core: int, program: Path) -> RealtimeRecord:
    """Run the loop and the C programs in turn on `core`, `windows` times.

    Each window has its own rig, since the C program is a second bus master.
    """
    settings, record = settings_with_bus_sensor(), RealtimeRecord()
    for _ in range(windows):
        rig = build_rig(
            settings, settings.matrix.terrains[0], FakeOptions("processes", seed=1)
        )
        with closing(rig.backend):
            start_devices(rig)
            measure(rig, record, seconds, core, program)
    return record


def measure(
    rig: Rig, record: RealtimeRecord, seconds: float, core: int, program: Path
) -> None:
    """Run the loop of `rig` and then the C programs; add the results to `record`."""
    backend = rig.backend
    assert isinstance(backend, MultiProcessBackend)
    processes = {**backend.processes(), "console": os.getpid()}
    windows: list[Times] = []
    timings = backend.loop_client.timings()
    backend.loop_client.on_tick.append(lambda: windows.append(columns(timings.read())))
    report = run_bench(rig, processes, seconds)
    if not report.is_powered:
        sys.exit(f"The arm was not held to the end of a window: {report.fault}")
    backend.loop_client.on_tick.pop()
    record.reports.append(report)
    record.loops.append(Window(np.concatenate(windows)))
    backend.loop_client.idle()
    backend.end_loop()
    record.wakes.append(run_in_c(program, core, seconds / 2))
    record.exchanges.append(run_in_c(program, core, seconds, backend.bus_path))


def columns(timings: Record) -> Times:
    """Return the columns deadline, woke, replies, sent [ns] of timing records."""
    names = ("deadline_ns", "woke_ns", "replies_ns", "sent_ns")
    return np.column_stack([timings[name].astype(np.int64) for name in names])


def main() -> None:
    """Measure and print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=60.0, help="time of the loop")
    parser.add_argument("--windows", type=int, default=6)
    parser.add_argument("--json", action="store_true")
    args = parser.parse_args()
    core, other = choose_cores()
    if core is None or other is None:
        sys.exit("Two processors are needed.")
    with tempfile.TemporaryDirectory() as name:
        witness, exchange = compiled(Path(name))
        length = str(args.seconds * 3 + 20 * args.windows + 60)
        stall_file = Path(name) / "stalls"
        with stall_file.open("w") as lines:
            watching = [
                subprocess.Popen([witness, str(c), length], stdout=lines)
                for c in (core, other)
            ]
            seconds = args.seconds / args.windows
            try:
                record = alternate(args.windows, seconds, core, exchange)
            finally:
                for process in watching:
                    process.terminate()
                    process.wait()
        text = stall_file.read_text().split("\n")[:-1]
        stalls = np.array([line.split() for line in text], int).reshape(-1, 2)
    rows = table(record, stalls)
    if args.json:
        print(json.dumps([dataclasses.asdict(row) for row in rows], indent=2))
        return
    for row in rows:
        word = {None: "", True: "met", False: "NOT MET"}[row.is_met]
        print(f"{row.what:50}{row.goal:24}{row.measured:36}{word}")


if __name__ == "__main__":
    main()
